# SPDX-License-Identifier: Apache-2.0
"""Projection of state changes onto the motions that held joints and closed contacts allow.

A held joint that is given a small velocity stops at once; the reaction of its friction or stop
acts on the other joints as an impulse. That is the projection onto the motions that the modes
allow, along the forces that hold.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_sim.plant.plant import Plant
from arm_sim.plant.slopes import jacobian_by
from arm_sim.stepping.events import Modes


class RestProjection:
    """RestProjection in a scene with events.

    Args:
        plant: The scene's equations.
        tuned: Places in p of the quantities to differentiate by.
    """

    def __init__(self, plant: Plant, tuned: Sequence[int] = ()) -> None:
        self._plant, self._tuned = plant, tuned
        n, modes = plant.model.n, plant.rhs.numel_in(2)
        x, p, change = ca.MX.sym("x", 2 * n), ca.MX.sym("p", modes), ca.MX.sym("change", n)
        struck = plant.strike(x, p, change, ca.MX(3 * len(plant.points), 1))[0]
        self._gain = ca.Function("gain", [x, p, change], [ca.jacobian(struck, change)])
        if contact := plant.contact:
            settled = contact.settle(x, p)
            self._settled = ca.Function("settled", [x, p], [ca.jacobian(settled, x)])
            before = ca.MX.sym("before", 2 * n)
            place = ca.reshape(contact.geometry(before)[0], 3, -1)
            found = x
            for _ in range(2):
                found = contact.close(found, p, ca.vec(place[1:, :]))
            slopes = [
                *(ca.jacobian(found, by) for by in (x, before)),
                jacobian_by(found, p, tuned),
            ]
            self._closed = ca.Function("closed", [x, p, before], slopes)
        self._loads = next(f for f in plant.events if f.name() == "loads")

    def begun(self, x: Array, u: Array, modes: Modes, slope: Array) -> Array:
        """Derivative of a state in which motion begins, with held joints at rest.

        Args:
            x: The state, shape (nx,).
            u: Command that acts, shape (n,).
            modes: Modes of joints and contacts from there on.
            slope: Derivative of the state before the projection, shape (nx, …).
        """
        n, slope = self._plant.model.n, slope.copy()
        q, v, whole = slice(n), slice(n, 2 * n), slice(2 * n)
        held = np.flatnonzero(modes.direction == 0.0)
        if len(held):
            gain = np.array(self._gain(x[whole], modes.p, np.zeros(n)))
            slope[v] -= gain[:, held] @ slope[n + held]
            back = held[self._leans(x, u, modes)[held]]
            slope[q] -= gain[:, back] @ slope[back]
        if self._plant.contact and (modes.contact["closed"] > 0.0).any():
            slope[v] = np.array(self._settled(x[whole], modes.p)) @ slope[whole]
        return slope

    def _leans(self, x: Array, u: Array, modes: Modes) -> NDArray[np.bool_]:
        """Joints at rigid stops that friction alone would not hold there."""
        n = self._plant.model.n
        q, (lower, upper) = x[:n], self._plant.model.stops.bounds
        load = np.array(self._loads(x, u, modes.p)[0]).ravel()
        push = np.where(q <= lower, -load, np.where(q >= upper, load, 0.0))
        leans: NDArray[np.bool_] = push > self._plant.model.friction.level
        return leans

    def closed(self, begin: Array, end: Array, modes: Modes, slope: Array, begun: Array) -> Array:
        """Derivative of the end of a segment, projected onto closed contacts and anchors.

        Args:
            begin: State at its beginning, shape (nx,).
            end: State that the step of the method has reached.
            modes: Modes of joints and contacts.
            slope: Derivative of the end before the projection, shape (nx, …).
            begun: Derivative of the beginning.
        """
        if not (self._plant.contact and (modes.contact["closed"] > 0.0).any()):
            return slope
        whole = slice(2 * self._plant.model.n)
        by_end, by_begin, by_p = (
            np.array(found) for found in self._closed(end[whole], modes.p, begin[whole])
        )
        slope = slope.copy()
        slope[whole] = by_end @ slope[whole] + by_begin @ begun[whole]
        slope[whole, slope.shape[1] - len(self._tuned) :] += by_p
        return slope
