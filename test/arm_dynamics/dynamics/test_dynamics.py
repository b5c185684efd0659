# SPDX-License-Identifier: Apache-2.0
"""Numeric answers against Pinocchio called directly, on every robot."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import models
from arm_dynamics import Dynamics, Term
from models.asked import CALLS as EVERY
from tolerances import ALGEBRA, PINOCCHIO, ROUNDING, assert_close

STATES = 30
Ask = Callable[..., Any]


def states(rng: np.random.Generator, n: int) -> list[tuple[np.ndarray, ...]]:
    return [models.random_state(rng, n) for _ in range(STATES)]


def test_joint_order(robot: str) -> None:
    assert list(models.dynamics(robot).joint_names) == models.oracle(robot).joint_names


ASKED: dict[str, tuple[Ask, float]] = {
    "inverse": (lambda d, q, v, x: d.inverse(q, v, x), PINOCCHIO),
    "mass_matrix": (lambda d, q, v, x: d.mass_matrix(q), PINOCCHIO),
    "coriolis_matrix": (lambda d, q, v, x: d.coriolis_matrix(q, v), PINOCCHIO),
    "gravity": (lambda d, q, v, x: d.gravity(q), PINOCCHIO),
    "friction": (lambda d, q, v, x: d.friction(v), PINOCCHIO),
    "kinetic energy": (lambda d, q, v, x: d.energy(q, v)[0], PINOCCHIO),
    "forward": (lambda d, q, v, x: d.forward(q, v, x), ALGEBRA),
}


@pytest.mark.parametrize(("ask", "tolerance"), ASKED.values(), ids=ASKED)
def test_answers_are_pinocchios(
    robot: str, ask: Ask, tolerance: float, rng: np.random.Generator
) -> None:
    dyn, oracle = models.dynamics(robot), models.oracle(robot)
    for state in states(rng, dyn.n):
        assert_close(ask(dyn, *state), ask(oracle, *state), tolerance)


def test_potential_energy_difference(robot: str, rng: np.random.Generator) -> None:
    """The zero of potential energy is arbitrary; its differences are not."""
    dyn, oracle = models.dynamics(robot), models.oracle(robot)
    at_zero = dyn.energy(np.zeros(dyn.n), np.zeros(dyn.n))[1]
    oracle_at_zero = oracle.energy(np.zeros(dyn.n), np.zeros(dyn.n))[1]
    scale = models.scene(robot).gravity[2] * dyn.model.total_mass
    for q, v, _ in states(rng, dyn.n):
        change = (dyn.energy(q, v)[1] - at_zero) / scale
        assert_close(change, (oracle.energy(q, v)[1] - oracle_at_zero) / scale, PINOCCHIO)


def test_each_term_is_what_its_name_says(robot: str, rng: np.random.Generator) -> None:
    dyn = models.dynamics(robot)
    for q, v, a in states(rng, dyn.n):
        assert_close(dyn.inverse(q, v, a, Term.INERTIA), dyn.mass_matrix(q) @ a, PINOCCHIO)
        assert_close(dyn.inverse(q, v, a, Term.CORIOLIS), dyn.coriolis_matrix(q, v) @ v, PINOCCHIO)
        assert_close(dyn.inverse(q, v, a, Term.GRAVITY), dyn.gravity(q), PINOCCHIO)
        assert_close(dyn.inverse(q, v, a, Term.FRICTION), dyn.friction(v), PINOCCHIO)


def test_every_mask_is_the_sum_of_its_bits(rng: np.random.Generator) -> None:
    dyn = models.dynamics("planar_3r")
    q, v, a = models.random_state(rng, dyn.n)
    for mask in range(32):
        parts = [dyn.inverse(q, v, a, terms=bit) for bit in Term if mask & bit]
        assert_close(dyn.inverse(q, v, a, terms=mask), sum(parts, np.zeros(dyn.n)), PINOCCHIO)


CALLS = EVERY | {"inverse without friction": lambda d, q, v, x: d.inverse(q, v, x, terms=7)}


@pytest.mark.parametrize("name", ["panda", "kinova", "gripper", "gantry"])
@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
@pytest.mark.parametrize("rows", [1, 5])
def test_rows_of_batches_equal_single_calls(
    name: str, call: Ask, rows: int, rng: np.random.Generator
) -> None:
    dyn = models.dynamics(name)
    batch = np.array([models.random_state(rng, dyn.n) for _ in range(rows)]).swapaxes(0, 1)
    alone = np.array([call(dyn, *row) for row in zip(*batch, strict=True)])
    np.testing.assert_array_equal(call(dyn, *batch), alone)


def test_panda_by_pinocchio_in_plain_sight(rng: np.random.Generator) -> None:
    """No helper in between: the reduced Panda and its damping, as Pinocchio's own manual would do
    it.
    """
    whole = pin.buildModelFromXML(models.scene("panda").robot.urdf)
    fingers = [whole.getJointId(f"panda_finger_joint{i}") for i in (1, 2)]
    panda = pin.buildReducedModel(whole, fingers, pin.neutral(whole))
    data, dyn = panda.createData(), models.dynamics("panda")
    assert list(dyn.joint_names) == list(panda.names)[1:]
    for q, v, a in states(rng, 7):
        assert_close(dyn.inverse(q, v, a), pin.rnea(panda, data, q, v, a) + 0.003 * v, PINOCCHIO)
        assert_close(dyn.forward(q, v, a), pin.aba(panda, data, q, v, a - 0.003 * v), ALGEBRA)
        kinetic, potential = dyn.energy(q, v)
        assert_close(kinetic, pin.computeKineticEnergy(panda, data, q, v), PINOCCHIO)
        assert_close(potential, pin.computePotentialEnergy(panda, data, q), PINOCCHIO)


def test_answers_are_the_callers_own(rng: np.random.Generator) -> None:
    """A second call must not overwrite the results of the first one."""
    dyn = models.dynamics("scara")
    q, v, a = models.random_state(rng, dyn.n)
    calls = (
        lambda q: dyn.inverse(q, v, a),
        lambda q: dyn.forward(q, v, a),
        dyn.gravity,
        dyn.mass_matrix,
        lambda q: dyn.coriolis_matrix(q, v),
        lambda q: dyn.inverse(q, v, a, Term.GRAVITY),
    )
    for call in calls:
        first = call(q)
        kept = first.copy()
        call(q + 1.0)
        np.testing.assert_array_equal(first, kept)


def test_accelerations_lose_no_digits_to_where_the_arm_stands() -> None:
    dyn, rng = Dynamics("ur5e"), np.random.default_rng(0)
    for q, v, tau in rng.uniform(-1.0, 1.0, (200, 3, dyn.n)):
        assert_close(dyn.inverse(q, v, dyn.forward(q, v, tau)), tau, ROUNDING)
