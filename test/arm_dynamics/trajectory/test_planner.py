# SPDX-License-Identifier: Apache-2.0
"""Motions to Cartesian goals: straight, through poses, from motion, within limits, or refused."""

from functools import cache

import numpy as np
import pinocchio as pin
import pytest

import models
from arm_dynamics import InvalidInput, Unreachable
from arm_dynamics.task_space import Pose, TaskSpace
from arm_dynamics.trajectory import CartesianGoals, Limits, Motion, Pace, Reference
from tolerances import ALGEBRA, assert_close

FRAMES = {"panda": "panda_hand_tcp", "kinova": "j2s6s200_end_effector", "z1": "gripperMover"}
START = {"kinova": [0.2, 2.6, 1.4, 0.4, 1.2, 0.3], "z1": [0.2, 1.4, -1.2, 0.4, 0.5, 0.3]}


@cache
def task(robot: str) -> TaskSpace:
    return TaskSpace(models.dynamics(robot), FRAMES[robot])


def goals(robot: str, speed: float = 0.25, acceleration: float = 8.0) -> CartesianGoals:
    dynamics = models.dynamics(robot)
    limits = Limits.of(dynamics.model, acceleration)
    return CartesianGoals(task(robot), dynamics, Pace(speed, 1.0, limits))


def resting(robot: str) -> Reference:
    q = np.array(START.get(robot, models.dynamics(robot).model.q0), float)
    return Reference(q, np.zeros_like(q), np.zeros_like(q))


def moved(pose: Pose, step: list[float], turn: list[float] = [0.0, 0.0, 0.0]) -> Pose:  # noqa: B006
    return Pose(pose.position + step, pin.exp3(np.array(turn)) @ pose.rotation)


def table(motion: Motion, count: int = 151) -> list[Reference]:
    return [motion.sample(t) for t in np.linspace(0.0, motion.duration, count)]


def test_an_arm_that_one_joint_has_just_begun_to_move_is_braked_first() -> None:
    """No speed yet, but an acceleration: the motion goes on from it without a jump."""
    here = resting("panda")
    starting = Reference(here.q, here.v, np.eye(len(here.q))[2])
    goal = moved(task("panda").pose(here.q), [0.05, 0.0, -0.05])
    motion = goals("panda").line(starting, goal)
    assert_close(motion.sample(0.0).a, starting.a, 1e-9)


@pytest.mark.parametrize("robot_name", sorted(FRAMES))
def test_a_goal_is_reached_on_a_straight_line(robot_name: str) -> None:
    hand, here = task(robot_name), resting(robot_name)
    start = hand.pose(here.q)
    goal = moved(start, [-0.06, 0.05, -0.08], [0.1, -0.2, 0.15])
    motion = goals(robot_name).line(here, goal)
    end = hand.pose(motion.sample(motion.duration).q)
    assert_close(end.position, goal.position, 1e-9)
    assert_close(end.rotation, goal.rotation, 1e-9)
    assert_close(motion.sample(0.0).q, here.q, 1e-9)
    way = goal.position - start.position
    for at in table(motion, 51):
        off = hand.pose(at.q).position - start.position
        assert np.linalg.norm(off - way * (off @ way) / (way @ way)) < 1e-8


def test_speed_acceleration_and_joint_limits_hold() -> None:
    hand, here, planner = task("panda"), resting("panda"), goals("panda", 0.3, 5.0)
    motion = planner.line(here, moved(hand.pose(here.q), [0.1, 0.25, -0.2]))
    speeds = [np.linalg.norm((hand.jacobian(at.q) @ at.v)[:3]) for at in table(motion)]
    assert max(speeds) <= 0.3 * (1 + 1e-6)
    assert max(abs(at.a).max() for at in table(motion)) <= 5.0 * (1 + 1e-3)
    model = models.dynamics("panda").model
    assert max((abs(at.v) / model.velocity_limit).max() for at in table(motion)) <= 1.0


def test_references_are_derivatives_of_each_other() -> None:
    here = resting("panda")
    corners = [moved(task("panda").pose(here.q), step) for step in ([0, 0.1, 0], [0, 0.1, -0.1])]
    for motion in (goals("panda").line(here, corners[1]), goals("panda").through(here, corners)):
        h = 1e-5
        for t in np.linspace(0.1, 0.9, 7) * motion.duration:
            before, now, after = (motion.sample(t + s * h) for s in (-1, 0, 1))
            np.testing.assert_allclose((after.q - before.q) / (2 * h), now.v, atol=1e-6)
            np.testing.assert_allclose((after.v - before.v) / (2 * h), now.a, atol=2e-4)


def test_through_poses_without_a_stop() -> None:
    hand, here = task("panda"), resting("panda")
    start = hand.pose(here.q)
    poses = [
        moved(start, [0.0, 0.1 * np.sin(x), 0.1 * (np.cos(x) - 1)])
        for x in np.linspace(0.0, 2 * np.pi, 41)
    ]
    motion = goals("panda").through(here, poses)
    on_circle = [
        np.hypot(*(hand.pose(at.q).position - start.position)[1:] - [0.0, -0.1])
        for at in table(motion)
    ]
    assert_close(on_circle, np.full(len(on_circle), 0.1), 4e-4)  # chords: 0.31 mm inside
    inner = [np.linalg.norm(at.v) for at in table(motion)[15:-15]]
    assert min(inner) > 0.05
    assert_close(hand.pose(motion.sample(motion.duration).q).position, start.position, 1e-8)


def test_from_motion_it_stops_first_without_a_jump() -> None:
    hand, here, planner = task("panda"), resting("panda"), goals("panda")
    start = hand.pose(here.q)
    moving = planner.line(here, moved(start, [0.1, 0.2, 0.0])).sample(0.5)
    assert abs(moving.v).max() > 0.05
    goal = moved(start, [0.0, -0.1, -0.1])
    for motion in (planner.line(moving, goal), planner.through(moving, [goal])):
        first = motion.sample(0.0)
        for one, other in zip((first.q, first.v, first.a), (moving.q, moving.v, moving.a),
                              strict=True):  # fmt: skip
            assert_close(one, other, ALGEBRA)
        path = np.array([at.q for at in table(motion, 501)])
        fastest = max(abs(at.v).max() for at in table(motion))
        step = motion.duration / 500
        assert abs(np.diff(path, axis=0)).max() <= 1.01 * fastest * step
        assert_close(hand.pose(motion.sample(motion.duration).q).position, goal.position, 1e-8)


def test_where_the_frame_is_already_nothing_moves() -> None:
    here = resting("panda")
    pose = task("panda").pose(here.q)
    for motion in (goals("panda").line(here, pose), goals("panda").through(here, [pose, pose])):
        assert motion.duration == 0.0
        assert_close(motion.sample(1.0).q, here.q, ALGEBRA)


@pytest.mark.parametrize(
    ("step", "complaint"),
    [([2.0, 0.0, 0.0], "cannot be"), ([-0.65, 0.0, 0.0], "of (the path|its length)")],
)
def test_what_cannot_be_reached_is_refused(step: list[float], complaint: str) -> None:
    here = resting("panda")
    goal = moved(task("panda").pose(here.q), step)
    with pytest.raises(Unreachable, match=complaint):
        goals("panda").line(here, goal)
    with pytest.raises(Unreachable, match="of (the path|its length)"):
        goals("panda").through(here, [goal])


def test_bad_goals_are_refused() -> None:
    here, planner = resting("panda"), goals("panda")
    pose = task("panda").pose(here.q)
    with pytest.raises(InvalidInput, match="no poses"):
        planner.through(here, [])
    with pytest.raises(InvalidInput, match="is not a rotation"):
        planner.line(here, Pose(pose.position, 2.0 * pose.rotation))
    far = [moved(pose, [0.0, 0.1, 0.0]), pose] * 1100
    with pytest.raises(InvalidInput, match="the path is 220 m; allowed: 200 m"):
        planner.through(here, far)


def test_an_arm_beyond_its_limits_is_not_made_to_jump() -> None:
    here = resting("panda")
    q = here.q.copy()
    q[3] = -3.2
    goal = moved(task("panda").pose(q), [0.0, 0.02, 0.0])
    with pytest.raises(Unreachable, match="panda_joint4"):
        goals("panda").line(Reference(q, here.v, here.a), goal)
