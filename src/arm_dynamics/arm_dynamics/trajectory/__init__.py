# SPDX-License-Identifier: Apache-2.0
"""Motions of joints and frames over time, within the limits of an arm.

Depends on the dynamics, for torque limits, and on inverse kinematics, and on no controller.
Names are imported when they are first used.
"""

from typing import TYPE_CHECKING

from arm_dynamics.lazy import on_demand

if TYPE_CHECKING:
    from arm_dynamics.trajectory.cartesian import CartesianTrajectory, circle, line, timed
    from arm_dynamics.trajectory.excess import Bounds
    from arm_dynamics.trajectory.files import JointTrajectory
    from arm_dynamics.trajectory.follower import Follower
    from arm_dynamics.trajectory.joint_paths import JointPath, joint_path, paced
    from arm_dynamics.trajectory.limits import Limits
    from arm_dynamics.trajectory.planner import CartesianGoals, Pace
    from arm_dynamics.trajectory.reference import Motion, Reference, TaskReference, Waypoint
    from arm_dynamics.trajectory.splines import spline, stretched_spline
    from arm_dynamics.trajectory.time_optimal import retimed
    from arm_dynamics.trajectory.timing.laws import Quintic, Timing, Trapezoid
    from arm_dynamics.trajectory.trajectory import Trajectory, hold
    from arm_dynamics.trajectory.waypoints import quintic, quintic_through, stop

__all__ = [
    "Bounds", "CartesianGoals", "CartesianTrajectory", "Follower", "JointPath",
    "JointTrajectory", "Limits", "Motion", "Pace", "Quintic", "Reference", "TaskReference",
    "Timing", "Trajectory", "Trapezoid", "Waypoint",
    "circle", "hold", "joint_path", "line", "paced", "quintic", "quintic_through", "retimed",
    "spline", "stop", "stretched_spline", "timed",
]  # fmt: skip
__getattr__, __dir__ = on_demand(__name__, __file__)
