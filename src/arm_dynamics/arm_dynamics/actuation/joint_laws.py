# SPDX-License-Identifier: Apache-2.0
"""The models with internal states, or that replace the command, which a scene uses."""

from arm_dynamics.actuation.drives import Drives
from arm_dynamics.actuation.internal_state import FrictionLaw, StatefulLaw
from arm_dynamics.actuation.lugre_joints import LugreFriction
from arm_dynamics.model.arm import ArmModel

# Friction models with states; each applies to the joints with its key in the scene
FRICTION: tuple[type[FrictionLaw], ...] = (LugreFriction,)


def laws_of(model: ArmModel) -> tuple[StatefulLaw, ...]:
    """The models of a scene, in the order of their states; empty if it uses none."""
    passive = all(drive is None or drive.passes_torque for drive in model.drives)
    return (*(() if passive else (Drives(model),)), *friction_laws(model))


def friction_laws(model: ArmModel) -> tuple[FrictionLaw, ...]:
    """The friction models of a scene.

    Raises:
        SceneError: If the coefficients of a model contradict one another.
    """
    laws = (kind.of(model) for kind in FRICTION)
    return tuple(law for law in laws if law is not None)
