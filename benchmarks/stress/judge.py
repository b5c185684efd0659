# SPDX-License-Identifier: Apache-2.0
"""A case against what it really does, and whether a run that is wrong says so.

What it really does is a run in short ticks under tight error control, and where it can and is
asked, that of the simulator of ``test/reference/independent``, which shares no line with the suite
(it knows neither backlash nor current limits, and takes seconds to minutes).
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pinocchio as pin

from arm_dynamics import ArmError, ArmModel, load_scene
from arm_sim import Recording, SimulationDiverged, Simulator
from benchmarks.stress.scenes import PIECE, PIECES, Case, Way, draw

TEST = str(Path(__file__).parents[2] / "test")
sys.path[:0] = [] if TEST in sys.path else [TEST]

TRUTH = Way("dop853", 1e-4, 1e-11)
NUDGE, STEADY = 1e-9, 1e4  # a start moved by so much moves the end by at most so many times more
FACTOR, FIXED = 10.0, 1e-6  # error that needs no word, in tolerances; and without error control
BESIDE = 3.0  # times the stated error that tells of one
FALSE = 0.01  # of what needs no word: a doubt of so small an error is a false alarm
WRONG, LEAST = 0.05, 1e-3  # of the way, and relative to 1 + |q|: a larger error is no survival
MOST_LOOKS = 20_000  # of the independent simulator: ten seconds or so

SURVIVED, SHOWN, MAGNIFIED, UNSTEADY = "survived", "shown", "magnified", "not steady"
STOPPED, REFUSED, HUNG, CRASHED = "stopped", "refused", "hung", "crashed"
UNDETECTED, NAN = "undetected", "silent NaN"
OUTCOMES = (
    SURVIVED, SHOWN, MAGNIFIED, UNSTEADY, STOPPED, REFUSED, HUNG, CRASHED, UNDETECTED, NAN,
)  # fmt: skip
FORBIDDEN = (HUNG, CRASHED, UNDETECTED, NAN)
Vector = np.ndarray


@dataclass(frozen=True)
class Result:
    """What became of one run."""

    kind: str  # of the case
    seed: int  # of the case
    name: str  # method, and whether under error control
    dt: float  # length of a tick [s]
    # ``survived``: off by at most 5 % of the way. ``shown``: further, and the recording tells.
    # ``undetected``: off by more than needs no word, and nothing tells. ``magnified``: likewise,
    # but an error that needs no word grows to it by itself. ``not steady``: nobody knows the
    # motion. ``stopped``: with an error that keeps the last good state. ``refused``: at once.
    outcome: str
    traits: tuple[str, ...] = ()  # of the case
    tolerance: float | None = None  # of error control; None without
    rate: float = 0.0  # fastest change in the true motion [1/s]
    error: float | None = None  # largest of q, relative to 1 + |q|
    stated: float | None = None  # largest that the recording states
    told: str = ""  # what tells of an error
    false_alarm: bool = False  # whether it is told of one although there is none
    apart: float | None = None  # difference of the two truths; None without the second
    message: str = ""  # what was said when it stopped or was refused


@dataclass(frozen=True)
class Truth:
    """What a case really does."""

    q: Vector  # positions between the pieces of the command, shape (PIECES + 1, n)
    v: Vector  # velocities, likewise
    growth: float = 1.0  # of a nudge of the start, at least 1
    rate: float = 0.0  # fastest change [1/s]
    second: Vector | None = None  # the same positions by the independent simulator; None without


def examine(kind: str, seed: int, most_joints: int, share: float = 0.0) -> list[Result]:
    """Run a case in all its ways; a share of cases is given to the independent simulator, too."""
    blank = Result(kind, seed, "every method", 0.0, REFUSED)
    try:
        case = draw(kind, seed, most_joints)
        blank = replace(blank, traits=case.traits)
        model = ArmModel(load_scene(case.scene))
        start = started(Simulator(model, dt=TRUTH.dt), case)
    except ArmError as error:
        return [replace(blank, message=str(error))]
    second = np.random.default_rng([seed, 1]).random() < share
    truth = solve(model, case, start, second)
    return [attempt(blank, model, case, start, truth, way) for way in case.ways]


def started(simulator: Simulator, case: Case) -> tuple[Vector, Vector]:
    """The first start that a scene allows."""
    for q in case.q:
        try:
            state = simulator.reset(q, case.v)
        except ArmError as error:
            refusal = error
            continue
        return np.array(state.q), np.array(state.v)
    raise refusal


def solve(
    model: ArmModel, case: Case, start: tuple[Vector, Vector], second: bool = False
) -> Truth | None:
    """What a case really does; None if it cannot be computed, or errors grow too much."""
    q, v = start
    sim = Simulator(model, TRUTH.method, TRUTH.dt, TRUTH.tolerance)
    sign = np.where(np.arange(len(q)) % 2, 1.0, -1.0)
    runs = []
    for nudge in (0.0, NUDGE, -NUDGE):
        try:
            sim.reset(q + nudge * sign * (1 + abs(q)), v - nudge * sign * (1 + abs(v)))
            runs.append(sim.run(PIECE * PIECES, case.commands(TRUTH.dt)))
        except ArmError:
            if not runs:
                return None
    true, speeds = (_between_pieces(x, TRUTH.dt) for x in (runs[0].q, runs[0].v))
    moved = max((difference(_between_pieces(run.q, TRUTH.dt), true) for run in runs[1:]),
                default=np.inf)  # fmt: skip
    if not np.isfinite(true).all() or moved > STEADY * NUDGE or runs[0].time_stepped[-1]:
        return None
    other = independent(case, start) if second else None
    return Truth(true, speeds, max(1.0, moved / NUDGE), _rate(model, runs[0]), other)


def independent(case: Case, start: tuple[Vector, Vector]) -> Vector | None:
    """Positions between the pieces by the independent simulator; None if it cannot."""
    from reference.independent import simulate

    names = ArmModel(load_scene(case.scene)).joint_names
    position, velocity = (dict(zip(names, part.tolist(), strict=True)) for part in start)
    scene = case.scene | {"initial": {"position": position, "velocity": velocity}}
    times = PIECE * np.arange(PIECES + 1)
    try:
        return np.asarray(simulate(scene, case.command, times, most_looks=MOST_LOOKS).q)
    except (NotImplementedError, RuntimeError):
        return None


def attempt(
    blank: Result, model: ArmModel, case: Case, start: tuple[Vector, Vector],
    truth: Truth | None, way: Way,
) -> Result:  # fmt: skip
    """Run a case in one way, and judge what comes of it."""
    result = replace(blank, name=way.name, dt=way.dt, tolerance=way.tolerance)
    try:
        simulator = Simulator(model, way.method, way.dt, way.tolerance)
        simulator.reset(*start)
        run = simulator.run(PIECE * PIECES, case.commands(way.dt))
    except SimulationDiverged as error:
        kept = error.recording is not None and _finite(error.recording)
        return replace(result, outcome=STOPPED if kept else NAN, message=str(error))
    except ArmError as error:
        return replace(result, message=str(error))
    if not (_finite(run) and np.isfinite(simulator.effort).all()):
        return replace(result, outcome=NAN)
    if truth is None:
        return replace(result, outcome=UNSTEADY)
    return judged(replace(result, tolerance=simulator.choice.tolerance), run, truth)


def judged(result: Result, run: Recording, truth: Truth) -> Result:
    """What a finite run is, given what it should be."""
    q, v = (_between_pieces(x, result.dt) for x in (run.q, run.v))
    error, apart = difference(q, truth.q), None
    if truth.second is not None:
        apart = difference(truth.second, truth.q)
        if apart > NUDGE * truth.growth:  # else rounding
            error = max(error, difference(q, truth.second))
    allowed = FIXED if result.tolerance is None else max(FACTOR * result.tolerance, 1e-12)
    stated = float(np.max(run.error))
    words = run.doubt or ("stated error" if error <= BESIDE * stated else "")
    verdict = replace(
        result, error=error, stated=stated, told=words, apart=apart, rate=truth.rate,
        false_alarm=bool(run.doubt) and max(error, difference(v, truth.v)) <= FALSE * FIXED,
    )  # fmt: skip
    if error > allowed and not words:
        return replace(
            verdict, outcome=MAGNIFIED if error <= truth.growth * allowed else UNDETECTED
        )
    far = error > max(WRONG * difference(truth.q, truth.q[0]), LEAST)
    return replace(verdict, outcome=SHOWN if far else SURVIVED)


def difference(q: Vector, wanted: Vector) -> float:
    """Largest difference of positions, relative to 1 + |q|."""
    return float(np.max(np.abs(q - wanted) / (1 + np.abs(wanted))))


def _between_pieces(x: Vector, dt: float) -> Vector:
    return np.asarray(x[:: round(PIECE / dt)])


def _finite(run: Recording) -> bool:
    return all(bool(np.isfinite(x).all()) for x in (run.q, run.v, run.z, run.tau))


def _rate(model: ArmModel, run: Recording) -> float:
    """Fastest change of a joint's speed relative to its top speed, and of a link's direction."""
    top = np.maximum(np.abs(run.v).max(axis=0), 1e-12)
    change = float(np.max(np.abs(np.diff(run.v, axis=0)) / TRUTH.dt / top))
    data, turning = model.pin.createData(), 0.0
    rows = slice(0, None, max(1, len(run) // 100))
    pairs = zip(model.configuration(run.q[rows]), model.spread(run.v[rows]), strict=True)
    for q, v in pairs:
        pin.forwardKinematics(model.pin, data, q, v)
        turning = max(turning, *(float(np.linalg.norm(link.angular)) for link in data.v))
    return max(change, turning)
