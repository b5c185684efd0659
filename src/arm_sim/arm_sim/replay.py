# SPDX-License-Identifier: Apache-2.0
"""Replay of a recorded run, and comparison with the recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arm_dynamics import InvalidInput, Scene, load_scene
from arm_dynamics.arrays import Array, read_only
from arm_sim.exceptions import SimulationDiverged
from arm_sim.plant.parameters import Parameters
from arm_sim.recording.contents import BRAKES, FREE, Jump
from arm_sim.recording.files.ticks import EXTERNAL, tunable_names
from arm_sim.recording.origin import versions
from arm_sim.recording.physics import Physics
from arm_sim.recording.recording import Recording
from arm_sim.simulation.runtime_changes import external_change
from arm_sim.simulation.simulator import Simulator

_PARTS = ("position", "velocity")


@dataclass(frozen=True)
class Difference:
    """The first value that differs.

    Attributes:
        tick: Its tick, counted from the beginning of the recording.
        time: Time at the end of the tick in [s].
        what: The joint and quantity, or the internal state.
        recorded: The recorded value.
        replayed: The replayed value.
    """

    tick: int
    time: float
    what: str
    recorded: float
    replayed: float

    @property
    def size(self) -> float:
        """Absolute difference."""
        return abs(self.recorded - self.replayed)

    def __str__(self) -> str:
        """One line."""
        return (
            f"tick {self.tick} (t = {self.time:.6g} s), {self.what}: recorded {self.recorded!r}, "
            f"replayed {self.replayed!r}, off by {self.size:.3g}"
        )


@dataclass(frozen=True)
class Replay:
    """Result of a replay.

    Attributes:
        recording: The replayed motion.
        first: The first difference; None if every state is bit-identical.
        apart: Largest difference of joint positions at each time in [rad] or [m], shape (k+1,);
            NaN after the replay failed.
        other_versions: Libraries whose version here differs from the recording's, by name.
        failure: Why the replay failed; empty if it did not.
    """

    recording: Recording
    first: Difference | None
    apart: Array
    other_versions: tuple[str, ...]
    failure: str = ""

    @property
    def equal(self) -> bool:
        """Whether every state is bit-identical."""
        return self.first is None and not self.failure


def replay(
    recording: Recording,
    scene: Any = None,
    integrator: str | None = None,
    tolerance: float | None = None,
) -> Replay:
    """Run the scene of a recording again with its commands, changes and external forces.

    Args:
        recording: The recording to repeat.
        scene: Another scene with the same joints; None for the recorded one.
        integrator: Another method, or None.
        tolerance: Another tolerance, or None.

    Returns:
        The motion, and its differences from the recording.

    Raises:
        InvalidInput: If the recording cannot be replayed: it is of a robot, or the other scene has
            other joints or another length of ticks.
    """
    if recording.origin is None or recording.of_robot:
        raise InvalidInput(
            "the recording is of a robot, not of ticks of a simulation; --topics plays it"
        )
    return _Run(recording, scene, integrator, tolerance).made()


class _Run:
    """One replay."""

    def __init__(
        self, recording: Recording, scene: Any, integrator: str | None, tolerance: float | None
    ) -> None:
        origin = recording.origin
        assert origin is not None
        self._recording, self._same = recording, scene is None
        base = origin.scene if scene is None else load_scene(scene)
        if scene is None and recording.jumps:
            base = _with_tunable(base, recording.jumps[0].tunable)
        if integrator is None and tolerance is None:
            integrator, tolerance = origin.integrator, origin.tolerance
        # Imperfections between arm and controller have affected the commands already.
        plain = base.model_copy(update={"sensors": None, "commands": None})
        self._sim = sim = Simulator(plain, integrator, origin.dt, tolerance)
        if sim.joint_names != recording.joint_names:
            raise InvalidInput(
                f"the scene has joints {', '.join(sim.joint_names)}; the recording has "
                f"{', '.join(recording.joint_names)}"
            )
        self._x, self._ended = recording.x, recording.ended
        self._jumps = {jump.row: i for i, jump in enumerate(recording.jumps)}
        self._there = Parameters(recording.plant.model)
        self._tuned = self._quantities()
        rows, nx = len(recording), sim.arm.plant.nx
        self._out, self._out_ended = np.full((rows, nx), np.nan), np.full((rows, nx), np.nan)

    def _quantities(self) -> list[str]:
        """Names of the tunable quantities that come from the recording."""
        found, p = [], self._recording.p
        for name in self._there.names:
            column = p[:, self._there.place(name)]
            if not (self._same or name == EXTERNAL or np.any(column != column[0])):
                continue  # the other scene has its own
            if name != EXTERNAL and name not in self._sim.arm.plant.parameters.names:
                raise InvalidInput(
                    f"'{name}' was changed in the recording and is not tunable in the scene"
                )
            found.append(name)
        return found

    def made(self) -> Replay:
        """Run the replay."""
        edges, failure = self._recording.edges, ""
        for row, end in zip(edges, [*edges[1:], None], strict=True):
            self._begin(row)
            if end is None or end in self._recording.gaps:
                continue  # there is no tick across a gap
            try:
                self._advance(row, end)
            except SimulationDiverged as error:
                failure = str(error)
                break
        return self._compared(failure)

    def _begin(self, row: int) -> None:
        """Apply changes at a time other than by ticks."""
        recording, sim = self._recording, self._sim
        jump = recording.jumps[self._jumps[row]] if row in self._jumps else None
        if EXTERNAL in self._tunable_at(row) and EXTERNAL not in sim.arm.plant.parameters.names:
            external_change(sim)()
        moved = self._ended[row].tobytes() != self._x[row].tobytes()
        if row == 0 or row in recording.gaps or moved:
            self._place(self._x[row], row, recording.substep if jump is None else jump.substep)
        elif jump is not None or np.any(recording.p[row] != recording.p[row - 1]):
            self._place(sim.arm.x, row, sim.arm.substep)
        self._out[row] = sim.arm.x

    def _tunable_at(self, row: int) -> tuple[str, ...]:
        """Names of the quantities that were tunable from a time on."""
        later = [jump.tunable for jump in self._recording.jumps if jump.row > row]
        return later[0] if later else tunable_names(self._recording.plant.model.scene)

    def _place(self, x: Array, row: int, substep: float) -> None:
        """Set the state, with the quantities tuned at a time."""
        sim, here = self._sim, self._sim.arm.plant.parameters
        values = {name: self._there.of(name, self._recording.p[row]) for name in self._tuned}
        values = {name: value for name, value in values.items() if name in here.names}
        if len(x) != sim.arm.plant.nx:  # another scene, with other internal states
            q, v = x[: sim.n], x[sim.n : 2 * sim.n]
            x = np.concatenate([q, v, sim.arm.plant.laws.initial(q, v)])
        step = round(self._recording.time[row] / sim.dt)
        sim.arm.restore(x.copy(), here.merged(values, here.nominal), step, substep)

    def _advance(self, row: int, end: int) -> None:
        """Run the ticks between two edges."""
        recording, sim = self._recording, self._sim
        hold = FREE if recording.hold is None else recording.hold[row]
        for k in range(row, end) if hold != FREE else ():
            self._hold(k, hold)
        if hold != FREE:
            return
        try:
            made = sim.run((end - row) * sim.dt, recording.command[row:end])
        except SimulationDiverged as error:
            self._keep(row, error.recording)
            raise
        self._keep(row, made)

    def _keep(self, row: int, made: Recording) -> None:
        x = made.x[1:]
        self._out[row + 1 : row + 1 + len(x)] = self._out_ended[row + 1 : row + 1 + len(x)] = x

    def _hold(self, row: int, how: int) -> None:
        """Run a tick in which the arm was held."""
        sim, n = self._sim, self._sim.n
        if how == BRAKES:  # nothing is computed there: the state is the recorded one
            self._place(self._ended[row + 1], row, sim.arm.substep)
        else:
            place = sim.arm.x[:n].copy()
            sim.arm.advance(self._recording.command[row].tolist())
            still = np.concatenate([place, np.zeros(n), sim.arm.x[2 * n :]])
            self._place(still, row, sim.arm.substep)
        self._out[row + 1] = self._out_ended[row + 1] = sim.arm.x

    def _compared(self, failure: str) -> Replay:
        recording, sim = self._recording, self._sim
        columns = min(self._ended.shape[1], sim.arm.plant.nx) if self._same else 2 * sim.n
        there, here = self._ended[:, :columns], self._out_ended[:, :columns]
        ticks = np.ones(len(recording), bool)
        ticks[[0, *recording.gaps]] = False
        apart = np.where(ticks, abs(there - here)[:, : sim.n].max(axis=1), 0.0)
        reached = ~np.isnan(here[:, 0])
        # Compares bits, not numbers: zero has a sign.
        other = (there.copy().view(np.int64) != here.copy().view(np.int64)).any(axis=1)
        rows = np.flatnonzero(other & ticks & reached)
        first = self._difference(int(rows[0]), there, here) if len(rows) else None
        known = versions()
        told = recording.origin.versions if recording.origin is not None else {}
        others = tuple(name for name, value in told.items() if known.get(name) != value)
        return Replay(self._motion(reached), first, read_only(apart), others, failure)

    def _difference(self, row: int, there: Array, here: Array) -> Difference:
        bits = there[row].copy().view(np.int64) != here[row].copy().view(np.int64)
        k, n = int(np.flatnonzero(bits)[0]), self._sim.n
        names = [f"{part} of {name}" for part in _PARTS for name in self._sim.joint_names]
        what = names[k] if k < 2 * n else self._sim.z_names[k - 2 * n]
        time = float(self._recording.time[row])
        return Difference(row, time, what, float(there[row, k]), float(here[row, k]))

    def _motion(self, reached: NDArray[np.bool_]) -> Recording:
        """The replayed motion, up to a failure."""
        recording, sim = self._recording, self._sim
        ends = np.flatnonzero(~np.isnan(self._out[:, 0]))
        rows = int(ends[-1]) + 1 if len(ends) else 0
        parts = np.split(self._out[:rows], (sim.n, 2 * sim.n), axis=1)
        q, v, z = (read_only(part) for part in parts)
        arrays = {
            name: getattr(recording, name)[:rows]
            for name in ("time", "command", "local_error", "time_stepped")
        }
        p = recording.p[:rows]
        if p.shape[1] != len(sim.arm.parameters):
            p = np.tile(sim.arm.parameters, (rows, 1))
        origin = replace(
            sim.arm.origin, source=recording.origin.source if recording.origin else ""
        )
        return replace(
            recording, **arrays, q=q, v=v, z=z, p=read_only(p), jumps=self._jumps_until(rows),
            hold=None if recording.hold is None else recording.hold[:rows], origin=origin,
            gaps=tuple(row for row in recording.gaps if row < rows), physics=Physics(origin),
            measured=None,
        )  # fmt: skip

    def _jumps_until(self, rows: int) -> tuple[Jump, ...]:
        """The changes of the recording, with the replayed states before them."""
        arm = self._sim.arm
        return tuple(
            replace(jump, x=read_only(self._out_ended[jump.row] if jump.row else arm.x))
            for jump in self._recording.jumps
            if jump.row < rows and arm.plant.nx == len(jump.x)
        )


def _with_tunable(scene: Scene, names: Sequence[str]) -> Scene:
    """A scene with only these quantities tunable."""
    return scene.model_copy(
        update={"tunable": tuple(name for name in scene.tunable if name in names)}
    )
