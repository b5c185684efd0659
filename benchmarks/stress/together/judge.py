# SPDX-License-Identifier: Apache-2.0
"""One case: every run of it against the motion that tight error control finds."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from arm_dynamics import ArmError, ArmModel, load_scene
from arm_sim import Recording, SimulationDiverged, Simulator
from benchmarks.stress.motion import KNOWN, NUDGE, STEADY, difference
from benchmarks.stress.together import peer
from benchmarks.stress.together.cases import Case, Drive, draw
from benchmarks.stress.verdict import NAN, REFUSED, SHOWN, STOPPED, SURVIVED, UNDETECTED

REFERENCE, OTHER = ("dop853", 0.5, 1e-10), ("dop853", 1.0, 1e-8)  # method, ticks, tolerance
BUMP = 1e-4  # a larger nudge: events that a small one leaves as they are may change
WRONG = 0.05  # of the way, that a motion may be off
LEAST = 1e-3  # relative to 1 + |q|: less is not wrong, however short the way
RIGHT = 1e-4  # of the way: a motion that is no further off is right
STATED = 0.1  # of the error, that a stated error must be at least to have told
PATIENCE = 5.0  # [s] of CPU for a tick
SLOW, CRASHED = "hung", "crashed"
OUTCOMES = (SURVIVED, SHOWN, STOPPED, REFUSED, SLOW, CRASHED, UNDETECTED, NAN)
FORBIDDEN = (SLOW, CRASHED, UNDETECTED, NAN)
OURS, MUJOCO = "arm_sim", "MuJoCo"


@dataclass(frozen=True)
class Result:
    """What became of one run.

    Attributes:
        seed: of the case.
        run: of the case.
        name: method, with its tolerance if it has one.
        dt: length of a tick [s].
        label: the case in words.
        outcome: one of ``OUTCOMES``.
        program: ``OURS`` or ``MUJOCO``.
        familiar: whether MuJoCo has words for the case.
        touches: whether it has stops or contacts.
        command: kind of command.
        steady: whether the motion is known and errors grow so little that a method has to answer
            for them; where not, only the account judges.
        travel: how far it goes, relative to 1 + |q|.
        error: largest error of q, relative to 1 + |q|; None where the motion is not known.
        account: energy from nowhere, relative to what moved.
        claimed: error that the simulator states, in [rad]; None with fixed steps.
        told: what told of an error: ``doubt``, ``stated error`` or ``time-stepped``.
        false_alarm: whether the account is off though the motion is right.
        slowest: CPU time of the longest tick [s].
        message: what was said when it stopped or was refused; of the reference, if that stopped.
    """

    seed: int
    run: int
    name: str
    dt: float
    label: str
    outcome: str
    program: str = OURS
    familiar: bool = False
    touches: bool = False
    command: str = ""
    steady: bool = False
    travel: float = 0.0
    error: float | None = None
    account: float | None = None
    claimed: float | None = None
    told: tuple[str, ...] = ()
    false_alarm: bool = False
    slowest: float = 0.0
    message: str = ""


@dataclass(frozen=True)
class Truth:
    """What a run really does.

    Attributes:
        q: positions at every tick, shape (ticks + 1, n); None if they cannot be computed.
        steady: as in ``Result``.
        message: why it cannot be computed, or why the reference itself is in doubt.
    """

    q: np.ndarray | None
    steady: bool
    message: str = ""

    @property
    def travel(self) -> float:
        """How far it goes, relative to 1 + |q|."""
        return 0.0 if self.q is None else difference(self.q, self.q[0])


def examine(seed: int, runs: int) -> Iterator[Result]:
    """Run a case; what became of each run, as it comes."""
    case = draw(seed, runs)
    blank = Result(
        seed,
        0,
        case.setting.name,
        case.setting.dt,
        case.label,
        REFUSED,
        familiar=case.familiar,
        touches=case.touches,
    )
    try:
        model = ArmModel(load_scene(case.scene))
        sim = _simulator(model, case, (case.setting.method, 1.0, case.setting.tolerance))
        exact, other = (_simulator(model, case, way) for way in (REFERENCE, OTHER))
    except ArmError as error:
        for k in range(runs):
            yield replace(blank, run=k, message=str(error))
        return
    for k, drive in enumerate(case.drives):
        told = replace(blank, run=k, command=drive.kind)
        try:
            start = _start(sim, drive)
        except ArmError as error:
            yield replace(told, message=str(error))
            continue
        truth = _truth(exact, other, start, drive)
        yield _attempt(replace(told, steady=truth.steady, travel=truth.travel), sim, start, drive,
                       truth)  # fmt: skip
        if case.familiar and peer.there():
            yield _by_peer(told, case, start, sim, drive, truth)


def _simulator(model: ArmModel, case: Case, way: tuple[str, float, float | None]) -> Simulator:
    method, ticks, tolerance = way
    return Simulator(model, method, case.setting.dt * ticks, tolerance)


def _start(sim: Simulator, drive: Drive) -> tuple[np.ndarray, np.ndarray]:
    """The first start that the scene allows."""
    for q in drive.q[:-1]:
        try:
            state = sim.reset(q, drive.v)
            return np.array(state.q), np.array(state.v)
        except ArmError:
            continue
    state = sim.reset(drive.q[-1], drive.v)
    return np.array(state.q), np.array(state.v)


def _truth(
    exact: Simulator, other: Simulator, start: tuple[np.ndarray, np.ndarray], drive: Drive
) -> Truth:
    """The motion by tight error control with half the tick, and how sensitive it is."""
    q, v = start
    try:
        exact.reset(q, v)
        recording = exact.run(len(drive.command) * other.dt, np.repeat(drive.command, 2, axis=0))
        if not np.isfinite(recording.q).all():
            return Truth(None, False, "the reference is not finite")
        true = recording.q[::2]
        q0 = _followed(other, start, drive)
    except ArmError as error:
        return Truth(None, False, f"reference: {error}")
    if not recording.trusted or recording.time_stepped[-1]:
        return Truth(true, False, f"reference in doubt: account {recording.energy_error:.2g}, "
                     f"{recording.time_stepped[-1]:.0f} ticks time-stepped")  # fmt: skip
    if difference(q0, true) > KNOWN:
        return Truth(true, False, f"reference in doubt: {difference(q0, true):.2g}")
    sign = np.where(np.arange(len(q)) % 2, 1.0, -1.0)
    for size in (NUDGE, -NUDGE, BUMP, -BUMP):
        try:
            moved = _followed(other, (q + size * sign, v - size * sign), drive)
        except ArmError:  # beyond a stop, or inside a plane: the other way will do
            continue
        if difference(moved, q0) > STEADY * abs(size) or (
            abs(size) == BUMP and difference(moved, q0) > WRONG * difference(true, true[0]) + LEAST
        ):
            return Truth(true, False)
    return Truth(true, True)


def _followed(sim: Simulator, start: tuple[np.ndarray, np.ndarray], drive: Drive) -> np.ndarray:
    sim.reset(*start)
    return sim.run(len(drive.command) * sim.dt, drive.command).q


def _attempt(
    told: Result, sim: Simulator, start: tuple[np.ndarray, np.ndarray], drive: Drive, truth: Truth
) -> Result:
    sim.reset(*start)
    clock = _Clock(drive.command)
    try:
        run = sim.run(len(drive.command) * sim.dt, clock)
    except SimulationDiverged as error:
        kept = error.recording is not None and _finite(error.recording)
        outcome = STOPPED if kept else NAN
        return replace(told, outcome=outcome, message=str(error), slowest=clock.slowest)
    except ArmError as error:
        return replace(told, message=str(error))
    told = replace(told, slowest=clock.stop(), message=truth.message)
    if not (_finite(run) and np.isfinite(sim.effort).all()):
        return replace(told, outcome=NAN)
    return _judged(told, run, sim.choice.tolerance is not None, truth)


class _Clock:
    """A table of commands as a function that takes the CPU time of every tick."""

    def __init__(self, command: np.ndarray) -> None:
        self.command, self.slowest, self._since = command, 0.0, time.process_time()

    def __call__(self, state: object) -> np.ndarray:
        self.stop()
        return np.asarray(self.command[state.step])  # type: ignore[attr-defined]

    def stop(self) -> float:
        now = time.process_time()
        self.slowest, self._since = max(self.slowest, now - self._since), now
        return self.slowest


def _finite(run: Recording) -> bool:
    return all(bool(np.isfinite(x).all()) for x in (run.q, run.v, run.z, run.tau))


def _judged(told: Result, run: Recording, controlled: bool, truth: Truth) -> Result:
    error = None if truth.q is None else difference(run.q, truth.q)
    claimed = float(run.local_error[-1]) if controlled else None
    words = {
        "doubt": not run.trusted,
        "time-stepped": run.time_stepped[-1] > 0,
        "stated error": claimed is not None and claimed >= STATED * (error or np.inf),
    }
    found = replace(
        told, error=error, account=run.energy_error, claimed=claimed,
        told=tuple(word for word, said in words.items() if said),
    )  # fmt: skip
    if found.slowest > PATIENCE:
        return replace(found, outcome=SLOW)
    if wrong(error, truth):
        return replace(found, outcome=SHOWN if found.told else UNDETECTED)
    right = error is not None and error <= RIGHT * truth.travel
    alarm = words["doubt"] and truth.steady and right
    shown = words["doubt"] and not alarm
    return replace(found, outcome=SHOWN if shown else SURVIVED, false_alarm=alarm)


def wrong(error: float | None, truth: Truth) -> bool:
    """Whether an error is one that a method has to answer for."""
    return truth.steady and error is not None and error > max(WRONG * truth.travel, LEAST)


def _by_peer(
    told: Result, case: Case, start: tuple[np.ndarray, np.ndarray], sim: Simulator, drive: Drive,
    truth: Truth,
) -> Result:  # fmt: skip
    """MuJoCo on the same; it has no account and states no error, so only a warning tells."""
    told = replace(
        told, program=MUJOCO, name=peer.method(case.setting), steady=truth.steady,
        travel=truth.travel,
    )  # fmt: skip
    q, warned = peer.follow(case, start, drive.command, sim.joint_names)
    if warned:
        return replace(told, outcome=STOPPED, message=warned)
    if not np.isfinite(q).all():
        return replace(told, outcome=NAN)
    error = None if truth.q is None else difference(q, truth.q)
    return replace(told, error=error, outcome=UNDETECTED if wrong(error, truth) else SURVIVED)
