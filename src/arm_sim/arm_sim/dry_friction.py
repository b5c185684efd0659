# SPDX-License-Identifier: Apache-2.0
"""Ticks of a scene with dry friction: smooth pieces between stops and break-aways.

Between two such instants every joint slides one way or sticks, and the equation is as smooth as
without friction, so the method keeps its order; the instants themselves are located to rounding. A
joint that sticks has acceleration zero, not a small one: it stays where it is, to the bit.
Event-driven treatment of set-valued friction: Glocker, Set-Valued Force Laws, 2001, chapter 8.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from arm_dynamics.kernel import Kernel
from arm_dynamics.model import Array
from arm_sim.actuation import CompiledControl, actuation
from arm_sim.adaptive import SubstepControl, controlled_tick
from arm_sim.choice import Choice
from arm_sim.integrators import build_attempt, build_step
from arm_sim.plant import Plant
from arm_sim.stepper import check_kernel, within_reach

# A tick with more stops and starts than this for each joint is not a motion any more.
EVENTS_PER_JOINT = 50
LEAST_INDEX_FROM = 3
BISECTIONS = 200
# A joint that is let go at the very edge of sticking may leave by rounding in the wrong direction.
ROUNDING = 1e-13


class DryStepper:
    """Event-driven steps; see ``Stepper`` for the interface."""

    def __init__(
        self, plant: Plant, choice: Choice, backend: str, control: CompiledControl | None = None
    ) -> None:
        self._n, self._dt, self._model = plant.model.n, choice.dt, plant.model
        smooth, name = _flow_function(plant, choice)
        functions = [plant.acceleration, plant.reaction, smooth, actuation(plant, control)]
        self.kernel = Kernel(functions, backend)
        check_kernel(plant, self.kernel)
        self.p = plant.parameters.nominal
        self.tick_operations = self.kernel.operations(name)
        self._control = None
        if choice.tolerance is not None:
            self._control = SubstepControl(choice.tolerance, choice.method.order)
        self._smooth = self.kernel.call(name)
        self._acceleration, self._reaction = (
            self.kernel.call("acceleration"),
            self.kernel.call("reaction"),
        )
        self._actuate = self.kernel.call("actuate")
        self._sticky = plant.model.static > 0.0

    def restart(self) -> None:
        """Forget what was learned from earlier steps."""
        if self._control is not None:
            self._control.restart()

    def roll(
        self, x: Array, command: Array, ticks: int, trace: Array, effort: Array, errors: Array
    ) -> int:
        """See ``Stepper.roll``."""
        for k in range(ticks):
            effort[k] = self._actuate(x, command[k] if command.ndim == 2 else command)[0]
            after = self._tick(x, effort[k])
            if after is None:
                return k
            x[:] = trace[k] = after
            errors[k] = self._control.error if self._control is not None else 0.0
        return ticks

    def directions(self, x: Array, u: Array) -> Array:
        """What each joint does or is about to do: -1 and 1 slide, 0 sticks.

        Joints without dry friction count as 1. A joint at rest sticks while its reaction is within
        the static level; one that is let go must move the way it is pulled. Which of them do is a
        linear complementarity problem with M, which is positive definite, and is solved by
        pivoting: the worst first, and if that goes in circles by least index, which cannot (Murty,
        Linear Complementarity, Linear and Nonlinear Programming, 1988, section 4.1).

        Args:
            x: State, shape (nx,).
            u: Torque that acts, shape (n,).

        Returns:
            Directions, shape (n,).
        """
        q, v = x[: self._n], x[self._n :]
        direction = np.where(self._sticky, np.sign(v), 1.0)
        resting = self._sticky & (v == 0.0)
        if not resting.any():
            return direction
        for pivot in range(LEAST_INDEX_FROM * self._n + 2 ** min(self._n, 12)):
            p = self._with(direction)
            load = self._reaction(q, v, u, p)[0]
            a = self._acceleration(q, v, u, p)[0]
            stuck = direction == 0.0
            excess = np.where(
                stuck, (abs(load) - self._model.static) / self._model.static.max(), -direction * a
            )
            wrong = resting & (excess > np.where(stuck, 0.0, 1e-9 * (1.0 + abs(a).max())))
            if not wrong.any():
                break
            least = pivot >= LEAST_INDEX_FROM * self._n
            joint = int(np.argmax(wrong if least else np.where(wrong, excess, -np.inf)))
            direction[joint] = np.sign(load[joint]) if stuck[joint] else 0.0
        return direction

    def parameters_at(self, x: Array, u: Array) -> Array:
        """See ``Stepper.parameters_at``."""
        return self._with(self.directions(x, u))

    def _tick(self, x: Array, u: Array) -> Array | None:
        """State at the end of a tick, or None if it cannot be computed."""
        left = self._dt
        for _ in range(EVENTS_PER_JOINT * self._n):
            direction = self.directions(x, u)
            after = self._flow(x, u, left, direction)
            if after is None:
                return None
            if self._wrong(after, u, direction) <= 0.0:
                return self._rest(after, direction)
            used, x = self._first_event(x, u, left, direction)
            left -= used
            if left <= 0.0:
                return x
        return None

    def _first_event(self, x: Array, u: Array, h: float, direction: Array) -> tuple[float, Array]:
        """When the first joint stops or breaks away, and the state then, with v = 0 there."""

        def wrong(t: float) -> float:
            after = self._flow(x, u, t, direction)
            return np.inf if after is None else self._wrong(after, u, direction)

        _, late = first_positive(wrong, h)
        after = self._flow(x, u, late, direction)
        assert after is not None
        return late, self._rest(after, direction)

    def _rest(self, x: Array, direction: Array) -> Array:
        """Put joints that have just reached zero speed, or passed it by rounding, at rest."""
        v = x[self._n :]
        v[self._sticky & (v * direction <= 0.0)] = 0.0
        return x

    def _wrong(self, x: Array, u: Array, direction: Array) -> float:
        """Positive if a joint slides against its direction or sticks under too much load."""
        q, v = x[: self._n], x[self._n :]
        moving, stuck = self._sticky & (direction != 0.0), self._sticky & (direction == 0.0)
        turned = np.max(-v * direction, where=moving, initial=-np.inf) - ROUNDING * (
            1.0 + abs(v).max()
        )
        if not stuck.any():
            return float(turned)
        load = abs(self._reaction(q, v, u, self._with(direction))[0])
        return float(max(turned, np.max(load - self._model.static, where=stuck, initial=-np.inf)))

    def _flow(self, x: Array, u: Array, h: float, direction: Array) -> Array | None:
        """Motion over ``h`` with every joint doing as ``direction`` says."""
        if self._control is not None:
            after = x.copy()
            ok = controlled_tick(self._smooth, after, u, self._with(direction), h, self._control)
            return after if ok else None
        after = self._smooth(x, u, self._with(direction), h)[0].copy()
        return after if within_reach(after) else None

    def _with(self, direction: Array) -> Array:
        return np.concatenate([self.p, direction])


def first_positive(f: Callable[[float], float], h: float) -> tuple[float, float]:
    """Bracket a sign change of ``f`` on (0, h] to rounding.

    Regula falsi with the weights of Illinois (Dowell, Jarratt, BIT 11, 1971), halved whenever it
    stalls.

    Args:
        f: Continuous; not positive at 0, positive at h.
        h: Right end.

    Returns:
        Times before and after the change; f is positive at the second.
    """
    low, high, f_low, f_high = 0.0, h, f(0.0), f(h)
    for k in range(BISECTIONS):
        if high - low <= 4e-16 * h:
            break
        secant = high - f_high * (high - low) / (f_high - f_low) if np.isfinite(f_high) else low
        trial = secant if low < secant < high and k % 4 != 3 else 0.5 * (low + high)
        value = f(trial)
        if value > 0.0:
            high, f_high, f_low = trial, value, 0.5 * f_low
        else:
            low, f_low, f_high = trial, value, 0.5 * f_high
    return low, high


def _flow_function(plant: Plant, choice: Choice) -> tuple[ca.Function, str]:
    if choice.tolerance is None:
        return build_step(choice.method, plant.rhs, plant.model.n), "step"
    return build_attempt(choice.method, plant.rhs, plant.model.n), "attempt"
