# SPDX-License-Identifier: Apache-2.0
"""Ticks without events of a scene with events, for compiled code (``event_free_ticks.h``).

The modes are the same from beginning to end, so that the tick is a smooth step in which they are
constants, between two projections. What is differentiated here is at a distance from all
boundaries between modes; every other tick is left to ``EventfulTicks``, which decides what has a
derivative.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from arm_dynamics.equations.contact import Mode
from arm_sim.derivatives.guards import clearance
from arm_sim.derivatives.nonsmooth_points import NonsmoothPoints
from arm_sim.derivatives.rest_stability import is_unstable_at_rest
from arm_sim.derivatives.tangents.rest_projection import RestProjection
from arm_sim.plant.plant import Plant


@dataclass(frozen=True)
class EventFreeTick:
    """Functions of ticks without events.

    Attributes:
        functions: Functions of states: with contacts ``contact_geometry``; ``mode_margin``,
            ``mode_margin_in_motion``, ``begin_coefficients``, ``end_coefficients``.
        columns: Functions of columns, ``project_begin`` and ``project_end``.
    """

    functions: tuple[ca.Function, ...]
    columns: tuple[ca.Function, ...]

    @property
    def adjoints(self) -> tuple[ca.Function, ...]:
        """Transposed functions of columns.

        ``begin_adjoint`` (c, gradient) -> gradient, and ``end_adjoint`` (c, gradient) -> gradients
        by x at the beginning and x at the end.
        """
        adjoints = []
        for function, name in zip(self.columns, ("begin_adjoint", "end_adjoint"), strict=True):
            c, *changes = function.sx_in()
            weight = ca.SX.sym("weight", function.size1_out(0))
            change = function(c, *changes)
            gradients = [ca.densify(ca.jtimes(change, by, weight, True)) for by in changes]
            adjoints.append(ca.Function(name, [c, weight], gradients, {"cse": True}))
        return tuple(adjoints)

    @classmethod
    def of(cls, plant: Plant) -> EventFreeTick:
        """The functions of a plant with events."""
        rest = RestProjection(plant)
        kinds = ("mode_margin", True), ("mode_margin_in_motion", False)
        margins = (_margins(plant, *kind) for kind in kinds)
        geometry = [plant.events["contact_geometry"]] if plant.mechanics.contact else []
        functions = (*geometry, *margins, rest.begin_coefficients, rest.end_coefficients)
        return cls(functions, (rest.project_begin, rest.project_end))

    @property
    def members(self) -> dict[str, int]:
        """Members of the compiled scene: numbers of coefficients."""
        begin, end = self.functions[-2:]
        return {"nbegin": begin.size1_out(0), "nend": end.size1_out(0)}


def _margins(plant: Plant, name: str, may_hold: bool) -> ca.Function:
    """(x, u, p, limit) -> margin to boundaries between modes, and at the start of a motion.

    Both are negative where a tick may be refused because of ``NonsmoothPoints``, of a joint or
    contact at rest, or of the direction of a sliding contact.
    """
    clear = clearance(plant, may_hold)
    x, u, p, limit = (ca.SX.sym(name, clear.size1_in(i)) for i, name in enumerate("xupl"))
    margin, margins = clear(x, u, p, limit), list[ca.SX]()
    for is_first in (False, True):
        doubt = NonsmoothPoints(plant).kink_at_rest(x)
        if may_hold:
            unstable = is_unstable_at_rest(plant, p, is_first)
            unstable = ca.logic_or(_starts_to_slide(plant, p), unstable)
            doubt = ca.logic_or(doubt, unstable)
        margins.append(ca.if_else(doubt, -1, margin))
    return ca.Function(name, [x, u, p, limit], [ca.vertcat(*margins)], {"cse": True})


def _starts_to_slide(plant: Plant, p: ca.SX) -> ca.SX:
    """1 where a contact starts to slide under the modes in p, and keeps its direction, else 0."""
    mode, starts = Mode.of(plant.layout.parts(p)[-1]), ca.SX(0)
    for k, point in enumerate(plant.points):
        if point.friction > 0.0:
            starts = ca.logic_or(starts, mode.closed[k] * (1 - mode.sticks[k]) * mode.fixed[k])
    return starts
