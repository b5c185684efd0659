# SPDX-License-Identifier: Apache-2.0
"""Inverse kinematics and joint paths: poses reached, paths followed, requests refused."""

import numpy as np
import pinocchio as pin
import pytest

import models
from arm_dynamics import ArmError, InvalidInput, Unreachable
from arm_dynamics.task_space import InverseKinematics, Pose, TaskSpace
from arm_dynamics.task_space.inverse_kinematics import checked_pose
from arm_dynamics.trajectory import circle, joint_path, line, paced, timed

FRAMES = {"panda": "panda_hand_tcp", "ur10": "tool0", "puma560": None, "kinova": None}


def task_of(name: str, selection: object = "pose") -> TaskSpace:
    model = models.dynamics(name).model
    return TaskSpace(model, FRAMES[name] or model.frame_names[-1], selection=selection)


@pytest.mark.parametrize("name", FRAMES)
def test_reachable_poses_are_reached_within_limits(name: str, rng: np.random.Generator) -> None:
    task = task_of(name)
    model, solver = task.model, InverseKinematics(task)
    low = np.where(np.isfinite(model.position_lower), model.position_lower, -np.pi)
    high = np.where(np.isfinite(model.position_upper), model.position_upper, np.pi)
    for q in rng.uniform(low, high, (4, model.n)):
        wanted = task.pose(q)
        found = solver.reach(wanted)
        got = task.pose(found)
        np.testing.assert_allclose(got.position, wanted.position, atol=2e-9)
        np.testing.assert_allclose(got.rotation, wanted.rotation, atol=3e-9)
        assert np.all(found >= model.position_lower) and np.all(found <= model.position_upper)


def test_a_near_seed_keeps_the_branch(rng: np.random.Generator) -> None:
    task = task_of("ur10")
    q = task.model.q0 + [0.3, -1.0, 1.2, -0.4, 0.8, 0.2]
    found = InverseKinematics(task).solve(task.pose(q), q + 0.02 * rng.normal(size=6))
    assert found.reached and found.seeds == 1
    np.testing.assert_allclose(found.q, q, atol=1e-6)


@pytest.mark.parametrize(("name", "q"), [
    ("puma560", [-0.3, 1.7, 0.0, -0.7, 0.4, 4.6]),
    ("panda", [1.3, 1.2, -1.3, -2.4, 0.8, 3.0, 2.7]),
    ("panda", [2.1, 1.3, 2.2, -1.7, -1.3, 0.0, 0.8]),
], ids=["slow twice", "along upper limits", "along lower limits"])  # fmt: skip
def test_one_seed_gets_there(name: str, q: list[float]) -> None:
    """After stretches of no gain, and past joints that stop at either end."""
    task = task_of(name)
    pose, solver = task.pose(np.array(q)), InverseKinematics(task, seeds=1)
    found = solver.solve(pose)
    matrix = np.block([[pose.rotation, pose.position[:, None]], [np.zeros(3), 1.0]])
    assert np.array_equal(solver.reach(matrix), found.q)
    assert found.reached and found.distance <= 1e-9 and found.angle <= 1e-9


def test_out_of_reach_is_said_with_what_is_missing() -> None:
    task = task_of("panda", "position")
    goal = Pose(np.array([3.0, 0.0, 0.333]), np.eye(3))
    solver = InverseKinematics(task, seeds=3)
    found = solver.solve(goal)
    reach = np.linalg.norm(task.pose(found.q).position - goal.position)
    assert not found.reached and found.seeds == 3
    np.testing.assert_allclose(found.distance, reach)
    with pytest.raises(Unreachable, match=r"frame 'panda_hand_tcp' cannot be brought .* m and"):
        solver.reach(goal)
    assert issubclass(Unreachable, ArmError)


def sheared(by: float) -> np.ndarray:
    """Off from a rotation by exactly this much."""
    rotation = np.eye(3)
    rotation[0, 1] = by
    return rotation


@pytest.mark.parametrize(
    ("position", "rotation", "said"),
    [
        (np.zeros(3), sheared(1.001e-6), "is not a rotation: R Rᵀ is off by 1e-06, det R = 1;"),
        (np.zeros(3), np.diag([1.0, 1.0, -1.0]), "is not a rotation: .* off by 0, det R = -1"),
        (np.zeros((2, 3)), np.eye(3), r"position has shape \(2, 3\); \(3,\) is"),
        (np.zeros(3), np.zeros(4), r"pose.rotation has shape \(4,\); \(3, 3\) is expected"),
        (np.zeros(3), np.full((3, 3), np.inf), "pose.rotation is .*inf"),
    ],
)
def test_what_is_no_pose_is_refused(position: np.ndarray, rotation: np.ndarray, said: str) -> None:
    """A rotation may be off by rounding."""
    with pytest.raises(InvalidInput, match=said):
        InverseKinematics(task_of("panda")).solve(Pose(position, rotation))
    with pytest.raises(InvalidInput, match=r"^pose has shape \(3,\); a Pose or \(4, 4\) is expec"):
        InverseKinematics(task_of("panda")).solve([1, 2, 3])
    for by in (1e-6, -1e-6):
        assert checked_pose(Pose(np.zeros(3), sheared(by))).rotation[0, 1] == by


def test_bad_seeds_and_settings_are_refused() -> None:
    task = task_of("panda")
    with pytest.raises(InvalidInput, match=r"seed has shape \(3,\)"):
        InverseKinematics(task).solve(Pose(np.zeros(3), np.eye(3)), np.zeros(3))
    with pytest.raises(InvalidInput, match="positive numbers are expected"):
        InverseKinematics(task, distance=0.0)
    with pytest.raises(InvalidInput, match="'local_world_aligned' is expected"):
        InverseKinematics(TaskSpace(models.dynamics("panda"), "panda_hand", "local"))


def reference_line(task: TaskSpace, profile: str = "quintic", speed: float = 0.5):
    start = task.pose(task.model.q0)
    turn = pin.exp3(np.array([0.3, 0.2, 0.5]))
    end = Pose(start.position + [0.1, 0.35, -0.2], turn @ start.rotation)
    return timed(line(start, end), speed, 2.0, profile)


@pytest.mark.parametrize("profile", ["quintic", "trapezoid"])
def test_joint_path_follows_pose_velocity_and_acceleration(profile: str) -> None:
    task = task_of("panda")
    motion = reference_line(task, profile)
    path = joint_path(task, motion)
    for t in np.linspace(1e-3, motion.duration - 1e-3, 57):
        joints, wanted = path.sample(float(t)), motion.sample(float(t))
        pose = task.pose(joints.q)
        np.testing.assert_allclose(pose.position, wanted.position, atol=1e-12)
        np.testing.assert_allclose(pose.rotation, wanted.rotation, atol=1e-12)
        J = task.jacobian(joints.q)
        np.testing.assert_allclose(J @ joints.v, wanted.velocity, atol=1e-9)
        x_dd = J @ joints.a + task.bias(joints.q, joints.v)
        np.testing.assert_allclose(x_dd, wanted.acceleration, atol=1e-6)


def test_joint_path_derivatives_are_those_of_its_positions() -> None:
    """Null space included, which the frame does not show."""
    path = joint_path(task_of("panda"), reference_line(task_of("panda")))
    h = 1e-4
    for t in np.linspace(0.1, path.duration - 0.1, 13):
        behind, here, ahead = (path.sample(float(t + k * h)) for k in (-1, 0, 1))
        np.testing.assert_allclose((ahead.q - behind.q) / (2 * h), here.v, atol=1e-6)
        np.testing.assert_allclose((ahead.v - behind.v) / (2 * h), here.a, atol=1e-5)


def test_infeasible_requests_are_refused() -> None:
    dyn, task = models.dynamics("panda"), task_of("panda")
    path = joint_path(task, reference_line(task))
    with pytest.raises(Unreachable, match="weight and dry friction"):
        paced(path, dyn, 1.0)
    start = task.pose(dyn.model.q0)
    far = Pose(start.position + [1.5, 0.0, 0.0], start.rotation)
    with pytest.raises(Unreachable, match="of its length|of the path"):
        joint_path(task, timed(line(start, far), 0.5, 2.0))
    with pytest.raises(InvalidInput, match="are the same"):
        line(start, start)
    with pytest.raises(InvalidInput, match="beside the plane"):
        circle(start, start.position + [0.1, 0.1, 0.1], [1, 0, 0], 1.0)
    with pytest.raises(InvalidInput, match="neither may be zero"):
        circle(start, start.position + [0, 0.1, 0], [1, 0, 0], 0.0)
    with pytest.raises(InvalidInput, match="profile = 'cubic'"):
        timed(line(start, far), 1.0, 1.0, "cubic")
