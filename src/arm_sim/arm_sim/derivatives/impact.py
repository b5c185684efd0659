# SPDX-License-Identifier: Apache-2.0
"""Derivative of an impact: velocities after it by positions and velocities before it.

Which joints and contacts take part, rebound, stick or slide does not change; the impulses follow
from Newton's law in the normal direction and Coulomb's law in the tangential ones, and their
derivatives from the implicit function theorem. Payloads change them through the masses.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.equations.contact import AT_REST
from arm_sim.exceptions import NotDifferentiable
from arm_sim.plant.plant import Plant
from arm_sim.plant.slopes import jacobian_by

# Relative distance to the friction cone below which an impulse is on its boundary.
EDGE = 1e-9


class ImpactDerivative:
    """Impacts of a scene with events.

    Args:
        plant: The scene's equations.
        tuned: Places in p of the quantities to differentiate by.
    """

    def __init__(self, plant: Plant, tuned: Sequence[int] = ()) -> None:
        self._plant = plant
        n, nc = plant.model.n, len(plant.points)
        modes = plant.rhs.numel_in(2)
        x, p, e, f, carries, sticks, r = (
            ca.MX.sym(name, size)
            for name, size in (
                ("x", 2 * n), ("p", modes), ("e", n), ("f", nc),
                ("carries", nc), ("sticks", nc), ("r", 3 * nc),
            )
        )  # fmt: skip
        place = len(plant.parameters.nominal)
        meets = 1 - p[place : place + n] if plant.directions else ca.MX(n, 1)
        v = x[n:]
        after = plant.strike(x, p, -meets * (1 + e) * v, r)[0]
        law = speed = ca.MX(0, 1)
        if plant.contact:
            met, speed = (plant.contact.geometry(ca.vertcat(x[:n], w))[1] for w in (v, after))
            law = _laws(plant, met, speed, f, (carries, sticks), r)
        slopes = list[ca.MX]()
        for y in (after, law):
            slopes.append(ca.horzcat(ca.jacobian(y, x), jacobian_by(y, p, tuned)))
            slopes.append(ca.jacobian(y, r))
        arguments = [x, p, e, f, carries, sticks, r]
        self._slopes = ca.Function("blow", arguments, slopes, {"cse": True})
        self._speeds = ca.Function("speeds", [x, p, e, r], [after, speed])

    def slope(self, record: np.void) -> Array:
        """Derivative of the velocities after an impact by (q, v) before it and the parameters.

        Args:
            record: The segment that begins with the impact, see ``segment_type``.

        Returns:
            Shape (n, 2n + nt).

        Raises:
            NotDifferentiable: If the impact has no derivative.
        """
        n, nc = self._plant.model.n, len(self._plant.points)
        if record["part"] < 1.0:
            raise NotDifferentiable(
                "linearize: the restitution of an impact is reduced so that it adds no energy"
            )
        x, p, r = record["before"][: 2 * n], record["p"].copy(), record["impulse"]
        place = len(self._plant.parameters.nominal)
        p[place : place + len(record["meets"])] = record["meets"]
        v = x[n:]
        e = np.divide(-record["leaves"], v, out=np.zeros(n), where=record["leaves"] != 0.0)
        met = np.zeros(3 * nc)
        if nc:
            met = np.array(self._plant.contact.geometry(x)[1]).ravel()  # type: ignore[union-attr]
        f = np.divide(
            record["rebound"], -met[::3], out=np.zeros(nc), where=record["rebound"] > 0.0
        )
        carries, sticks = self._parts(x, p, e, r)
        after_x, after_r, law_x, law_r = (
            np.array(slope) for slope in self._slopes(x, p, e, f, carries, sticks, r)
        )
        moved: Array = np.linalg.lstsq(law_r, law_x, rcond=None)[0] if nc else law_x
        slope: Array = after_x - after_r @ moved
        return slope

    def _parts(self, x: Array, p: Array, e: Array, r: Array) -> tuple[Array, Array]:
        """1 for contacts that carry an impulse, and for those of them that stick."""
        _, speed = (np.array(value).ravel() for value in self._speeds(x, p, e, r))
        normal = r[::3]
        friction = np.array([point.friction for point in self._plant.points])
        size, slip = np.hypot(r[1::3], r[2::3]), np.hypot(speed[1::3], speed[2::3])
        carries = normal > 0.0
        sticks = carries & (size < (1.0 - EDGE) * friction * normal)
        edge = carries & ~sticks & (slip <= AT_REST) & (friction > 0.0)
        if edge.any():
            name = self._plant.points[int(np.flatnonzero(edge)[0])].name
            raise NotDifferentiable(
                f"linearize: the impact at contact '{name}' is on the boundary of stick and slip"
            )
        return carries.astype(float), sticks.astype(float)


def _laws(
    plant: Plant, met: ca.MX, speed: ca.MX, f: ca.MX, modes: tuple[ca.MX, ca.MX], r: ca.MX
) -> ca.MX:
    """What is zero in an impact of all contacts, see ``_law``, by velocities before and after."""
    laws: list[ca.MX] = []
    for k, point in enumerate(plant.points):
        here = slice(3 * k, 3 * k + 3)
        obeyed = speed[here.start] + f[k] * met[here.start]
        carries, sticks = (mode[k] for mode in modes)
        laws += _law(speed[here], r[here], obeyed, (carries, sticks), point.friction)
    return ca.vertcat(*laws)


def _law(
    speed: ca.MX, r: ca.MX, obeyed: ca.MX, modes: tuple[ca.MX, ca.MX], friction: float
) -> tuple[ca.MX, ca.MX]:
    """What is zero in an impact of a contact, along the normal and the tangents.

    Args:
        speed: Its velocity afterwards, shape (3,).
        r: Its impulse, likewise.
        obeyed: Zero by the law of restitution.
        modes: Whether it carries a load, and sticks.
        friction: Its coefficient.
    """
    carries, sticks = modes
    slides = r[1:]
    if friction > 0.0:
        s = speed[1:]
        slides = slides + friction * r[0] * s / ca.norm_2(s)
    moves = ca.if_else(sticks > 0, speed[1:], slides)
    return ca.if_else(carries > 0, obeyed, r[0]), ca.if_else(carries > 0, moves, r[1:])
