# SPDX-License-Identifier: Apache-2.0
"""Joint motions to Cartesian goals: a line to a pose, or a path, from a moving reference.

A moving reference is brought to rest first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen, sealed
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.task_space.inverse_kinematics import InverseKinematics, checked_pose
from arm_dynamics.task_space.task_space import Pose, TaskSpace
from arm_dynamics.trajectory.cartesian import CartesianTrajectory, line
from arm_dynamics.trajectory.joint_paths import JointPath, check_limits, joint_path, paced
from arm_dynamics.trajectory.pose_path import through, way
from arm_dynamics.trajectory.reference import InTurn, Limits, Motion, Reference, hold
from arm_dynamics.trajectory.timing import Quintic
from arm_dynamics.trajectory.waypoints import stop


@frozen
class Pace:
    """Speed and acceleration of a frame.

    Attributes:
        speed: Largest speed in [m/s]; a rotation is converted by the lever arm ``pose_path.ARM``.
        acceleration: Largest acceleration along the path in [m/s²], likewise.
        limits: Limits of the joints.
    """

    speed: float
    acceleration: float
    limits: Limits


@sealed
class CartesianGoals:
    """Plans motions of a task's frame; keep one instance per thread."""

    def __init__(
        self,
        task: TaskSpace,
        dynamics: Dynamics,
        pace: Pace,
        within: Callable[..., JointPath] = paced,
    ) -> None:
        """Set the frame and its speed.

        Args:
            task: The task, in axes ``local_world_aligned``.
            dynamics: The model, for torque limits.
            pace: Speed and acceleration.
            within: Brings motions within the limits of the joints: ``joint_path.paced``, or
                ``time_optimal.retimed``, which makes them as fast as these allow, regardless of
                the speed and acceleration of the frame.
        """
        self._task, self._dynamics, self._pace, self._within = task, dynamics, pace, within

    def line(self, here: Reference, goal: Pose) -> Motion:
        """A straight line to a pose with uniform rotation.

        Raises:
            Unreachable: If the goal cannot be reached, or not on a straight line from here.
            InvalidInput: If the goal is not a pose, or a limit prevents the motion.
        """
        rest, begin = self._at_rest(here)
        goal, start = checked_pose(goal), self._task.pose(rest)
        length = way(self._task, start, goal)
        if length < 1e-9:
            return begin or hold(rest)
        InverseKinematics(self._task).reach(goal, rest)
        timing = Quintic.within(length, self._pace.speed, self._pace.acceleration)
        straight = CartesianTrajectory(line(start, goal), timing)
        return self._after(begin, joint_path(self._task, straight, rest))

    def through(self, here: Reference, poses: Sequence[Pose]) -> Motion:
        """A motion through poses without stops, along straight lines with rounded corners.

        Raises:
            Unreachable: If a pose or the path to it cannot be reached.
            InvalidInput: If there are no poses, one is invalid, or a limit prevents the motion.
        """
        rest, begin = self._at_rest(here)
        found = through(self._task, rest, [checked_pose(pose) for pose in poses])
        if found is None:
            return begin or hold(rest)
        over, length = found
        timing = Quintic.within(length, self._pace.speed, self._pace.acceleration)
        return self._after(begin, JointPath(over, timing))

    def _at_rest(self, here: Reference) -> tuple[Array, Motion | None]:
        if not (here.v.any() or here.a.any()):
            check_limits(self._task, here.q, 0.0)
            return here.q, None
        braking = stop(here, self._pace.limits)
        return braking.ends[1], braking

    def _after(self, begin: Motion | None, path: JointPath) -> Motion:
        limits = self._pace.limits
        motion = self._within(path, self._dynamics, acceleration=limits.acceleration)
        return motion if begin is None else InTurn(begin, motion)
