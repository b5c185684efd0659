# SPDX-License-Identifier: Apache-2.0
"""Large batches run in compiled code: the same answers as Pinocchio's, point by point."""

from __future__ import annotations

import numpy as np
import pytest

import models
from arm_dynamics import Dynamics, KernelError, compiler
from arm_dynamics.batch import check_inverse, compiled_inverse
from arm_dynamics.dynamics import MANY, Term
from tolerances import ALGEBRA

ROBOTS = ("panda", "kinova", "gripper", "gantry", "two_arms", "pendulum")
TERMS = (Term.ALL, Term.INERTIA, Term.CORIOLIS, Term.GRAVITY, Term.INERTIA | Term.GRAVITY, 0)


def states(dyn: Dynamics, rows: int, rng: np.random.Generator) -> list[np.ndarray]:
    many = [models.random_state(rng, dyn.n) for _ in range(rows)]
    return [np.array(x) for x in zip(*many, strict=True)]


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("terms", TERMS, ids=str)
def test_equals_single_calls(name: str, terms: int, rng: np.random.Generator) -> None:
    dyn = models.dynamics(name)
    batch = states(dyn, MANY, rng)
    alone = np.array([dyn.inverse(*row, terms) for row in zip(*batch, strict=True)])
    scale = max(1.0, abs(alone).max())
    np.testing.assert_allclose(dyn.inverse(*batch, terms) / scale, alone / scale, 0.0, ALGEBRA)


def test_rows_do_not_depend_on_their_neighbours(rng: np.random.Generator) -> None:
    dyn = models.dynamics("panda")
    q, v, a = states(dyn, 2 * MANY, rng)
    together = dyn.inverse(q, v, a)
    order = rng.permutation(len(q))
    np.testing.assert_array_equal(together[order], dyn.inverse(q[order], v[order], a[order]))
    np.testing.assert_array_equal(together[:MANY], dyn.inverse(q[:MANY], v[:MANY], a[:MANY]))


def test_vectors_that_serve_every_row_and_strides(rng: np.random.Generator) -> None:
    dyn = models.dynamics("panda")
    q = rng.uniform(-1.0, 1.0, (dyn.n, 2 * MANY)).T[::2]
    at_rest = dyn.inverse(q, np.zeros(dyn.n), np.zeros(dyn.n))
    np.testing.assert_allclose(at_rest, dyn.gravity(q), 0.0, 1e-10)


def test_without_a_compiler_pinocchio_answers(
    monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    monkeypatch.setattr(compiler, "find_compiler", lambda *_: None)
    dyn = Dynamics(models.scene("two_link"))
    batch = states(dyn, MANY, rng)
    alone = np.array([dyn.inverse(*row) for row in zip(*batch, strict=True)])
    np.testing.assert_array_equal(dyn.inverse(*batch), alone)


def test_on_a_full_disk_pinocchio_answers(
    monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(compiler, "build", full)
    dyn = Dynamics(models.scene("two_link"))
    batch = states(dyn, MANY, rng)
    alone = np.array([dyn.inverse(*row) for row in zip(*batch, strict=True)])
    np.testing.assert_array_equal(dyn.inverse(*batch), alone)


def test_code_that_differs_from_pinocchio_is_refused() -> None:
    dyn = models.dynamics("two_link")
    right = compiled_inverse(dyn.model, dyn._inverse)
    assert right is not None
    assert check_inverse(dyn.model, dyn._inverse, right) < ALGEBRA
    with pytest.raises(KernelError, match=r"differs from Pinocchio by 1\.\d+e-06"):
        check_inverse(dyn.model, dyn._inverse, lambda *x: right(*x) * (1 + 1e-6))
