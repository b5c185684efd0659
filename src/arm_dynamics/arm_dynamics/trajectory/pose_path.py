# SPDX-License-Identifier: Apache-2.0
"""Joint motion through poses: sampled straight segments, joined by a minimum-jerk spline."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput, Unreachable
from arm_dynamics.task_space.inverse_kinematics import InverseKinematics
from arm_dynamics.task_space.task_space import Pose, TaskSpace
from arm_dynamics.trajectory.cartesian import Line, Place, line
from arm_dynamics.trajectory.joint_paths import check_limits, derivatives
from arm_dynamics.trajectory.reference import Trajectory

ARM = 0.25
"""Distance in [m] that is equivalent to a rotation by 1 rad."""

MAX_KNOTS = 10_000
_SPACING = 0.02  # [m] between knots
_NEAR = 1e-7  # [m], [rad] at a knot
_FAR = 0.3  # [rad], [m] between successive knots


def way(task: TaskSpace, start: Pose, end: Pose) -> float:
    """Length of a path in [m] in the task's axes, rotations converted by the lever ``ARM``."""
    turn = float(np.linalg.norm(pin.log3(end.rotation @ start.rotation.T)))
    step = float(np.linalg.norm(end.position - start.position))
    return max(step if task.linear else 0.0, ARM * turn if task.linear < task.m else 0.0)


def through(task: TaskSpace, q: Array, poses: Sequence[Pose]) -> tuple[Trajectory, float] | None:
    """Move a frame through poses, from its current pose.

    Corners are rounded within a few knots, 20 mm apart.

    Args:
        task: The task, in axes ``local_world_aligned``.
        q: Current joint positions, shape (n,).
        poses: Poses to pass in sequence; repeated ones are ignored.

    Returns:
        Joint positions over the fraction u of the path ("times" from 0 to 1), and its length in
        [m]; None if the frame is at its end already.

    Raises:
        Unreachable: If the path cannot be followed; the message states where.
        InvalidInput: If there are no poses, or the path is too long.
    """
    if not poses:
        raise InvalidInput("no poses; at least one is expected")
    pieces, ways, at = list[Line](), list[float](), task.pose(q)
    for pose in poses:
        if (ahead := way(task, at, pose)) > 1e-9:
            pieces.append(line(at, pose))
            ways.append(ahead)
            at = pose
    if not pieces:
        return None
    length, counts = sum(ways), [int(np.ceil(w / _SPACING)) for w in ways]
    if sum(counts) > MAX_KNOTS:
        raise InvalidInput(f"the path is {length:.4g} m; allowed: {MAX_KNOTS * _SPACING:g} m")
    places = [
        (piece.at(k / count), w / length / count)
        for piece, w, count in zip(pieces, ways, counts, strict=True)
        for k in range(1, count + 1)
    ]
    us = np.concatenate([[0.0], np.cumsum([step for _, step in places])])
    us[-1] = 1.0
    joints = _joints(task, q, [place for place, _ in places], us)
    v, a = np.full_like(joints, np.nan), np.full_like(joints, np.nan)
    for i, u in ((0, 0.0), (-1, 1.0)):
        end = pieces[i].at(u)
        end = replace(end, first=length / ways[i] * end.first)  # u is that of the segment alone
        v[i], a[i] = derivatives(task, end, joints[i], u)
    return Trajectory.through(us, joints, v, a), length


def _joints(task: TaskSpace, q: Array, places: list[Place], us: Array) -> Array:
    """Joint positions at every knot, each computed from the previous one, shape (k, n)."""
    solver, rows = InverseKinematics(task), [q]
    for place, u in zip(places, us[1:], strict=True):
        rows.append(solver.correct(place, rows[-1]))
        distance, angle = solver.missing(place, rows[-1])
        leap = float(abs(rows[-1] - rows[-2]).max())
        if not (max(distance, angle) < _NEAR and leap < _FAR):
            raise Unreachable(
                f"frame '{task.frame}' cannot follow the path after {u:.1%} of its length: "
                f"{distance:.3g} m and {angle:.3g} rad remain, or a joint would jump by "
                f"{leap:.3g}",
                distance + ARM * angle,
            )
        check_limits(task, rows[-1], u)
    return np.array(rows)
