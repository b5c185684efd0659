# SPDX-License-Identifier: Apache-2.0
"""What a recording is made of, in memory and in files."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_sim.imperfections import Measured
from arm_sim.recording.changes import Jump
from arm_sim.recording.origin import Origin

FREE, BRAKES, SERVOS = range(3)  # as in arm_msgs/Tick


@dataclass(frozen=True)
class Event:
    """Something that was noted while a system ran.

    Attributes:
        time: When, in [s] of the recording.
        text: What.
    """

    time: float
    text: str


@dataclass(frozen=True, repr=False)
class Contents:
    """States at the beginning of a run and after each of its k ticks; arrays are read-only.

    Attributes:
        time: In [s], shape (k+1,). Where a simulation was reset in between, it goes on.
        q: Joint positions in [rad] or [m], shape (k+1, n).
        v: Joint velocities in [rad/s] or [m/s], shape (k+1, n); NaN where a robot told none.
        z: States of the scene's laws, shape (k+1, nz).
        command: What acted from each time on, limits applied, shape (k+1, n): torques in [N m] or
            [N], or what a joint's drive takes; the last row repeats the last tick's. Of a robot,
            the effort that it measured, NaN where it told none.
        error: Estimated error of q in [rad] or [m], shape (k+1,); zeros without error control.
        time_stepped: By each time, ticks in which events piled up; see ``State``, shape (k+1,).
        joint_names: Order of the joints in each row.
        p: Tunable quantities from each time on, shape (k+1, np).
        origin: Scene, method and versions; None for what is not known to have one.
        held: Names of the constraints that held.
        jumps: What was changed between two ticks.
        events: What was noted meanwhile.
        hold: What held the arm in the tick that begins at each time, shape (k+1,): ``FREE``,
            ``BRAKES`` or ``SERVOS``; None if nothing ever did.
        gaps: Rows before which ticks are missing: a recorder that could not follow, or a file
            that is damaged.
        substep: Sub-step with which error control began, in [s]; see ``Simulator.substep``.
        measured: What the scene's sensors told at each time; None if it has none.
        of_robot: Whether it is of a robot, or of another simulator, and not of ticks of ours.
    """

    time: Array
    q: Array
    v: Array
    z: Array
    command: Array
    error: Array
    time_stepped: Array
    joint_names: tuple[str, ...]
    p: Array
    origin: Origin | None = None
    held: tuple[str, ...] = ()
    jumps: tuple[Jump, ...] = ()
    events: tuple[Event, ...] = ()
    hold: NDArray[np.uint8] | None = None
    gaps: tuple[int, ...] = ()
    substep: float = 0.0
    measured: Measured | None = None
    of_robot: bool = False

    def fields(self) -> dict[str, Any]:
        """Every attribute by its name."""
        return {item.name: getattr(self, item.name) for item in fields(Contents)}
