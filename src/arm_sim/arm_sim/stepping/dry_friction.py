# SPDX-License-Identifier: Apache-2.0
"""Ticks of a scene with dry friction: smooth pieces between stops and break-aways.

Between two such instants every joint slides one way or sticks, and the equation is as smooth as
without friction, so the method keeps its order; the instants themselves are located to rounding. A
joint that sticks has acceleration zero, not a small one: it stays where it is, to the bit.
Event-driven treatment of set-valued friction: Glocker, Set-Valued Force Laws, 2001, chapter 8.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from arm_dynamics.model.arm import Array
from arm_sim.integrators.selection import Choice
from arm_sim.plant.actuation import CompiledControl
from arm_sim.plant.plant import Plant
from arm_sim.stepping.events import EventStepper, event_driver, first_positive
from arm_sim.stepping.stepper import check_kernel

DRIVERS = ("dry_modes.c", "events.c", "dry.c")
# A tick with more stops and starts than this for each joint is not a motion any more.
EVENTS_PER_JOINT = 50
LEAST_INDEX_FROM = 3
# A joint that is let go at the very edge of sticking may leave by rounding in the wrong direction.
ROUNDING = 1e-13
# Speed, relative to the fastest joint's, that a joint which stops may have where it is found to.
AT_REST = 1e-6


class DryStepper(EventStepper):
    """Event-driven steps; see ``Stepper`` for the interface.

    What follows in Python runs on machines without a compiler; ``native/dry.c`` is its twin.
    """

    def __init__(
        self, plant: Plant, choice: Choice, backend: str, control: CompiledControl | None = None
    ) -> None:
        assert plant.reaction is not None
        super().__init__(plant, choice, backend, control, [plant.reaction], _driver)
        check_kernel(plant, self.kernel)
        self._rhs = self.kernel.call("rhs")
        self._reaction = self.kernel.call("reaction")
        self._level = plant.model.friction.level
        self._sticky = self._level > 0.0

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
        v = self._velocity(x)
        direction = np.where(self._sticky, np.sign(v), 1.0)
        resting = self._sticky & (v == 0.0)
        if not resting.any():
            return direction
        for pivot in range(LEAST_INDEX_FROM * self._n + 2 ** min(self._n, 12)):
            p = self._with(direction)
            load = self._reaction(x[: self._n], x[self._n :], u, p)[0]
            a = self._velocity(self._rhs(x, u, p)[0])
            stuck = direction == 0.0
            excess = np.where(stuck, (abs(load) - self._level) / self._level.max(), -direction * a)
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

            def wrong(t: float, x: Array = x, direction: Array = direction) -> float:
                return self._wrong_after(x, u, t, direction)

            calm = wrong(left) <= 0.0
            length = left if calm else first_positive(wrong, left)
            after = self._flow.over(x, u, self._with(direction), length)
            if after is None:
                return None
            rested = self._rest(after, direction)
            left -= length
            if rested is None or calm or left <= 0.0:
                return rested
            x = rested
        return None

    def _wrong_after(self, x: Array, u: Array, t: float, direction: Array) -> float:
        """How wrong it is after ``t``."""
        after = self._flow.tried(x, u, self._with(direction), t)
        return np.inf if after is None else self._wrong(after, u, direction)

    def _rest(self, x: Array, direction: Array) -> Array | None:
        """Put joints that have just reached zero speed, or passed it by rounding, at rest.

        None if one of them was still fast: the piece was no continuous motion.
        """
        v = self._velocity(x)
        stopped = self._sticky & (v * direction <= 0.0)
        if np.any(abs(v[stopped]) > AT_REST * (1.0 + abs(v).max())):
            return None
        v[stopped] = 0.0
        return x

    def _wrong(self, x: Array, u: Array, direction: Array) -> float:
        """Positive if a joint slides against its direction or sticks under too much load."""
        v = self._velocity(x)
        moving, stuck = self._sticky & (direction != 0.0), self._sticky & (direction == 0.0)
        turned = np.max(-v * direction, where=moving, initial=-np.inf) - ROUNDING * (
            1.0 + abs(v).max()
        )
        if not stuck.any():
            return float(turned)
        load = abs(self._reaction(x[: self._n], x[self._n :], u, self._with(direction))[0])
        return float(max(turned, np.max(load - self._level, where=stuck, initial=-np.inf)))

    def _velocity(self, x: Array) -> Array:
        return x[self._n : 2 * self._n]

    def _with(self, direction: Array) -> Array:
        return np.concatenate([self.p, direction])


def _driver(plant: Plant, choice: Choice, functions: list[ca.Function]) -> str:
    n = plant.model.n
    defines = {
        "STATIC": "{" + ", ".join(map(repr, plant.model.friction.level.tolist())) + "}",
        "EVENTS": str(EVENTS_PER_JOINT * n),
        "WORST_FIRST": str(LEAST_INDEX_FROM * n),
        "PIVOTS": str(LEAST_INDEX_FROM * n + 2 ** min(n, 12)),
        "ROUNDING": repr(ROUNDING),
        "AT_REST": repr(AT_REST),
    }
    return event_driver(plant, choice, functions, DRIVERS, defines)
