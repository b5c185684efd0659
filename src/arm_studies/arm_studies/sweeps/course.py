# SPDX-License-Identifier: Apache-2.0
"""The course of a run: its state at the start, and the motion that its controller tracks."""

from collections.abc import Mapping

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput, choices
from arm_dynamics.trajectory import JointTrajectory, Limits, Trajectory, Waypoint, hold, quintic
from arm_sim.simulation.simulator import Simulator
from arm_studies.sweeps.study import MotionChoice


def start(simulator: Simulator, values: Mapping[str, float]) -> Array:
    """The state at the start of a run with varied values of ``initial`` by key, shape (nx,).

    Raises:
        ArmError: If a joint is unknown, or the arm cannot start there.
    """
    names, q, v = simulator.joint_names, simulator.model.q0.copy(), simulator.model.v0.copy()
    for key, value in values.items():
        _, quantity, joint = key.split(".", 2)
        if joint not in names:
            raise InvalidInput(f"'{key}': allowed joints: {choices(joint, names)}")
        {"position": q, "velocity": v}[quantity][names.index(joint)] = value
    simulator.reset(*((q, v) if values else ()))
    return simulator.arm.x.copy()


def motion(choice: MotionChoice, names: tuple[str, ...], q0: Array, limits: Limits) -> Trajectory:
    """The motion of joints from positions ``q0``, within limits.

    Raises:
        InvalidInput: If a joint is unknown, or the motion has efforts.
    """
    waypoints, q = [Waypoint(0.0, q0)], q0.copy()
    if choice.file is not None:
        trajectory = JointTrajectory.load(choice.file).motion(names)
        if trajectory.torques is not None:
            raise InvalidInput("'motion.file' has efforts; allowed: motions without effort")
        return trajectory
    for i, point in enumerate(choice.points):
        for joint, value in point.position.items():
            if joint not in names:
                raise InvalidInput(
                    f"'motion.points.{i}.position.{joint}': unknown joint '{joint}'; allowed: "
                    f"{choices(joint, names)}"
                )
            q[names.index(joint)] = value
        waypoints.append(Waypoint(point.time, q.copy()))
    return quintic(waypoints, limits) if choice.points else hold(q0)


def references(trajectory: Trajectory, times: Array) -> Array:
    """Positions, velocities and accelerations side by side, shape (k, 3n)."""
    samples = map(trajectory.sample, times.tolist())
    return np.array([np.concatenate((r.q, r.v, r.a)) for r in samples])
