# SPDX-License-Identifier: Apache-2.0
"""What the equations of motion of a robot arm are: M(q) q̈ + C(q, q̇) q̇ + G(q) + F(q, q̇) = τ.

Names are looked up when they are first used: Pinocchio and CasADi take half a second to import,
and a command that only reads a scene, or only asks a running node, needs neither.
"""

from typing import TYPE_CHECKING

from arm_dynamics.exceptions import (
    ArmError,
    ConstraintError,
    InvalidInput,
    KernelError,
    ModelError,
    SceneError,
    Unreachable,
)
from arm_dynamics.lazy import on_demand

if TYPE_CHECKING:
    from arm_dynamics.dynamics.dynamics import Dynamics, Term
    from arm_dynamics.model.arm import ArmModel
    from arm_dynamics.scene.load import load_scene
    from arm_dynamics.scene.schema import Scene

__all__ = [
    "ArmError",
    "ArmModel",
    "ConstraintError",
    "Dynamics",
    "InvalidInput",
    "KernelError",
    "ModelError",
    "Scene",
    "SceneError",
    "Term",
    "Unreachable",
    "load_scene",
]
__getattr__, __dir__ = on_demand(
    __name__,
    {
        "Dynamics": "dynamics.dynamics",
        "Term": "dynamics.dynamics",
        "ArmModel": "model.arm",
        "Scene": "scene.schema",
        "load_scene": "scene.load",
    },
)
