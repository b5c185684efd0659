# SPDX-License-Identifier: Apache-2.0
"""Limits of a robot as those of a trajectory, and joint positions on a path against them."""

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, Dynamics, Unreachable, load_scene
from arm_dynamics.task_space import TaskSpace
from arm_dynamics.trajectory import Limits
from arm_dynamics.trajectory.joint_paths import check_limits

SCARA = str(models.FOLDER / "scara.urdf")


def test_limits_of_a_robot() -> None:
    """Of a speed limit of zero, which plans nothing, is made none."""
    slow = {"inner": {"limits": {"velocity": 0.0}}, "slide": {"limits": {"velocity": 0.5}}}
    model = ArmModel(load_scene({"robot": {"urdf": SCARA}, "joints": slow}))
    limits = Limits.of(model, 3.0)
    assert limits.velocity.tolist() == [np.inf, 8.0, 0.5, np.inf]
    assert limits.acceleration.tolist() == [3.0] * 4
    assert limits.lower.tolist() == [-2.6, -2.6, 0.0, -np.inf]
    assert limits.upper.tolist() == [2.6, 2.6, 0.2, np.inf]
    assert [limits.name(i) for i in range(4)] == ["inner", "outer", "slide", "spin"]
    assert Limits.of(model).acceleration.tolist() == [np.inf] * 4


@pytest.fixture(scope="module")
def task() -> TaskSpace:
    """Of a slide that goes from 0 to 0.2 m, between joints that go from -2.6 to 2.6 rad."""
    own = {"slide": {"limits": {"upper": 0.25}}, "outer": {"limits": {"upper": 0.0}}}
    dynamics = Dynamics({"robot": {"urdf": SCARA}, "joints": own})
    return TaskSpace(dynamics, "spin", selection="position")


@pytest.mark.parametrize(
    ("joint", "off", "lower", "upper"), [("slide", -1.0, 0.0, 0.25), ("outer", 1.0, -2.6, 0.0)]
)
def test_joints_of_a_path_may_be_at_their_limits_and_not_beyond(
    task: TaskSpace, joint: str, off: float, lower: float, upper: float
) -> None:
    """A billionth of a radian or metre is rounding; limits at zero, where it is exact."""
    place, unit = task.model.joint_names.index(joint), "m" if joint == "slide" else "rad"
    q = np.array([0.1, -0.1, 0.1, 100.0])
    q[place] = 1e-9 * off
    check_limits(task, q, 0.25)
    q[place] = 1.001e-9 * off
    with pytest.raises(Unreachable) as caught:
        check_limits(task, q, 0.25)
    assert str(caught.value) == (
        f"at 25.0% of the path joint '{joint}' would be at {q[place]:.6g} {unit}; "
        f"allowed: {lower:g} to {upper:g} {unit}"
    )
    assert caught.value.residual == 1.001e-9
