# SPDX-License-Identifier: Apache-2.0
"""The error of a motion, from a second run of all of it by other means.

The second run has another method (DOP853, or DOPRI5 of a motion by DOP853), a quarter of the tick,
and error control by a tolerance far below the scene's accuracy, so that guards are evaluated at
other instants as well. It is given the commands that acted. Where they were given in advance, or a
compiled controller finds them again from the second run's own states, both runs cover the same
motion and differ by its error. Commands that answered to the state would let an unstable arm drift
away from itself; such a motion is repeated in windows, each from a recorded state, whose errors
add up as in a loop that neither damps nor magnifies them. Windows in which both runs part, as a
controlled instability makes them, are halved.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.codegen.one_at_a_time import built_once
from arm_sim.integrators.methods import METHODS
from arm_sim.integrators.selection import IMPLICIT_STIFFNESS, Choice, fastest_rate, law_rate
from arm_sim.plant.plant import Plant
from arm_sim.recording.contents import FREE, Contents
from arm_sim.stepping.stepper import Stepper
from arm_sim.stepping.trial import persistent_errors

# Ticks of the second run in a tick of the first
FINER = 4
# Tolerance of a sub-step, relative to the scene's accuracy: a second has up to some 1e4 of them;
# its bounds are what rounding allows, and what was tried on random scenes.
MARGIN, FINEST, COARSEST = 1e-4, 1e-13, 1e-10
# Length of a window in [s]: an arm falls little in it, and rounding adds up ten times in one
WINDOW = 0.1
# Length in [s] of a window whose share of the accuracy all shorter ones have
SHORTEST = 0.01
# Ticks that are repeated in one call
CHUNK = 1000
# Change of the start by which magnification is measured, and what is called magnification
NUDGE, MAGNIFIED = 1e-9, 1e3

# How the second run was made
CLOSED, WHOLE, WINDOWS = (
    "with its controller", "under its commands",
    f"in windows of up to {WINDOW:g} s from recorded states",
)  # fmt: skip

# Effective command of a tick, from the state at its start and its row
Control = Callable[[Array, int], Array]


@dataclass(frozen=True)
class SecondRun:
    """A motion that was run again.

    Attributes:
        x: States at the end of each tick, shape (k+1, nx); NaN from where it could not go on.
        carried: What earlier windows add to the error of q and v, shape (k+1, 2n).
        how: How it was made: ``CLOSED``, ``WHOLE`` or ``WINDOWS``.
        means: Its method, tolerance and tick, as text.
    """

    x: Array
    carried: Array
    how: str
    means: str


class MotionRepeater:
    """Runs motions of one scene a second time; built on first use.

    Args:
        plant: The scene's equation of motion.
        choice: How the motions were integrated.
        backend: As for ``Kernel``.
    """

    def __init__(self, plant: Plant, choice: Choice, backend: str) -> None:
        self._plant, self._first, self._backend = plant, choice, backend

    @cached_property
    def choice(self) -> Choice:
        """Method, tick and tolerance of the second run."""
        plant, first = self._plant, self._first
        dt, accuracy = first.dt / FINER, plant.model.scene.sim.accuracy
        stiff = max(fastest_rate(plant), law_rate(plant.model)[0]) * dt > IMPLICIT_STIFFNESS
        explicit = "dopri5" if first.method.name == "dop853" else "dop853"
        tolerance = min(COARSEST, MARGIN * accuracy, first.tolerance or COARSEST)
        method = METHODS["implicit" if stiff else explicit]
        return Choice(method, dt, max(FINEST, tolerance), "a second run")

    @built_once
    def stepper(self) -> Stepper:
        """Its ticks, under commands that acted."""
        return Stepper(self._plant, self.choice, self._backend, acted=True)

    def run(self, motion: Contents, control: Control | None, nudge: float = 0.0) -> SecondRun:
        """Run a motion again.

        Args:
            motion: The motion.
            control: The controller, if it can be evaluated again.
            nudge: Added to the position of every joint at the start in [rad] or [m].
        """
        open_loop = motion.origin is not None and motion.origin.open_loop
        uncontrolled = WHOLE if open_loop else WINDOWS
        how = CLOSED if control else uncontrolled
        step = max(1, round(WINDOW / self._first.dt)) if how == WINDOWS else CHUNK
        n, x, ended, stepper = len(motion.joint_names), motion.x, motion.ended, self.stepper
        states, carried = np.full(x.shape, np.nan), np.zeros((len(x), 2 * n))
        was_set = (x != ended).any(axis=1)  # states that were not reached by a tick
        was_set[[0, *motion.gaps]] = True
        states[0], free = x[0], _free(motion)
        states[0, :n] += nudge
        stepper.restart()
        spans = list(_spans(motion, step))[::-1]
        while spans:
            row, end = spans.pop()
            if was_set[row]:
                state, error = x[row] if row else states[0], np.zeros(2 * n)
            elif how == WINDOWS or not free[row - 1]:
                difference = abs(states[row] - ended[row])[: 2 * n]
                state, error = x[row], carried[row] + difference
            carried[row + 1 : end + 1], after = error, states[row + 1 : end + 1]
            if not free[row]:  # brakes or servos hold it, or ticks are missing
                after[:] = ended[row + 1 : end + 1]
                continue
            stepper.p[:], state = motion.p[row], state.copy()
            if control is None:
                ticks = _open_loop(stepper, state, motion.command[row:end], after)
            else:
                ticks = _closed_loop(stepper, state, control, row, motion.command.shape[1], after)
            if how == WINDOWS and end - row > 1 and self._part(ended[row + 1 : end + 1], after):
                middle = (row + end) // 2
                spans += [(middle, end), (row, middle)]
            elif ticks < end - row and how != WINDOWS:
                break
        choice = self.choice
        means = (
            f"{choice.method.name}, tolerance {choice.tolerance:g}, time steps of {choice.dt:g} s"
        )
        return SecondRun(read_only(states), read_only(carried), how, means)

    def _part(self, first: Array, second: Array) -> bool:
        """Whether both runs differ in a window as if commands answered to another state."""
        first, second = (x[:, : 2 * self._plant.model.n] for x in (first, second))
        difference = abs(second - first) / (1.0 + abs(first))
        duration = max(len(second) * self._first.dt, SHORTEST)
        return not (difference <= self._plant.model.scene.sim.accuracy * duration).all()


def _free(motion: Contents) -> NDArray[np.bool_]:
    """Whether the arm made the tick from each time by itself, shape (k,)."""
    return motion.moved if motion.hold is None else motion.moved & (motion.hold[:-1] == FREE)


def _spans(motion: Contents, step: int) -> Iterator[tuple[int, int]]:
    """First and last row of stretches that are repeated in one call."""
    last, held = len(motion) - 1, np.diff(_free(motion)).nonzero()[0] + 1
    edges = {*motion.edges, *held.tolist(), *range(0, last, step), 0, last}
    ordered = sorted(edge for edge in edges if edge <= last)
    yield from zip(ordered, ordered[1:], strict=False)


def _open_loop(stepper: Stepper, state: Array, commands: Array, after: Array) -> int:
    """Advance in place under commands, and write the states after them; return their number."""
    rows = np.repeat(commands, FINER, axis=0)
    trace = np.empty((len(rows), len(state)))
    steps = stepper.advance(state, rows, trace, np.empty_like(rows), np.empty((len(rows), 2)))
    ticks = steps // FINER
    after[:ticks] = trace[FINER - 1 : ticks * FINER : FINER]
    return ticks


def _closed_loop(
    stepper: Stepper, state: Array, control: Control, row: int, nu: int, after: Array
) -> int:
    """Ticks under a controller that answers to each state, from a row of the motion."""
    command, trace = np.empty(nu), np.empty((FINER, len(state)))
    tick = stepper.ticks_function(
        state, command, trace, np.empty((FINER, nu)), np.empty((FINER, 2))
    )
    for k in range(len(after)):
        command[:] = control(state, row + k)
        if tick() < FINER:
            return k
        after[k] = state
    return len(after)


def doubt(
    motion: Contents, run: SecondRun, error: Array, magnification: Callable[[int], float]
) -> str:
    """Where, when and, if known, why an error exceeds the scene's accuracy; empty if none does.

    Args:
        motion: The motion.
        run: Its second run.
        error: Estimated error of q and v at each time, shape (k+1, 2n).
        magnification: Factor by which a change of the start has grown at a row.
    """
    assert motion.origin is not None
    n, accuracy = len(motion.joint_names), motion.origin.scene.sim.accuracy
    scaled = error / (1.0 + abs(motion.ended[:, : 2 * n]))
    size = np.vstack([scaled[:1], persistent_errors(scaled[1:], n)])
    allowed = accuracy * np.maximum(1.0, motion.time - motion.time[0])
    beyond = (size > allowed[:, None]).any(axis=1)
    if not beyond.any():
        return ""
    row = int(beyond.argmax())
    column = int(size[row].argmax())
    at = f"joint '{motion.joint_names[column % n]}' at {motion.time[row]:.6g} s"
    if np.isinf(error[row, column]):
        return f"not trustworthy: {at}: a second run ({run.means}) cannot be computed from there"
    quantity = "speed" if column >= n else "position"
    text = (
        f"not trustworthy: {quantity} of {at} is off by {size[row, column]:.1e} of 1 + |x|, "
        f"allowed {allowed[row]:.1e}, by a second run {run.how} ({run.means})"
    )
    stepped = int(motion.time_stepped[row] - motion.time_stepped[0])
    if stepped:
        return (
            f"{text}; {stepped} time steps before were of first order, as they had too many events"
        )
    if (factor := magnification(row)) > MAGNIFIED:
        return (
            f"{text}; the motion magnifies errors, {factor:.0e} times until then: both runs agree "
            "before, and a smaller tolerance extends that little"
        )
    if row > 1 and size[row, column] > 10.0 * size[row - 1, column]:
        return f"{text}; most of it arises in this time step"
    return f"{text}; it adds up over the run: a tolerance, or a smaller dt, reduces it"
