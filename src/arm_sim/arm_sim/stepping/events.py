# SPDX-License-Identifier: Apache-2.0
"""What the compiled engine shares with Python where joints stick or points touch.

The logic of events itself, the choice of modes, impacts and the search for the instants, stands in
``native/``.
"""

from __future__ import annotations

import ctypes
from enum import IntEnum

import numpy as np

from arm_dynamics.arrays import Array
from arm_sim.plant.plant import Plant

CONTACT_MODE = np.dtype(
    [("closed", float), ("sticks", float), ("along", float, (2,)), ("fixed", float)]
)
"""What a contact does, as ``contact_mode_t`` in ``native/modes.c`` says."""


class Trouble(IntEnum):
    """Why a tick could not be computed; ``enum trouble`` in ``native/modes.c``."""

    NONE = 0
    NUMBERS = 1
    UNDETERMINED = 2
    INSIDE = 3
    STOP = 4  # without compiled code


class EventReport(ctypes.Structure):
    """What adds up over ticks; ``report_t`` in ``native/modes.c``.

    Attributes:
        impact_loss: Energy lost in impacts in [J].
        impacts: How many there were.
        trouble: Why the last tick failed, see ``Trouble``.
        time_stepped: In how many ticks events piled up.
    """

    _fields_ = [
        ("impact_loss", ctypes.c_double),
        ("impacts", ctypes.c_longlong),
        ("trouble", ctypes.c_longlong),
        ("time_stepped", ctypes.c_longlong),
    ]

    def restart(self) -> None:
        """Start afresh, as after a reset."""
        self.impact_loss, self.impacts, self.trouble, self.time_stepped = 0.0, 0, 0, 0


class Modes:
    """The vector p of a plant's functions with names: what every joint and contact does.

    Attributes:
        p: The vector, shape (np,) with all that follows the tunable numbers.
        tunable: Its tunable numbers, a view.
        direction: Of joints, -1 and 1 slide, 0 sticks or is held by a rigid stop; a view, empty
            without dry friction and rigid stops.
        pressed: Of joints, -1 and 1 lean on the lower or upper compliant stop, else 0; a view,
            empty without compliant stops.
        contact: Of contacts, a view of fields ``closed``, ``sticks``, ``along`` and ``fixed``.
    """

    def __init__(self, plant: Plant, tunable: Array) -> None:
        """Take over tunable numbers; every joint and contact is still to be determined."""
        layout = np.dtype(
            [
                ("tunable", float, (len(tunable),)),
                ("direction", float, (plant.directions,)),
                ("pressed", float, (plant.pressed,)),
                ("contact", CONTACT_MODE, (len(plant.points),)),
            ]
        )
        record = np.zeros(1, dtype=layout)
        self.p: Array = record.view(float).reshape(-1) if layout.itemsize else np.zeros(0)
        self.tunable: Array = record["tunable"][0]
        self.direction: Array = record["direction"][0]
        self.pressed: Array = record["pressed"][0]
        self.contact = record["contact"][0]
        self.tunable[:] = tunable
