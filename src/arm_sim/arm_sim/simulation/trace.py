# SPDX-License-Identifier: Apache-2.0
"""What a run of a simulator records, tick by tick."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array, read_only
from arm_sim.imperfections import Measured
from arm_sim.memory import refuse_beyond_memory
from arm_sim.plant.plant import Plant
from arm_sim.progress import Progress
from arm_sim.recording.contents import FREE, Jump
from arm_sim.recording.recording import Recording
from arm_sim.recording.second_run import Control
from arm_sim.simulation.simulated_arm import SimulatedArm
from arm_sim.state import read_only_view
from arm_sim.stepping.slices import slices
from arm_sim.stepping.stepper import Stepper


class Trace:
    """Rows of a run, from the current state on.

    Args:
        arm: The arm at the start of the run.
        ticks: Number k of ticks.
        progress: Reports how far the run is.
        offset: Ticks of the run before.

    Attributes:
        arm: The arm, as it is now.
        ticks: Number of ticks.
        offset: Ticks of the run before.
        done: Number of ticks that were made.
        time: Time at the start and after each tick in [s], shape (k+1,).

    Raises:
        InvalidInput: If they take too much of the memory.
    """

    def __init__(self, arm: SimulatedArm, ticks: int, progress: Progress, offset: int = 0) -> None:
        row = 3 + arm.plant.nx + arm.n + len(arm.parameters) + 3 * arm.n * bool(arm.sensors)
        refuse_beyond_memory(ticks, 8 * row)
        self.arm, self.ticks, self.offset, self.done = arm, ticks, offset, 0
        self._progress = progress
        steps = arm.step_count + np.arange(ticks + 1)
        self.time = np.asarray(steps * arm.dt, dtype=np.float64)
        self._x, self._command = np.empty((ticks + 1, arm.plant.nx)), np.empty((ticks + 1, arm.n))
        self._notes = np.empty((ticks + 1, 2))
        self._x[0], self._notes[0] = arm.x, arm.notes
        self._changes, self._substep = _Changes(arm), arm.substep
        self._measured: Array | None = None
        if arm.sensors is not None:
            self._measured = np.empty((ticks + 1, 3 * arm.n))
            self._measured[0] = arm.sensors.measured

    def slices(self, few: int) -> Iterator[tuple[int, int]]:
        """Slices of the ticks, the first of ``few``; progress is reported after each."""
        for first, end in slices(self.ticks, few):
            yield first, end
            self._progress.update((self.offset + end) * self.arm.dt)

    def roll(self, stepper: Stepper, commands: Callable[[int, int], Array]) -> None:
        """Make the ticks in compiled code, or fewer, if one cannot be computed.

        Args:
            stepper: What makes them.
            commands: Commands of the ticks from one row to another, shape (k, n), or one for all.
        """
        self._substep, arm = stepper.substep, self.arm
        for first, end in self.slices(stepper.ticks_per_slice):
            trace, acted = self._x[first + 1 : end + 1], self._command[first:end]
            notes, before = self._notes[first + 1 : end + 1], arm.step_count
            try:
                arm.roll(stepper, commands(first, end), trace, acted, notes)
            finally:  # a signal may break it off
                ticks = arm.step_count - before
                self._measure(first, trace[:ticks], acted[:ticks])
                self.done = first + ticks
            if self.done < end:
                return

    def _measure(self, row: int, trace: Array, command: Array) -> None:
        """Update the sensors with ticks that were executed in one call, from a row on."""
        arm = self.arm
        if arm.sensors is None or self._measured is None:
            return
        n, step = arm.n, arm.step_count - len(trace) + 1
        effort = arm.plant.joint_torque(trace, command)
        for k, x in enumerate(trace):
            arm.sensors.sample(step + k, x[:n], x[n : 2 * n], effort[k])
            self._measured[row + k + 1] = arm.sensors.measured

    def begin(self, row: int) -> None:
        """Register what a controller changed before the tick from a row."""
        self._changes.detect(row, self._x)

    def end(self, row: int) -> None:
        """Record the tick from a row, which the arm has executed."""
        arm = self.arm
        self._x[row + 1], self._command[row], self._notes[row + 1] = arm.x, arm.acted, arm.notes
        self._changes.state, self.done = arm.state, row + 1
        if arm.hold != FREE:
            self._changes.record_hold(row, arm.hold)
        if arm.sensors is not None and self._measured is not None:
            self._measured[row + 1] = arm.sensors.measured

    def recording(self, open_loop: bool, control: Control | None = None) -> Recording:
        """The motion over the ticks that were made.

        Args:
            open_loop: Whether their commands were given in advance.
            control: The controller, if it can be evaluated again.
        """
        arm, changes, command, done = self.arm, self._changes, self._command, self.done
        command[done] = command[done - 1] if done else 0.0
        rows = [self.time, self._x, command, self._notes]
        time, x, command, notes = (read_only_view(array[: done + 1]) for array in rows)
        n, measured = arm.n, self._measured
        origin = replace(arm.origin, open_loop=open_loop)
        return Recording(
            time=time, q=x[:, :n], v=x[:, n : 2 * n], z=x[:, 2 * n :], command=command,
            local_error=notes[:, 0], time_stepped=notes[:, 1], joint_names=arm.joint_names,
            p=changes.parameters(done + 1), origin=origin, held=arm.held_constraints,
            jumps=changes.jumps(), hold=changes.holds(done + 1), substep=self._substep,
            physics=arm.compiled,
            measured=None if measured is None else Measured.of(measured[: done + 1]),
            control=control,
        )  # fmt: skip


class _Changes:
    """Records changes that a controller makes in its simulation.

    Attributes:
        state: The state after the last tick, which need not be compared if it is still current.
    """

    def __init__(self, arm: SimulatedArm) -> None:
        self._arm = arm
        self._rows, self._states, self._substeps = [0], list[Array](), list[float]()
        self._holds = dict[int, int]()
        self._tuned, self._last = [self._present()], self._token()
        self.state = arm.state

    def detect(self, row: int, x: Array) -> None:
        """Compare with the last call; a changed state replaces its row of ``x``."""
        arm = self._arm
        token, x_now = self._token(), arm.x
        unchanged = arm.state is self.state or x_now.tobytes() == x[row].tobytes()
        if unchanged and token == self._last:
            return
        self._rows.append(row)
        self._tuned.append(self._present())
        self._states.append(x[row].copy())
        self._substeps.append(self._arm.substep)
        self._last, x[row] = token, x_now

    def record_hold(self, row: int, hold: int) -> None:
        """Record what held the arm (servos or brakes) in the tick that begins at a row."""
        self._holds[row] = hold

    def holds(self, rows: int) -> NDArray[np.uint8] | None:
        """What held the arm in the tick from each time, shape (rows,); None if nothing did."""
        if not self._holds:
            return None
        hold = np.zeros(rows, np.uint8)
        hold[list(self._holds)] = list(self._holds.values())
        return hold

    def parameters(self, rows: int) -> Array:
        """Tunable quantities from each time, shape (rows, np)."""
        counts = np.maximum(np.diff([*self._rows, rows]), 0)
        return read_only(np.repeat([self._merged(tuned) for tuned in self._tuned], counts, axis=0))

    def jumps(self) -> tuple[Jump, ...]:
        """The changes in chronological order."""
        before = zip(self._rows[1:], self._states, self._tuned, self._substeps, strict=False)
        return tuple(
            Jump(row, read_only(x), self._merged(tuned), tuple(tuned), substep)
            for row, x, tuned, substep in before
        )

    def _token(self) -> tuple[Plant, bytes]:
        """A key that differs if a tunable quantity does."""
        compiled = self._arm.compiled
        return compiled.plant, compiled.stepper.p.tobytes()

    def _present(self) -> dict[str, bytes]:
        """Current values by name, since a run may make more of them tunable."""
        parameters, p = self._arm.plant.parameters, self._arm.parameters
        return {name: parameters.of(name, p).tobytes() for name in parameters.names}

    def _merged(self, tuned: dict[str, bytes]) -> Array:
        parameters = self._arm.plant.parameters
        p = parameters.nominal
        for name, values in tuned.items():
            p[parameters.place(name)] = np.frombuffer(values)
        return p
