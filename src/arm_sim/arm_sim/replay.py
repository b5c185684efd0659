# SPDX-License-Identifier: Apache-2.0
"""Replay of a recorded run, and comparison with the recording."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arm_dynamics import InvalidInput, load_scene
from arm_dynamics.arrays import Array, read_only
from arm_sim.exceptions import SimulationDiverged
from arm_sim.plant.parameters import EXTERNAL, Parameters
from arm_sim.recording.contents import BRAKES, FREE
from arm_sim.recording.origin import versions
from arm_sim.recording.physics import physics_of
from arm_sim.recording.recording import Recording
from arm_sim.simulation.runtime_changes import external_change
from arm_sim.simulation.simulator import Simulator


@dataclass(frozen=True)
class Difference:
    """The first value that differs.

    Attributes:
        tick: Tick at whose end it is, counted from the beginning of the recording.
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
    recording: Recording, scene: Any = None, integrator: str | None = None,
    tolerance: float | None = None,
) -> Replay:  # fmt: skip
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
    origin, same_scene = recording.origin, scene is None
    if origin is None or recording.of_robot:
        raise InvalidInput(
            "the recording is of a robot, not of time steps of a simulation, as "
            "`-p record:=run.mcap` of the sim node records them; --topics plays it"
        )
    base = origin.scene if scene is None else load_scene(scene)
    # Imperfections between arm and controller have affected the commands already.
    plain: dict[str, Any] = {"sensors": None, "commands": None}
    if same_scene and recording.jumps:
        tunable = recording.jumps[0].tunable
        plain["tunable"] = tuple(name for name in base.tunable if name in tunable)
    if integrator is None and tolerance is None:
        integrator, tolerance = origin.integrator, origin.tolerance
    sim = Simulator(base.model_copy(update=plain), integrator, origin.dt, tolerance)
    if sim.joint_names != recording.joint_names:
        raise InvalidInput(
            f"the scene has joints {', '.join(sim.joint_names)}; the recording has "
            f"{', '.join(recording.joint_names)}"
        )
    rerun = _Rerun(recording, sim, same_scene)
    failure = rerun.run()
    columns = min(recording.ended.shape[1], rerun.ended.shape[1]) if same_scene else 2 * sim.n
    recorded, replayed = (x[:, :columns].copy() for x in (recording.ended, rerun.ended))
    ticks = np.ones(len(recording), bool)
    ticks[[0, *recording.gaps]] = False
    distance = np.where(ticks, abs(recorded - replayed)[:, : sim.n].max(axis=1), 0.0)
    first = _first_difference(recording.time, ticks, recorded, replayed, sim)
    installed = versions()
    others = tuple(name for name, value in origin.versions.items() if installed.get(name) != value)
    return Replay(rerun.motion(), first, read_only(distance), others, failure)


def _first_difference(
    time: Array, ticks: NDArray[np.bool_], recorded: Array, replayed: Array, sim: Simulator
) -> Difference | None:
    """The first value of some ticks whose bits differ: as numbers, zeros of both signs do not."""
    differs = recorded.view(np.int64) != replayed.view(np.int64)
    rows = np.flatnonzero(differs.any(axis=1) & ticks & ~np.isnan(replayed[:, 0]))
    if not len(rows):
        return None
    row, k = int(rows[0]), int(differs[rows[0]].argmax())
    kinds, joints = ("position", "velocity"), sim.joint_names
    names = [f"{kind} of {joint}" for kind in kinds for joint in joints]
    values = float(recorded[row, k]), float(replayed[row, k])
    return Difference(row, float(time[row]), [*names, *sim.z_names][k], *values)


class _Rerun:
    """Makes the ticks of a recording again.

    Args:
        recording: The recording.
        sim: The simulator that makes the ticks.
        same: Whether its scene is the recorded one.

    Attributes:
        ended: States at the end of each tick, shape (k+1, nx); NaN from a failure on. The motion
            has those at the beginning of each: others where something else has changed the state.
    """

    def __init__(self, recording: Recording, sim: Simulator, same: bool) -> None:
        self._recording, self._sim = recording, sim
        self._x, self._ended = recording.x, recording.ended
        self._jumps = {jump.row: jump for jump in recording.jumps}
        self._layout = Parameters(recording.plant.model)  # of the recorded quantities
        self._states_before, self.ended = np.full((2, len(recording), sim.arm.plant.nx), np.nan)
        self._tuned = list[str]()  # what comes from the recording; another scene has its own
        for name in self._layout.names:
            column = recording.p[:, self._layout.place(name)]
            if not (same or name == EXTERNAL or np.any(column != column[0])):
                continue
            if name != EXTERNAL and name not in sim.arm.plant.parameters.names:
                raise InvalidInput(
                    f"'{name}' was changed in the recording and is not tunable in the scene"
                )
            self._tuned.append(name)

    def run(self) -> str:
        """Make all ticks; return why that failed, if it did."""
        edges = self._recording.edges
        for row, end in zip(edges, [*edges[1:], None], strict=True):
            self._begin(row)
            if end is None or end in self._recording.gaps:
                continue  # there is no tick across a gap
            try:
                self._advance(row, end)
            except SimulationDiverged as error:
                return str(error)
        return ""

    def _begin(self, row: int) -> None:
        """Apply changes at a time other than by ticks."""
        recording, sim, jump = self._recording, self._sim, self._jumps.get(row)
        later = (jump.tunable for jump in recording.jumps if jump.row > row)
        tunable = next(later, self._layout.names)
        if EXTERNAL in tunable and EXTERNAL not in sim.arm.plant.parameters.names:
            external_change(sim)()
        is_changed = self._ended[row].tobytes() != self._x[row].tobytes()
        if row == 0 or row in recording.gaps or is_changed:
            self._place(self._x[row], row, recording.substep if jump is None else jump.substep)
        elif jump is not None or np.any(recording.p[row] != recording.p[row - 1]):
            self._place(sim.arm.x, row, sim.arm.substep)
        self._states_before[row] = sim.arm.x

    def _place(self, x: Array, row: int, substep: float) -> None:
        """Set the state, with the quantities tuned at a time."""
        sim, tunable, p = self._sim, self._sim.arm.plant.parameters, self._recording.p[row]
        values = {name: self._layout.of(name, p) for name in self._tuned if name in tunable.names}
        if len(x) != sim.arm.plant.nx:  # another scene, with other internal states
            q, v = x[: sim.n], x[sim.n : 2 * sim.n]
            x = np.concatenate([q, v, sim.arm.plant.laws.initial(q, v)])
        step = round(self._recording.time[row] / sim.dt)
        sim.arm.restore(x.copy(), tunable.merged(values, tunable.nominal), step, substep)

    def _advance(self, row: int, end: int) -> None:
        """Run the ticks between two edges."""
        recording, sim, n = self._recording, self._sim, self._sim.n
        hold = FREE if recording.hold is None else recording.hold[row]
        if hold == FREE:
            try:
                motion = sim.run((end - row) * sim.dt, recording.command[row:end])
            except SimulationDiverged as error:
                self._keep(row, error.recording.x[1:])
                raise
            self._keep(row, motion.x[1:])
            return
        for k in range(row, end):
            if hold == BRAKES:  # nothing is computed there: the state is the recorded one
                state = self._ended[k + 1]
            else:
                q = sim.arm.x[:n].copy()
                sim.arm.advance(recording.command[k].tolist())
                state = np.concatenate([q, np.zeros(n), sim.arm.x[2 * n :]])
            self._place(state, k, sim.arm.substep)
            self._keep(k, sim.arm.x[None])

    def _keep(self, row: int, x: Array) -> None:
        """Record states after the ticks from a row on."""
        rows = slice(row + 1, row + 1 + len(x))
        self._states_before[rows] = self.ended[rows] = x

    def motion(self) -> Recording:
        """The replayed motion, up to a failure."""
        recording, sim, origin = self._recording, self._sim, self._recording.origin
        assert origin is not None
        rows = int(np.flatnonzero(~np.isnan(self._states_before[:, 0]))[-1]) + 1
        q, v, z = map(read_only, np.split(self._states_before[:rows], (sim.n, 2 * sim.n), axis=1))
        arrays = {
            name: getattr(recording, name)[:rows]
            for name in ("time", "command", "local_error", "time_stepped")
        }
        p = recording.p[:rows]
        if p.shape[1] != len(sim.arm.parameters):
            p = np.tile(sim.arm.parameters, (rows, 1))
        jumps = tuple(
            replace(jump, x=read_only(self.ended[jump.row] if jump.row else sim.arm.x))
            for jump in recording.jumps
            if jump.row < rows and sim.arm.plant.nx == len(jump.x)
        )
        origin = replace(sim.arm.origin, source=origin.source)
        return replace(
            recording, **arrays, q=q, v=v, z=z, p=read_only(p), jumps=jumps,
            hold=None if recording.hold is None else recording.hold[:rows], origin=origin,
            gaps=tuple(row for row in recording.gaps if row < rows), physics=physics_of(origin),
            measured=None,
        )  # fmt: skip
