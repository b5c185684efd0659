# SPDX-License-Identifier: Apache-2.0
"""Which laws with states, or in place of the command, a scene asks for."""

from __future__ import annotations

from arm_dynamics.actuation.drives import Drives
from arm_dynamics.actuation.internal_state import StatefulLaw
from arm_dynamics.actuation.lugre_joints import LugreFriction
from arm_dynamics.model.arm import ArmModel


def laws_of(model: ArmModel) -> tuple[StatefulLaw, ...]:
    """The laws of a scene, in the order of their states; none if it asks for none."""
    passive = all(drive is None or drive.passes_torque for drive in model.drives)
    drives = None if passive else Drives(model)
    bristles = model.friction.bristles
    friction = LugreFriction(model, bristles) if bristles else None
    candidates: tuple[StatefulLaw | None, ...] = (drives, friction)
    return tuple(law for law in candidates if law is not None)
