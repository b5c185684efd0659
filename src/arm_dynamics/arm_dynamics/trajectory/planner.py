# SPDX-License-Identifier: Apache-2.0
"""Joint motions to Cartesian goals, from a reference that is brought to rest first.

A line to a pose, or a path through several: sampled straight segments, joined by a minimum-jerk
spline.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen, sealed
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import InvalidInput, Unreachable
from arm_dynamics.task_space.inverse_kinematics import InverseKinematics, checked_pose
from arm_dynamics.task_space.task_space import Pose, TaskSpace
from arm_dynamics.trajectory import joint_paths
from arm_dynamics.trajectory.cartesian import CartesianTrajectory, Line, PathPoint, line
from arm_dynamics.trajectory.joint_paths import JointPath
from arm_dynamics.trajectory.limits import Limits
from arm_dynamics.trajectory.reference import Motion, Reference
from arm_dynamics.trajectory.timing.laws import Quintic
from arm_dynamics.trajectory.trajectory import Trajectory, hold
from arm_dynamics.trajectory.waypoints import stop

# Distance in [m] that is equivalent to a rotation by 1 rad
LEVER = 0.25
MAX_KNOTS = 10_000  # of a path; inverse kinematics is solved at each
_SPACING = 0.02  # [m] between knots
_KNOT_TOLERANCE = 1e-7  # [m], [rad] at a knot
_LARGEST_STEP = 0.3  # [rad], [m] between successive knots


@frozen
class MotionSequence:
    """Two motions in sequence; the second begins where the first ends.

    Attributes:
        first: The first motion.
        second: The second motion.
    """

    first: Motion
    second: Motion

    @property
    def duration(self) -> float:
        """Total duration in [s]."""
        return self.first.duration + self.second.duration

    def sample(self, t: float) -> Reference:
        """Position, velocity and acceleration at the time ``t`` in [s]."""
        left = t - self.first.duration
        return self.first.sample(t) if left < 0.0 else self.second.sample(left)


@frozen
class Pace:
    """Speed and acceleration of a frame.

    Attributes:
        speed: Largest speed in [m/s]; a rotation is converted by the lever arm ``LEVER``.
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
        within: Callable[..., JointPath] = joint_paths.paced,
    ) -> None:
        """Set the frame and its speed.

        Args:
            task: The task, in axes ``local_world_aligned``.
            dynamics: The model, for torque limits.
            pace: Speed and acceleration.
            within: Brings motions within the limits of the joints: ``joint_paths.paced``, or
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
        rest, braking = self._stop(here)
        goal, start = checked_pose(goal), self._task.pose(rest)
        length = path_length(self._task, start, goal)
        if length < 1e-9:
            return braking or hold(rest)
        InverseKinematics(self._task).reach(goal, rest)
        timing = Quintic.within(length, self._pace.speed, self._pace.acceleration)
        straight = CartesianTrajectory(line(start, goal), timing)
        return self._after(braking, joint_paths.joint_path(self._task, straight, rest))

    def through(self, here: Reference, poses: Sequence[Pose]) -> Motion:
        """A motion through poses without stops, along straight lines with rounded corners.

        Corners are rounded within a few knots, 20 mm apart; repeated poses are ignored.

        Raises:
            Unreachable: If a pose or the path to it cannot be reached; the message states where.
            InvalidInput: If there are no poses, one is invalid, the path is too long, or a limit
                prevents the motion.
        """
        rest, braking = self._stop(here)
        if not poses:
            raise InvalidInput("no poses; at least one is expected")
        pieces, lengths, at = list[Line](), list[float](), self._task.pose(rest)
        for pose in map(checked_pose, poses):
            if (length := path_length(self._task, at, pose)) > 1e-9:
                pieces.append(line(at, pose))
                lengths.append(length)
                at = pose
        if not pieces:
            return braking or hold(rest)
        length, counts = sum(lengths), [int(np.ceil(part / _SPACING)) for part in lengths]
        if sum(counts) > MAX_KNOTS:
            raise InvalidInput(f"the path is {length:.4g} m; allowed: {MAX_KNOTS * _SPACING:g} m")
        places = [
            (piece.at(k / count), part / length / count)
            for piece, part, count in zip(pieces, lengths, counts, strict=True)
            for k in range(1, count + 1)
        ]
        us = np.concatenate([[0.0], np.cumsum([step for _, step in places])])
        us[-1] = 1.0
        q = _joints(self._task, rest, [place for place, _ in places], us)
        v, a = np.full_like(q, np.nan), np.full_like(q, np.nan)
        for i, u in ((0, 0.0), (-1, 1.0)):
            end = pieces[i].at(u)
            # On the piece alone, u is faster.
            end = replace(end, first=length / lengths[i] * end.first)
            v[i], a[i] = joint_paths.derivatives(self._task, end, q[i], u)
        timing = Quintic.within(length, self._pace.speed, self._pace.acceleration)
        return self._after(braking, JointPath(Trajectory.through(us, q, v, a), timing))

    def _stop(self, here: Reference) -> tuple[Array, Motion | None]:
        """Position at which the arm comes to rest, and the motion that brakes it; None at rest."""
        if not (here.v.any() or here.a.any()):
            joint_paths.check_limits(self._task, here.q, 0.0)
            return here.q, None
        braking = stop(here, self._pace.limits)
        return braking.ends[1], braking

    def _after(self, braking: Motion | None, path: JointPath) -> Motion:
        """The path within the limits of the joints, after the braking motion, if there is one."""
        limits = self._pace.limits
        motion = self._within(path, self._dynamics, acceleration=limits.acceleration)
        return motion if braking is None else MotionSequence(braking, motion)


def path_length(task: TaskSpace, start: Pose, end: Pose) -> float:
    """Length of a path in [m] in the task's axes, rotations converted by the lever ``LEVER``."""
    turn = float(np.linalg.norm(pin.log3(end.rotation @ start.rotation.T)))
    step = float(np.linalg.norm(end.position - start.position))
    return max(step if task.linear else 0.0, LEVER * turn if task.linear < task.m else 0.0)


def _joints(task: TaskSpace, q: Array, places: list[PathPoint], us: Array) -> Array:
    """Joint positions at every knot, each computed from the previous one, shape (k, n)."""
    solver, rows = InverseKinematics(task), [q]
    for place, u in zip(places, us[1:], strict=True):
        rows.append(solver.correct(place, rows[-1]))
        distance, angle = solver.pose_error(place, rows[-1])
        step = float(abs(rows[-1] - rows[-2]).max())
        if not (max(distance, angle) < _KNOT_TOLERANCE and step < _LARGEST_STEP):
            raise Unreachable(
                f"frame '{task.frame}' cannot follow the path after {u:.1%} of its length: "
                f"{distance:.3g} m and {angle:.3g} rad remain, or a joint would jump by "
                f"{step:.3g}",
                distance + LEVER * angle,
            )
        joint_paths.check_limits(task, rows[-1], u)
    return np.array(rows)
