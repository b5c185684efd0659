# SPDX-License-Identifier: Apache-2.0
"""Content of a recording, in memory and in files."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array, read_only
from arm_sim.imperfections import Measured
from arm_sim.recording.origin import Origin

FREE, BRAKES, SERVOS = range(3)  # as in arm_msgs/Tick


@dataclass(frozen=True)
class Event:
    """An event during a recording.

    Attributes:
        time: Its time in the recording in [s].
        text: Its description.
    """

    time: float
    text: str


@dataclass(frozen=True)
class Jump:
    """A change between two ticks.

    Attributes:
        row: Row of the recording with the time of the change and the state after it.
        x: State before, shape (nx,).
        p: Tunable quantities before, shape (np,).
        tunable: Names of those that were tunable before.
        substep: Next trial sub-step of the error control in [s]; see ``SimulatedArm.substep``.
    """

    row: int
    x: Array
    p: Array
    tunable: tuple[str, ...] = ()
    substep: float = 0.0


@dataclass(frozen=True, repr=False)
class Contents:
    """States at the start of a run and after each of its k ticks; arrays are read-only.

    Attributes:
        time: Time in [s], shape (k+1,); continues across resets of the simulation.
        q: Joint positions in [rad] or [m], shape (k+1, n).
        v: Joint velocities in [rad/s] or [m/s], shape (k+1, n); NaN where a robot reported none.
        z: Internal states of drives and friction, shape (k+1, nz).
        command: Effective command from each time, limits applied, shape (k+1, n): torques in
            [N m] or [N], or the command of a joint's drive; the last row repeats the last tick's.
            Of a robot, its measured effort, NaN where it reported none.
        local_error: Sum of the estimated errors of q in all sub-steps up to each time in [rad] or
            [m], shape (k+1,); zeros without error control.
        time_stepped: Number of time-stepped ticks up to each time; see ``State``, shape (k+1,).
        joint_names: Order of the joints in each row.
        p: Tunable quantities from each time, shape (k+1, np).
        origin: Scene, method and versions; None if unknown.
        held: Names of the active constraints.
        jumps: Changes between two ticks.
        events: Events during the recording.
        hold: What held the arm in the tick that begins at each time, shape (k+1,): ``FREE``,
            ``BRAKES`` or ``SERVOS``; None if nothing ever did.
        gaps: Rows before which ticks are missing, because the recorder was too slow or the file
            is damaged; of a robot, more than three joint states.
        substep: Initial sub-step of the error control, in [s]; see ``SimulatedArm.substep``.
        measured: Sensor measurements at each time, NaN where its file has none; None if the scene
            has no sensors.
        of_robot: Whether it is of a robot or another simulator, not of our own ticks.
        left: What its file contains besides, such as topics, and ``save`` does not write.
    """

    time: Array
    q: Array
    v: Array
    z: Array
    command: Array
    local_error: Array
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
    left: tuple[str, ...] = ()

    @property
    def x(self) -> Array:
        """States at each time, shape (k+1, nx): positions, velocities and internal states."""
        return read_only(np.hstack([self.q, self.v, self.z]))

    @property
    def ended(self) -> Array:
        """States at the end of each tick, before changes between ticks, shape (k+1, nx)."""
        x = self.x.copy()
        for jump in self.first_jumps:
            x[jump.row] = jump.x
        return read_only(x)

    @property
    def moved(self) -> NDArray[np.bool_]:
        """Whether the arm made the tick from each time but the last by itself, shape (k,).

        Not where brakes held it, nor across gaps, where its motion is unknown.
        """
        moved = np.ones(max(len(self.time) - 1, 0), bool)
        moved[[row - 1 for row in self.gaps]] = False
        if self.hold is not None:
            moved &= self.hold[:-1] != BRAKES
        return moved

    @property
    def edges(self) -> list[int]:
        """Rows at which a change, a tuning, a hold or a gap begins, the first and the last row."""
        last = len(self.time) - 1
        tuned = np.flatnonzero(np.any(self.p[1:] != self.p[:-1], axis=1)) + 1
        begun = [] if self.hold is None else (np.flatnonzero(np.diff(self.hold)) + 1).tolist()
        jumps = (jump.row for jump in self.jumps)
        before = (row - 1 for row in self.gaps)
        return sorted({0, last, *jumps, *self.gaps, *before, *tuned.tolist(), *begun})

    @property
    def first_jumps(self) -> tuple[Jump, ...]:
        """The first change at each time, which knows what was there before all of them."""
        return tuple({jump.row: jump for jump in reversed(self.jumps)}.values())

    def __len__(self) -> int:
        """Number of recorded states."""
        return len(self.time)
