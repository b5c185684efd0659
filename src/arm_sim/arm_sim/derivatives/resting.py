# SPDX-License-Identifier: Apache-2.0
"""Whether joints and contacts at rest would come to rest again after the smallest push.

Where static friction exceeds sliding friction, a joint may be held under a load that keeps it
going once it moves: the state after a tick then jumps with the velocity before it. Where friction
vanishes, as in a lossy gear without load, a joint is held by nothing.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.equations.contact import Mode
from arm_dynamics.model import ConstraintRows
from arm_sim.plant.placing import holding
from arm_sim.plant.plant import Plant
from arm_sim.stepping.events import Modes

# Load relative to the sliding level, and deceleration in [rad/s²] or [m/s²], that are rounding.
ROUNDING, NOTHING = 1e-12, 1e-12


def may_go_on(plant: Plant, p: ca.SX, begins: bool) -> ca.SX:
    """Whether ``Resting`` may give a reason under the modes in p: 1 if so, 0 if it does not.

    A joint alone whose friction is the same at rest and as it begins to slide comes to rest again,
    whatever its load. Once it has, it is held by friction that does not vanish.
    """
    friction, points = plant.model.friction, plant.points
    coulomb, excess, static = friction.coulomb, friction.excess, friction.static
    least = coulomb.mean + excess.mean - abs(coulomb.skew + excess.skew)
    doubtful = (friction.efficiency < 1.0) | (least <= 0.0)
    if begins:
        falls = [a + b != c for a, b, c in zip(coulomb, excess, static, strict=True)]
        doubtful = doubtful | plant.constrained | falls[0] | falls[1]
    _, direction, *_, contacts = plant.parts(p)
    mode, doubt = Mode.of(contacts), ca.SX(0)
    closed = ca.sum1(mode.closed) > 0
    for joint in np.flatnonzero(friction.level > 0.0) if plant.directions else ():
        together = closed if begins else False
        held = direction[int(joint)] == 0
        doubt = ca.logic_or(doubt, ca.logic_and(held, ca.logic_or(doubtful[joint], together)))
    for k, point in enumerate(points if begins else ()):
        if point.static_friction > point.friction > 0.0:
            doubt = ca.logic_or(doubt, mode.closed[k] * mode.sticks[k])
    return doubt


class Resting:
    """Rest of the joints and contacts of a scene.

    Args:
        plant: The scene's equations.
    """

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self._rows = ConstraintRows(plant.model) if plant.constrained else None
        self._loads = next(f for f in plant.events if f.name() == "loads")
        if contact := plant.contact:
            x, p = ca.MX.sym("x", 2 * plant.model.n), ca.MX.sym("p", plant.rhs.numel_in(2))
            settled = ca.jacobian(contact.settle(x, p), x)[:, plant.model.n :]
            self._settled = ca.Function("settled", [x, p], [settled])

    def reason(self, x: Array, u: Array, modes: Modes, begins: bool) -> str:
        """Why a motion from rest has no derivative; empty if it has one.

        Args:
            x: State, shape (nx,).
            u: Command that acts, shape (n,).
            modes: Modes of joints and contacts.
            begins: Whether the state itself is varied; else what rests has come to rest before,
                and rests in all motions nearby.
        """
        model = self._plant.model
        held = np.zeros(model.n, dtype=bool)
        if len(modes.direction):
            held = (modes.direction == 0.0) & (model.friction.level > 0.0)
        for joint in np.flatnonzero(held).tolist():
            name, gains = model.joint_names[joint], self._gains(joint, x, u, modes, held)
            strength = sum(map(abs, gains.values()))
            if gains and strength <= NOTHING:
                return (
                    f"joint '{name}' is at rest without load, where its gear's friction vanishes"
                )
            if begins and any(gain >= -ROUNDING * strength for gain in gains.values()):
                return (
                    f"joint '{name}' is held at rest by a load between its sliding and its static "
                    "level: if it moved, it would go on"
                )
        return self._slipping(x, u, modes) if begins else ""

    def _gains(
        self, joint: int, x: Array, u: Array, modes: Modes, held: NDArray[np.bool_]
    ) -> dict[int, float]:
        """Acceleration of a joint that is pushed either way, positive if it goes on.

        A stop may leave one way; loops and contacts may leave none, or move other joints with it.
        """
        n, (lower, upper) = self._plant.model.n, self._plant.model.stops.bounds
        way = self._way(joint, x, modes, held)
        gains = dict[int, float]()
        if abs(way).max() <= ROUNDING:
            return gains
        moves = held & (abs(way) > ROUNDING * abs(way).max())
        for sign in (1, -1):
            blocked = (x[:n] <= lower) & (sign * way < 0.0) | (x[:n] >= upper) & (sign * way > 0.0)
            if (blocked & (abs(way) > ROUNDING)).any():
                continue
            pushed = Modes(self._plant, modes.tunable)
            pushed.p[:] = modes.p
            pushed.direction[moves] = np.sign(sign * way[moves])
            a = np.array(self._plant.rhs(x, u, pushed.p)).ravel()[n : 2 * n]
            gains[sign] = float(sign * (a @ way) / (way @ way))
        return gains

    def _way(self, joint: int, x: Array, modes: Modes, held: NDArray[np.bool_]) -> Array:
        """Velocities after a push of a joint, without friction of those that are held."""
        n, plant = self._plant.model.n, self._plant
        way: Array = np.eye(n)[joint]
        if plant.contact and (modes.contact["closed"] > 0.0).any():
            loose = Modes(plant, modes.tunable)
            loose.p[:] = modes.p
            loose.direction[held] = 1.0
            return np.array(self._settled(x[: 2 * n], loose.p)) @ way
        if self._rows:
            names = holding(plant, modes.tunable)
            A = self._rows.stacked(x[:n], np.zeros(n), names).jacobian
            way = way - np.linalg.pinv(A) @ (A @ way)
        return way

    def _slipping(self, x: Array, u: Array, modes: Modes) -> str:
        """The same of contacts whose static coefficient exceeds that of sliding."""
        force = np.array(self._loads(x, u, modes.p)[1]).reshape(-1, 3)
        for k, point in enumerate(self._plant.points):
            sticks = modes.contact[k]["closed"] and modes.contact[k]["sticks"]
            if not sticks or not point.static_friction > point.friction > 0.0:
                continue
            if np.hypot(*force[k, 1:]) >= (1.0 - ROUNDING) * point.friction * force[k, 0]:
                return (
                    f"contact '{point.name}' is held by a load between its sliding and its static "
                    "level: if it moved, it would go on"
                )
        return ""
