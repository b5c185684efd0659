# SPDX-License-Identifier: Apache-2.0
"""Terms of controllers at a frame, as numbers and as expressions, on every robot."""

import numpy as np
import pytest
from samples import sampled

import models
from arm_dynamics import ArmModel, ModelError, load_scene
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.task_space import TaskSpace
from arm_dynamics.task_space.axes import AXES
from arm_dynamics.task_space.instant import TaskInstant, frame_functions
from tolerances import ALGEBRA, INVERSE_PAIR, assert_close

SOME = [AXES, ("x", "z", "ry"), ("rz",)]
EACH = sampled(models.ROBOTS, 3)
built = one_at_a_time(frame_functions)


def last_frame(model: ArmModel) -> str:
    return [frame.name for frame in model.pin.frames if frame.parentJoint > 0][-1]


@pytest.mark.parametrize("robot", EACH)
@pytest.mark.parametrize("axes", SOME, ids="".join)
def test_an_instant_is_what_the_task_space_says(
    robot: str, axes: tuple[str, ...], rng: np.random.Generator
) -> None:
    """Matrices of one column are matrices still."""
    dyn = models.dynamics(robot)
    task = TaskSpace(dyn, last_frame(dyn.model), selection=axes)
    state, _ = built(dyn.model, task.frame, axes)
    for _ in range(3):
        q, v, _ = models.random_state(rng, dyn.n)
        terms, now = task.terms(q, v), task.instant(q, v)
        *parts, bound = state(q, v)
        for made, numbers in zip(parts[:-1], now, strict=False):
            assert_close(np.array(made).reshape(numbers.shape), numbers, ALGEBRA)
        assert not terms.damped or float(bound) > 1.0 / task.threshold
        if not terms.damped and terms.condition < 30.0:
            assert_close(np.array(parts[-1]), terms.inertia, INVERSE_PAIR)
        assert_close(now.J, terms.jacobian, ALGEBRA)
        assert_close(now.drift, terms.bias, ALGEBRA)
        assert_close(now.M, dyn.mass_matrix(q), ALGEBRA)
        assert_close(now.bias, dyn.inverse(q, v, 0 * v, 6), ALGEBRA)
        assert_close(now.M @ now.B, now.J.T, INVERSE_PAIR)
        assert_close(now.inertia, terms.inertia, INVERSE_PAIR)


def test_what_is_answered_is_the_callers_own() -> None:
    task = TaskSpace(models.dynamics("two_link"), "tip", selection=("x", "z"))
    held = task.instant(np.ones(2), np.ones(2))
    kept = TaskInstant._make(part.copy() for part in held)
    task.instant(np.zeros(2), np.zeros(2))
    for before, after in zip(kept, held, strict=True):
        np.testing.assert_array_equal(before, after)


def test_a_joint_without_mass_is_named() -> None:
    urdf = """<robot name="bare"><link name="base"/><link name="rod"/>
      <joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/>
      <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
    task = TaskSpace(ArmModel(load_scene({"robot": {"urdf": urdf}})), "rod", selection=("rz",))
    with pytest.raises(ModelError, match="a joint that carries frame 'rod' moves no mass"):
        task.instant(np.zeros(1), np.zeros(1))
