# SPDX-License-Identifier: Apache-2.0
"""Poses and Jacobians of frames, against Pinocchio on the whole robot of the URDF."""

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import models
from arm_dynamics import Dynamics, InvalidInput
from arm_dynamics.terms.evaluator import MANY
from tolerances import PINOCCHIO, assert_close

WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
Call = Callable[[Dynamics, np.ndarray, np.ndarray, str], np.ndarray]
CALLS: dict[str, Call] = {
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


@pytest.mark.parametrize("what", CALLS)
def test_one_state_is_pinocchios(robot: str, what: str, rng: np.random.Generator) -> None:
    dyn = models.dynamics(robot)
    for frame in tips(robot):
        q, v, _ = models.random_state(rng, dyn.n)
        made = CALLS[what](dyn, q, v, frame)
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


@pytest.mark.parametrize("rows", [(), (3,), (MANY,)])
def test_an_unknown_frame_is_refused_by_the_names(rows: tuple[int, ...]) -> None:
    dyn, q = models.dynamics("panda"), np.zeros((*rows, 7))
    for call in CALLS.values():
        for frame in ("panda_hnd", 7):
            with pytest.raises(
                InvalidInput, match=f"^frame '{frame}' does not exist; allowed: world"
            ):
                call(dyn, q, q, frame)  # type: ignore[arg-type]
