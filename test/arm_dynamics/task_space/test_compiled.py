# SPDX-License-Identifier: Apache-2.0
"""Compiled terms of a frame against Pinocchio, on every robot, and what is built when."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from samples import sampled

import models
from arm_dynamics import ArmModel, KernelError, ModelError, load_scene
from arm_dynamics.task_space import AXES, TaskSpace
from arm_dynamics.task_space import compiled as task_kernel
from arm_dynamics.task_space.compiled import TaskKernel
from arm_dynamics.task_space.inertia import THRESHOLD
from tolerances import ALGEBRA, INVERSE_PAIR, assert_close

SOME = [AXES, ("x", "z", "ry")]
EACH = sampled(models.ROBOTS, 6)


def last_frame(model: ArmModel) -> str:
    return [frame.name for frame in model.pin.frames if frame.parentJoint > 0][-1]


@pytest.mark.parametrize("robot", EACH)
@pytest.mark.parametrize("axes", SOME, ids="".join)
def test_a_look_is_what_the_task_space_says(
    robot: str, axes: tuple[str, ...], rng: np.random.Generator
) -> None:
    model = models.dynamics(robot).model
    task = TaskSpace(model, last_frame(model), selection=axes)
    kernel = TaskKernel(model, task.frame, axes, THRESHOLD)
    for _ in range(5):
        q, v, _ = models.random_state(rng, model.n)
        now, terms = kernel.state(q, v), task.terms(q, v)
        assert_close(now.position, terms.position, ALGEBRA)
        assert_close(now.rotation, terms.rotation, ALGEBRA)
        assert_close(now.J, terms.jacobian, ALGEBRA)
        assert_close(now.velocity, terms.velocity, ALGEBRA)
        assert_close(now.drift, terms.bias, ALGEBRA)
        assert_close(now.M, models.dynamics(robot).mass_matrix(q), ALGEBRA)
        assert_close(now.bias, models.dynamics(robot).inverse(q, v, 0 * v, 6), ALGEBRA)
        assert_close(now.M @ now.B, now.J.T, ALGEBRA)
        assert_close(now.A, now.J @ now.B, ALGEBRA)
        if not terms.damped and terms.condition < 30.0:
            assert_close(now.inertia @ now.A, np.eye(len(axes)), INVERSE_PAIR)
            assert_close(now.inertia, terms.inertia, INVERSE_PAIR)


@pytest.mark.parametrize("robot", EACH)
def test_a_reference_in_joints_means_a_motion_of_the_frame(
    robot: str, rng: np.random.Generator
) -> None:
    model = models.dynamics(robot).model
    task = TaskSpace(model, last_frame(model))
    q, v, a = models.random_state(rng, model.n)
    made = TaskKernel(model, task.frame, AXES, THRESHOLD).frame_motion(q, v, a)
    for one, other in zip(made, task.motion.accelerated(q, v, a), strict=True):
        assert_close(one, other, ALGEBRA)


@pytest.mark.parametrize("q", [np.zeros(7), [0.0, 0.0, 0.0, -1e-9, 0.0, 0.0, 0.0]])
def test_at_a_singularity_it_answers_damped_as_the_task_space(q: np.ndarray) -> None:
    task = TaskSpace(models.dynamics("panda"), "panda_hand_tcp")
    now = TaskKernel(task.model, task.frame, AXES, THRESHOLD).state(np.array(q), np.zeros(7))
    terms = task.terms(q)
    assert terms.damped
    assert_close(now.inertia, terms.inertia, 1e-6)  # of 1e4: eigenvectors of a singular matrix
    assert np.isfinite(now.inertia).all()


def test_a_frame_is_built_once_for_a_model(monkeypatch: pytest.MonkeyPatch) -> None:
    model = ArmModel(models.scene("two_link"))
    first = TaskKernel(model, "tip", ("x", "y"), 1e-4)
    monkeypatch.setattr(task_kernel, "expressions", None)
    again = TaskKernel(model, "tip", ("x", "y"), 1e-2)
    held = first.state(np.ones(2), np.ones(2)).position
    before = held.copy()
    again.state(np.zeros(2), np.ones(2))
    np.testing.assert_array_equal(held, before)  # memory of its own


def test_a_wrong_kernel_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    right = task_kernel.jacobian
    monkeypatch.setattr(task_kernel, "jacobian", lambda *given: 1.000001 * right(*given))
    with pytest.raises(KernelError, match="generated J of frame 'tip' differs from Pinocchio"):
        TaskKernel(ArmModel(models.scene("two_link")), "tip", ("x", "y"), 1e-4)


def test_rounding_of_large_torques_is_not_taken_for_a_mistake() -> None:
    robot = {"urdf": str(models.SCENES / "two_link.urdf")}
    heavy = load_scene({"robot": robot, "gravity": [0.0, 0.0, -1e9]})
    TaskKernel(ArmModel(heavy), "tip", ("x", "z"), THRESHOLD)


def test_a_joint_without_mass_is_named() -> None:
    urdf = """<robot name="bare"><link name="base"/><link name="rod"/>
      <joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/>
      <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
    with pytest.raises(ModelError, match="a joint that carries frame 'rod' moves no mass"):
        TaskKernel(ArmModel(load_scene({"robot": {"urdf": urdf}})), "rod", ("rz",), 1e-4)


@pytest.mark.parametrize("axes", [("rz",), ("x",), ("rx", "ry", "rz")])
def test_few_axes(axes: tuple[str, ...], rng: np.random.Generator) -> None:
    """Matrices of one column are matrices still."""
    for robot in ("panda", "pendulum"):
        model = models.dynamics(robot).model
        task = TaskSpace(model, last_frame(model), selection=axes)
        q, v, _ = models.random_state(rng, model.n)
        now, terms = TaskKernel(model, task.frame, axes, THRESHOLD).state(q, v), task.terms(q, v)
        assert_close(now.J, terms.jacobian, ALGEBRA)
        assert now.B.shape == (model.n, len(axes))
        assert_close(now.inertia, terms.inertia, 1e-6)


@pytest.mark.parametrize(("off", "used"), [(9e-11, True), (1.1e-10, False)])
def test_small_numbers_are_compared_as_numbers_of_one(
    off: float, used: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A position within 0.9 m, off by a little."""
    right = task_kernel.placement

    def wrong(*given: Any) -> Any:
        position, rotation = right(*given)
        return position + off, rotation

    monkeypatch.setattr(task_kernel, "placement", wrong)
    model = ArmModel(models.scene("two_link"))
    if used:
        assert task_kernel.build(model, "tip", ("x", "z"))
    else:
        with pytest.raises(KernelError, match="position of frame 'tip' differs"):
            task_kernel.build(model, "tip", ("x", "z"))
    assert bool(task_kernel._built[model]) == used
