# SPDX-License-Identifier: Apache-2.0
"""The effect of events on the derivatives of a motion; see ``linearization``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.one_at_a_time import built_once
from arm_dynamics.equations.contact import AT_REST
from arm_sim.derivatives.guards import INSTANT, Guards
from arm_sim.derivatives.impact import ImpactDerivative
from arm_sim.derivatives.rest_projection import RestProjection
from arm_sim.derivatives.resting import Resting
from arm_sim.derivatives.sliding_direction import SlidingDirection
from arm_sim.exceptions import NotDifferentiable
from arm_sim.integrators.selection import Choice
from arm_sim.plant.plant import Plant
from arm_sim.stepping.events import Modes

# Derivatives of instants that differ by less than this fraction belong to the same instant.
SAME = 1e-9


@dataclass
class MotionSlope:
    """A motion and its derivatives by the state x at its beginning and by what is held, w.

    w is the command u followed by the parameters to differentiate by, nw numbers.

    Attributes:
        x: State, shape (nx,).
        slope: Its derivative by (x, w), shape (nx, nx + nw).
        delay: Derivative of the elapsed time, shape (nx + nw,).
    """

    x: Array
    slope: Array
    delay: Array


class Events:
    """Effect of events on the derivatives of a motion.

    Args:
        plant: Equations of a scene with events.
        choice: Method, tick and tolerance.
        tuned: Places in p of the quantities to differentiate by.
    """

    def __init__(self, plant: Plant, choice: Choice, tuned: Sequence[int]) -> None:
        self._plant, self._h, self._tuned = plant, choice.dt, tuned
        self._guards, self._rest_projection = Guards(plant, tuned), RestProjection(plant, tuned)
        self._resting = Resting(plant)

    @built_once
    def _impact(self) -> ImpactDerivative:
        return ImpactDerivative(self._plant, self._tuned)

    @built_once
    def _sliding_direction(self) -> SlidingDirection:
        return SlidingDirection(self._plant, self._tuned)

    def check_ends(self, segments: np.ndarray, u: Array, begins: bool) -> None:
        """Refuse a tick that begins or ends with an event, or on the boundary of a mode.

        ``begins``: whether the state at its beginning is varied, see ``Resting``.
        """
        first, last = segments[0], segments[-1]
        if first["hit"]:
            raise NotDifferentiable("linearize: the tick begins with an impact")
        for segment, state, where in ((first, "begin", "beginning"), (last, "end", "end")):
            if zero := self._boundaries(segment, segment[state], u):
                raise NotDifferentiable(
                    f"linearize: {self._names(zero)} is on the boundary between two modes at the "
                    f"{where} of the tick"
                )
        if why := self._resting.reason(first["begin"], u, self._modes(first), begins):
            raise NotDifferentiable(f"linearize: {why}")
        if self._plant.points:
            for segment, following in zip(segments, [*segments[1:], None], strict=True):
                self._check_sliding(segment, following, u)

    def begun(self, segment: np.void, u: Array, slope: Array) -> Array:
        """Derivative of the state with which a segment begins, after its impact."""
        if segment["hit"]:
            n = self._plant.model.n
            by_x, by_p = np.hsplit(self._impact.slope(segment), [2 * n])
            after = by_x @ slope[: 2 * n]
            after[:, slope.shape[1] - len(self._tuned) :] += by_p
            slope = slope.copy()
            slope[n : 2 * n] = after
        return self._rest_projection.begun(segment["begin"], u, self._modes(segment), slope)

    def closed(self, segment: np.void, x: Array, slope: Array, begin: Array) -> Array:
        """Derivative of the state at the end of a segment, back at closed contacts and anchors.

        Args:
            segment: The segment.
            x: State that the method's step has reached, shape (nx,).
            slope: Its derivative, shape (nx, nx + nw).
            begin: That of the state at the beginning, likewise.
        """
        return self._rest_projection.closed(
            segment["begin"], x, self._modes(segment), slope, begin
        )

    def part(self, segment: np.void, u: Array, slope: Array) -> Array:
        """Derivative of the length of a segment that no event ends, though the tick continues."""
        x, length = segment["begin"], float(segment["length"])
        return self._sliding_direction.delay(x, u, self._modes(segment), slope, length)

    def delay(self, segment: np.void, u: Array, slope: Array, speed: Array) -> Array:
        """Derivative of the length of a segment that an event ends, shape (nx + nw,).

        Args:
            segment: The segment.
            u: Command that acts.
            slope: Derivative of its end at constant length, shape (nx, nx + nw).
            speed: Derivative of its end by the length, shape (nx,).
        """
        if segment["length"] <= INSTANT * self._h:
            raise NotDifferentiable(
                "linearize: two events occur at the same instant, or one at the start of the tick"
            )
        begin, end, modes, limit = (segment["begin"], segment["end"], self._modes(segment),
                                    segment["limit"])  # fmt: skip
        zero = self._zero(segment, end, u)
        if not zero or any(self._guards.grazes(i, begin, end, u, modes, limit) for i in zero):
            what = f"{self._names(zero)} is grazed" if zero else (
                "an event is grazed, or joints and contacts that held together let go"
            )  # fmt: skip
            raise NotDifferentiable(f"linearize: {what}")
        delays = []
        for guard in zero:
            by_x, by_w = self._guards.slopes(guard, end, u, modes, limit)
            moved = by_x @ slope
            moved[len(by_x) :] += by_w
            delays.append(-moved / (by_x @ speed))
        # Joints of a loop come to rest together: that is one event.
        if np.ptp(delays, axis=0).max() > SAME * np.abs(delays).max():
            raise NotDifferentiable(f"linearize: {self._names(zero)}: events at the same instant")
        delay: Array = delays[0]
        return delay

    def _zero(self, segment: np.void, x: Array, u: Array) -> list[int]:
        return self._guards.zero(x, u, self._modes(segment), segment["limit"], self._h)

    def _boundaries(self, segment: np.void, x: Array, u: Array) -> list[int]:
        modes, limit = self._modes(segment), segment["limit"]
        return self._guards.boundaries(x, u, modes, limit, self._h)

    def _modes(self, segment: np.void) -> Modes:
        modes = Modes(self._plant, self._plant.parameters.nominal)
        modes.p[:] = segment["p"]
        return modes

    def _names(self, guards: Sequence[int]) -> str:
        return ", ".join(self._guards.names[i] for i in guards)

    def _check_sliding(self, segment: np.void, following: np.void | None, u: Array) -> None:
        """Refuse a contact at an instant where its direction of sliding is not differentiable.

        That is one which starts to slide, or comes to rest without turning: there a small lateral
        force changes the direction arbitrarily fast.
        """
        modes, n = self._modes(segment), self._plant.model.n
        sticks = self._modes(segment if following is None else following).contact["sticks"]
        speeds = np.array(self._plant.contact.geometry(segment["end"][: 2 * n])[1])  # type: ignore[union-attr]
        for k, point in enumerate(self._plant.points):
            contact = modes.contact[k]
            slides = contact["closed"] and not contact["sticks"] and point.friction > 0.0
            rests = sticks[k] and np.hypot(*speeds[3 * k + 1 : 3 * k + 3, 0]) <= AT_REST
            if not (slides and (contact["fixed"] or rests)):
                continue
            if self._sliding_direction.can_turn(segment["begin"], u, modes, k):
                what = "comes to rest in a straight line" if rests else "starts to slide"
                raise NotDifferentiable(
                    f"linearize: contact '{point.name}' {what}, where its direction of sliding is "
                    "not differentiable"
                )
