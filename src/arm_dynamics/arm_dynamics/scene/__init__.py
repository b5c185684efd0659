# SPDX-License-Identifier: Apache-2.0
"""The scene: one description of the physics, read from YAML or URDF and checked.

Depends on neither Pinocchio nor CasADi, so commands that only read a scene start at once.
"""

import pydantic

from arm_dynamics.exceptions import ArmError

if tuple(map(int, pydantic.VERSION.split(".")[:2])) < (2, 6):  # before anything needs it
    raise ArmError(
        f"pydantic {pydantic.VERSION} of '{pydantic.__file__}' is too old; 2.6 or newer is "
        "expected: pip install 'pydantic>=2.6' (in a workspace on Ubuntu 24.04 with --target "
        "install/arm_dynamics/lib/python3.12/site-packages)"
    )

from arm_dynamics.scene.constraint import Constraint, Contact
from arm_dynamics.scene.files import ready_scenes
from arm_dynamics.scene.friction import Friction, Lugre
from arm_dynamics.scene.imperfections import Commands, Sensors
from arm_dynamics.scene.load import load_scene
from arm_dynamics.scene.schema import Initial, Joint, Limits, Payload, Scene, Sim, validated
from arm_dynamics.scene.spring import PointSpring

__all__ = [
    "Commands", "Constraint", "Contact", "Friction", "Initial", "Joint", "Limits", "Lugre",
    "Payload", "PointSpring", "Scene", "Sensors", "Sim", "load_scene", "ready_scenes", "validated",
]  # fmt: skip
