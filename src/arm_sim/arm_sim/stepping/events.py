# SPDX-License-Identifier: Apache-2.0
"""Data that the compiled engine shares with Python in scenes with friction or contacts.

The logic of events, the choice of modes, impacts and the search for the instants, is in
``native/``.
"""

import ctypes
from enum import IntEnum
from pathlib import Path

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.compiler import HOW_TO_GET_CODE
from arm_dynamics.codegen.header import Header
from arm_sim.plant.plant import Plant

_NATIVE = Path(__file__).with_name("native")
_ENGINE = Header(_NATIVE / "motion/report.h")


class Trouble(IntEnum):
    """Why a tick could not be computed; ``enum trouble`` in ``native/motion/report.h``."""

    NONE = _ENGINE.constants["NONE"]
    NUMBERS = _ENGINE.constants["NUMBERS"]
    UNDETERMINED = _ENGINE.constants["UNDETERMINED"]
    INSIDE = _ENGINE.constants["INSIDE"]
    STOP = len(_ENGINE.constants)  # without compiled code


# Why contacts or stops make ticks fail, as the ends of messages
TROUBLE_REASONS = {
    Trouble.UNDETERMINED: (
        "; no motion of its contacts satisfies all laws: friction closes a sliding contact faster "
        "than the normal force opens it (Painlevé's paradox), or contacts jam"
    ),
    Trouble.INSIDE: "; a contact point is inside its plane",
    Trouble.STOP: (
        f"; a joint reaches its stop, and events need compiled code: {HOW_TO_GET_CODE}; "
        "'limits.stop: false' removes a stop"
    ),
}


class EventReport(ctypes.Structure):
    """Sums over ticks: ``report_t`` of ``report.h``, where the fields are explained."""

    _fields_ = _ENGINE.fields("report_t")

    def restart(self) -> None:
        """Start afresh, as after a reset."""
        self.impact_loss, self.impacts, self.trouble, self.time_stepped = 0.0, 0, 0, 0


def trouble_message(report: EventReport) -> str:
    """Why contacts or stops made a tick fail, as the end of a message; empty if they did not."""
    return TROUBLE_REASONS.get(Trouble(report.trouble), "")


def array_lengths(plant: Plant) -> dict[str, int]:
    """Lengths of the engine's arrays, by their names in ``native/``."""
    n, contacts = plant.model.n, len(plant.points)
    return {
        "NX": plant.nx, "NU": n, "NP": len(plant.parameters.nominal), "NC": contacts,
        "ND": plant.layout.directions, "NQ": plant.layout.pressed, "NK": plant.layout.switches,
    }  # fmt: skip


_CONTACT_MODE = np.dtype(
    Header(_NATIVE / "modes/mode_vector.h", only="contact_mode_t").structure("contact_mode_t")
)


class Modes:
    """The vector p of a plant's functions by name: parameters and modes of joints and contacts.

    Attributes:
        p: The vector, shape (np,): tunable numbers, then the modes.
        tunable: Its tunable numbers, a view.
        direction: Of joints, -1 and 1 slide, 0 sticks or is held by a rigid stop; a view, empty
            without dry friction and rigid stops.
        pressed: Of joints, -1 and 1 lean on the lower or upper compliant stop, else 0; a view,
            empty without compliant stops.
        switches: Of drives and cords, 1 where a comparison holds, else 0; a view.
        contact: Of contacts, a view of fields ``closed``, ``sticks``, ``along`` and ``fixed``.
    """

    def __init__(self, plant: Plant, tunable: Array) -> None:
        """Copy the tunable numbers; the modes of joints and contacts are not determined yet."""
        length = array_lengths(plant)
        ends = np.cumsum([length[name] for name in ("NP", "ND", "NQ", "NK")])
        self.p: Array = np.zeros(ends[-1] + length["NC"] * _CONTACT_MODE.itemsize // 8)
        parts = np.split(self.p, ends)  # in the order of modes_t of native/modes/mode_vector.h
        self.tunable, self.direction, self.pressed, self.switches = parts[:4]
        self.contact = parts[4].view(_CONTACT_MODE)
        self.tunable[:] = tunable
