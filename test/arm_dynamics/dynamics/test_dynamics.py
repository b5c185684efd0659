# SPDX-License-Identifier: Apache-2.0
"""Numeric answers, also of frames, against Pinocchio called directly, on every robot."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import models
from arm_dynamics import ArmError, Dynamics, InvalidInput, Term
from arm_dynamics.terms.evaluator import MANY
from models.asked import CALLS as EVERY
from tolerances import ALGEBRA, CLOSED_FORM, PINOCCHIO, ROUNDING, assert_close

STATES = 10
Ask = Callable[..., Any]


def states(rng: np.random.Generator, n: int) -> list[tuple[np.ndarray, ...]]:
    return [models.random_state(rng, n) for _ in range(STATES)]


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
    assert list(dyn.joint_names) == oracle.joint_names
    for state in states(rng, dyn.n):
        assert_close(ask(dyn, *state), ask(oracle, *state), tolerance)


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


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
@pytest.mark.parametrize("rows", [1, 5])
def test_rows_of_batches_equal_single_calls(
    call: Ask, rows: int, rng: np.random.Generator
) -> None:
    dyn = models.dynamics("gripper")
    batch = np.array([models.random_state(rng, dyn.n) for _ in range(rows)]).swapaxes(0, 1)
    alone = np.array([call(dyn, *row) for row in zip(*batch, strict=True)])
    np.testing.assert_array_equal(call(dyn, *batch), alone)


def test_accelerations_lose_no_digits_to_where_the_arm_stands() -> None:
    dyn, rng = Dynamics("ur5e"), np.random.default_rng(0)
    for q, v, tau in rng.uniform(-1.0, 1.0, (200, 3, dyn.n)):
        assert_close(dyn.inverse(q, v, dyn.forward(q, v, tau)), tau, ROUNDING)


GOOD = np.zeros(3)
BAD = {
    "too short": np.zeros(2), "too long": np.zeros(4), "scalar": 0.0, "empty": [],
    "column": np.zeros((3, 1)), "cube": np.zeros((2, 2, 3)), "no rows": np.zeros((0, 3)),
    "NaN": [0.0, np.nan, 0.0], "infinite": [0.0, np.inf, 0.0], "words": ["a", "b", "c"],
    "nothing": None, "ragged": [[0.0, 0.0, 0.0], [0.0]], "mapping": {"joint1": 0.0},
    "complex": np.array([1j, 0, 0]),
}  # fmt: skip


@pytest.mark.parametrize("value", BAD.values(), ids=BAD)
def test_every_method_refuses_by_the_name_of_the_argument(value: object) -> None:
    dyn = models.dynamics("planar_3r")
    for name, call in (
        ("q", lambda: dyn.inverse(value, GOOD, GOOD)),
        ("v", lambda: dyn.inverse(GOOD, value, GOOD)),
        ("a", lambda: dyn.inverse(GOOD, GOOD, value)),
        ("tau", lambda: dyn.forward(GOOD, GOOD, value)),
        ("q", lambda: dyn.mass_matrix(value)),
        ("q", lambda: dyn.gravity(value)),
        ("v", lambda: dyn.coriolis_matrix(GOOD, value)),
        ("v", lambda: dyn.friction(value)),
        ("q", lambda: dyn.energy(value, GOOD)),
    ):
        with pytest.raises(InvalidInput, match=f"^{name}") as caught:
            call()
        assert isinstance(caught.value, ValueError) and isinstance(caught.value, ArmError)
    with pytest.raises(TypeError):
        dyn.friction(GOOD, GOOD)  # q and v, as of every other method


def test_no_motion_that_is_not_finite_has_torques(robot: str) -> None:
    """However many calls there were, at whatever joint of whatever kind."""
    dyn = models.dynamics(robot).of_motions()
    for place, joint in np.ndindex(3, dyn.n):
        motion = np.random.default_rng(0).uniform(-1.0, 1.0, (3, dyn.n))
        motion[place, joint] = np.nan
        with pytest.raises(InvalidInput, match=f"^{'qva'[place]}.*finite"):
            dyn.inverse(*motion)


G = 9.81


def test_pendulum(rng: np.random.Generator) -> None:
    """m l² a + m g l sin q = tau."""
    dyn = models.dynamics("pendulum")
    for _ in range(20):
        q, v, a = models.random_state(rng, 1)
        assert_close(dyn.inverse(q, v, a), a + G * np.sin(q), CLOSED_FORM)
        assert_close(dyn.forward(q, v, a), a - G * np.sin(q), CLOSED_FORM)
        kinetic, potential = dyn.energy(q, v)
        assert_close([kinetic, potential], [v[0] ** 2 / 2, -G * np.cos(q[0])], CLOSED_FORM)


def test_gantry(rng: np.random.Generator) -> None:
    """Slides only: M is constant, nothing couples, and gravity acts along the incline of 0.6."""
    dyn = models.dynamics("gantry")
    for _ in range(20):
        q, v, a = models.random_state(rng, 2)
        assert_close(dyn.inverse(q, v, a), [15 * a[0] + 15 * G * 0.6, 3 * a[1]], CLOSED_FORM)
        assert_close(dyn.coriolis_matrix(q, v), np.zeros((2, 2)), CLOSED_FORM)


WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
OF_FRAMES: dict[str, Ask] = {
    "pose": lambda d, q, v, frame: d.pose(q, frame),
    "jacobian": lambda d, q, v, frame: d.jacobian(q, frame),
    "jacobian_derivative": lambda d, q, v, frame: d.jacobian_derivative(q, v, frame),
}


def tips(name: str) -> list[str]:
    """The first frame, which is fixed, one in the middle and the last."""
    frames = models.dynamics(name).model.frame_names
    return [frames[1], frames[len(frames) // 2], frames[-1]]


def expected(name: str, what: str, q: np.ndarray, v: np.ndarray, frame: str) -> np.ndarray:
    """Through the full tree, followers and locked joints by the map from the joints."""
    oracle = models.oracle(name)
    model, data = oracle.model, oracle.data
    index = model.getFrameId(frame)
    pin.computeJointJacobiansTimeVariation(model, data, oracle.full(q), oracle.P @ v)
    pin.updateFramePlacements(model, data)
    if what == "pose":
        return np.array(data.oMf[index].homogeneous)
    ask = pin.getFrameJacobian if what == "jacobian" else pin.getFrameJacobianTimeVariation
    J = ask(model, data, index, WORLD).reshape(6, -1)
    return np.asarray(J @ oracle.P)


@pytest.mark.parametrize("what", OF_FRAMES)
def test_frames_are_pinocchios(robot: str, what: str, rng: np.random.Generator) -> None:
    dyn = models.dynamics(robot)
    for frame in tips(robot):
        q, v, _ = models.random_state(rng, dyn.n)
        made = OF_FRAMES[what](dyn, q, v, frame)
        wanted = expected(robot, what, q, v, frame)
        assert made.shape == wanted.shape
        assert_close(made, wanted, PINOCCHIO)


@pytest.mark.parametrize("frame", ["world", "panda_link0"])
def test_a_frame_that_does_not_move(frame: str, rng: np.random.Generator) -> None:
    dyn = models.dynamics("panda")
    for rows in ((), (MANY,)):
        q = rng.normal(size=(*rows, 7))
        here = np.broadcast_to(np.eye(4), (*rows, 4, 4))
        np.testing.assert_array_equal(dyn.pose(q, frame), here)
        assert not dyn.jacobian(q, frame).any()
        assert not dyn.jacobian_derivative(q, q, frame).any()


@pytest.mark.parametrize("call", OF_FRAMES.values(), ids=OF_FRAMES)
def test_an_unknown_frame_is_refused_by_the_names(call: Ask) -> None:
    for q in np.zeros(7), np.zeros((MANY, 7)):
        with pytest.raises(InvalidInput, match="^frame 'hnd' does not exist; allowed: world"):
            call(models.dynamics("panda"), q, q, "hnd")
