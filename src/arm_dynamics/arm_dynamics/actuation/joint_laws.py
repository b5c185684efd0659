# SPDX-License-Identifier: Apache-2.0
"""Which laws with states, or in place of the command, a scene asks for."""

from __future__ import annotations

from arm_dynamics.actuation.drives import Drives
from arm_dynamics.actuation.internal_state import FrictionLaw, StatefulLaw
from arm_dynamics.actuation.lugre_joints import LugreFriction
from arm_dynamics.model.arm import ArmModel

FRICTION: tuple[type[FrictionLaw], ...] = (LugreFriction,)
"""Laws of friction with states; each takes the joints whose scene has its key."""


def laws_of(model: ArmModel) -> tuple[StatefulLaw, ...]:
    """The laws of a scene, in the order of their states; none if it asks for none."""
    passive = all(drive is None or drive.passes_torque for drive in model.drives)
    return (*(() if passive else (Drives(model),)), *friction_laws(model))


def friction_laws(model: ArmModel) -> tuple[FrictionLaw, ...]:
    """Those of them that are friction.

    Raises:
        SceneError: If the coefficients of a law do not go together.
    """
    found = (law.of(model) for law in FRICTION)
    return tuple(law for law in found if law is not None)
