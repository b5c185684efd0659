# SPDX-License-Identifier: Apache-2.0
"""Constrained dynamics of large batches: compiled code gives the results of single points."""

import numpy as np
import pytest
from samples import always

import models
from arm_dynamics import Dynamics
from arm_dynamics.terms.evaluator import MANY
from models.linkages import scene
from tolerances import ALGEBRA, INVERSE_PAIR, assert_close

ROWS = 20  # compared with single calls
POSITION = {"at": [-1.0, 0.0, 2.0], "factor": [1.0, 2.0, 0.5]}
LOAD = {"at": [0.0, 20.0], "factor": [1.0, 2.0]}


def closed(dyn: Dynamics, rows: int, rng: np.random.Generator) -> list[np.ndarray]:
    """Torques and states that obey the constraints, along one motion of the mechanism."""
    closure, states = dyn.constrained.closure, []
    q, v = dyn.model.q0, dyn.model.v0
    for _ in range(ROWS):
        q, v = closure.closed(q + 0.02 * v / max(1.0, abs(v).max()), rng.normal(size=dyn.n))
        states.append((q, v))
    q, v = (np.resize(np.array(x), (rows, dyn.n)) for x in zip(*states, strict=True))
    return [q, v, rng.normal(size=(rows, dyn.n))]


def agrees(dyn: Dynamics, batch: list[np.ndarray], active: tuple[str, ...] | None = None) -> None:
    a, lam = dyn.constrained_forward(*batch, active)
    assert (len(a), len(lam)) == (len(batch[0]),) * 2
    for k in range(ROWS):
        alone = dyn.constrained_forward(*(x[k] for x in batch), active)
        assert_close(a[k], alone[0], ALGEBRA)
        assert_close(lam[k], alone[1], ALGEBRA)


@pytest.mark.parametrize("name", always(models.HELD, "parallel_gripper", "panda_pen"))
def test_equals_single_calls(name: str, rng: np.random.Generator) -> None:
    dyn = models.dynamics(name)
    batch = closed(dyn, MANY, rng)
    agrees(dyn, batch)
    a, lam = dyn.constrained_forward(*batch)
    np.testing.assert_array_equal(dyn.forward(*batch), a)
    assert_close(dyn.constrained_inverse(*batch[:2], a, lam), batch[2], INVERSE_PAIR)
    agrees(dyn, [rng.uniform(-1.5, 1.5, x.shape) for x in batch])  # wide open


@pytest.mark.parametrize("active", [("hinge",), ("axis",), ()])
def test_some_of_the_constraints(active: tuple[str, ...], rng: np.random.Generator) -> None:
    dyn = models.dynamics("bricard")
    agrees(dyn, [rng.uniform(-1.0, 1.0, (MANY, dyn.n)) for _ in range(3)], active)


def test_an_answer_does_not_depend_on_questions_before(rng: np.random.Generator) -> None:
    """With a position from which Bricard's linkage cannot be closed as first and as last point."""
    first, later = (Dynamics(scene("bricard")) for _ in range(2))
    far = rng.uniform(-1.0, 1.0, (3, first.n))
    near = later.model.q0, later.model.v0, far[2]
    later.forward(*near)
    np.testing.assert_array_equal(first.forward(*far), later.forward(*far))
    np.testing.assert_array_equal(first.forward(*near), later.forward(*near))


def test_friction_by_position_and_load(rng: np.random.Generator) -> None:
    """Inverse dynamics with the forces that forward dynamics gives is its inverse."""
    friction = {"coulomb": 0.3, "viscous": 0.1, "position": POSITION, "load": LOAD}
    dyn = Dynamics(scene("five_bar", joints={"*": {"friction": friction}}))
    q, v, tau = closed(dyn, 3, rng)
    tau *= 10.0
    a, lam = dyn.constrained_forward(q, v, tau)
    assert_close(dyn.constrained_inverse(q, v, a, lam), tau, INVERSE_PAIR)
    assert abs(dyn.friction(v, q=q, load=tau) - dyn.friction(v, q=0 * q)).max() > 1e-3
