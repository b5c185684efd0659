# SPDX-License-Identifier: Apache-2.0
"""A recording as a table: columns by name."""

from __future__ import annotations

from arm_dynamics.arrays import Array
from arm_sim.recording.motion import RecordedMotion

UNITS = {"position": ("rad", "m"), "velocity": ("rad/s", "m/s"), "effort": ("N m", "N")}
"""Units of revolute and of prismatic joints."""


def parts(recording: RecordedMotion) -> dict[str, Array]:
    """Position, velocity, effort, and the command if it is not an effort, shapes (k+1, n)."""
    found = {"position": recording.q, "velocity": recording.v, "effort": recording.tau}
    if not recording.of_robot and recording.plant.torques is not None:
        found["command"] = recording.command
    return found


def columns(recording: RecordedMotion) -> dict[str, Array]:
    """See ``Recording.to_dict``."""
    found = {"time": recording.time}
    for part, array in parts(recording).items():
        found |= {f"{part}.{name}": array[:, i] for i, name in enumerate(recording.joint_names)}
    laws = recording.plant.laws.names if recording.z.shape[1] else ()
    return found | {f"state.{name}": recording.z[:, i] for i, name in enumerate(laws)}
