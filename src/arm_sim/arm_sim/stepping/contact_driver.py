# SPDX-License-Identifier: Apache-2.0
"""What the C driver of contacts is told, and what it remembers."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable

import casadi as ca

from arm_dynamics.equations.contact import AT_REST
from arm_sim.integrators.selection import Choice
from arm_sim.plant.plant import Plant
from arm_sim.stepping import contact_cone as cone
from arm_sim.stepping import contact_impact as impact
from arm_sim.stepping import contact_modes as modes
from arm_sim.stepping import contact_newton as newton
from arm_sim.stepping import contact_pieces as pieces
from arm_sim.stepping import dry_friction as dry
from arm_sim.stepping.events import event_driver

# A tick with more events than this is not a motion any more.
EVENTS = 5_000
# How deep inside a plane in [m] a state may be and still be taken for touching it.
INSIDE = 1e-9

DRIVERS = (
    "cone.c",
    "cones.c",
    "contact_modes.c",
    "events.c",
    "contact_impact.c",
    "contact_pieces.c",
    "contact_slow.c",
    "contact.c",
)
"""Parts of the C driver, in their order."""

NUMBERS = {
    "SETTLED": cone.SETTLED,
    "DAMPING": cone.DAMPING,
    "SOLVED": newton.SOLVED,
    "REGULAR": newton.REGULAR,
    "GAP_ROUNDING": modes.GAP_ROUNDING,
    "HOP": modes.HOP,
    "SPEED_ROUNDING": modes.SPEED_ROUNDING,
    "AT_REST": AT_REST,
    "LEAST_REBOUND": modes.LEAST_REBOUND,
    "SLACK": modes.SLACK,
    "EDGE": modes.EDGE,
    "ROUNDING": dry.ROUNDING,
    "SUDDEN_STOP": dry.AT_REST,
    "SINKING": pieces.SINKING,
    "DEEP": INSIDE,
    "HELD": pieces.HELD,
    "MUCH_TURN": pieces.MUCH_TURN,
    "INDEPENDENT": pieces.INDEPENDENT,
}
"""Tolerances that the C driver shares with its twin in Python."""


class ContactMemory(ctypes.Structure):
    """What adds up over ticks; shared with the C driver.

    Attributes:
        loss: Energy lost in impacts in [J].
        friction: Energy lost to friction of contacts in [J]; added up only on ``audit``.
        impacts: How many there were.
        audit: Whether to add up the work of friction, at half a step's work more for each piece.
        trouble: Why the last tick failed, see ``Trouble``.
    """

    _fields_ = [
        ("loss", ctypes.c_double),
        ("friction", ctypes.c_double),
        ("impacts", ctypes.c_longlong),
        ("audit", ctypes.c_longlong),
        ("trouble", ctypes.c_longlong),
    ]

    def restart(self) -> None:
        """Start afresh, as after a reset."""
        self.loss, self.friction, self.impacts, self.trouble = 0.0, 0.0, 0, 0


def contact_driver(plant: Plant, choice: Choice, functions: list[ca.Function]) -> str:
    """C source that steps a scene with contacts.

    Args:
        plant: The scene's equations.
        choice: Method, tick and tolerance.
        functions: Those that it calls.

    Returns:
        Source to be compiled with them.
    """
    defines = {**_scene(plant), **{name: repr(value) for name, value in NUMBERS.items()}}
    return event_driver(plant, choice, functions, DRIVERS, defines)


def _scene(plant: Plant) -> dict[str, str]:
    """Sizes and coefficients of a scene, and how often at most something is tried in it."""
    assert plant.contact is not None
    model, points = plant.model, plant.contact.points
    return {
        "NC": str(len(points)),
        "ND": str(model.n if model.has_dry_friction else 0),
        "STATIC": _braces(model.friction.level),
        "FRICTION": _braces(point.friction for point in points),
        "RESTITUTION": _braces(point.restitution for point in points),
        "PIVOTS": str(modes.PIVOTS * (len(points) + model.n)),
        "SWEEPS": str(cone.SWEEPS[0]),
        "MORE_SWEEPS": str(cone.SWEEPS[1]),
        "CONTINUED": str(cone.CONTINUED),
        "STEPS": str(newton.STEPS),
        "HALVED": str(newton.HALVED),
        "SAMPLES": str(cone.SAMPLES),
        "ROOT_STEPS": str(cone.ROOT_STEPS),
        "MOST_REBOUNDS": str(impact.MOST_REBOUNDS),
        "HALVINGS": str(impact.HALVINGS),
        "MOST_EVENTS": str(EVENTS),
        "MOST_PARTS": str(pieces.MOST_PARTS),
    }


def _braces(values: Iterable[float]) -> str:
    return "{" + ", ".join(repr(float(value)) for value in values) + "}"
