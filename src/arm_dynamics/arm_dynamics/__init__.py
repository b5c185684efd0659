# SPDX-License-Identifier: Apache-2.0
"""Dynamics of robot arms: M(q) q̈ + C(q, q̇) q̇ + G(q) + S(q, q̇) + F(q, q̇) = τ.

Names are imported when they are first used: Pinocchio and CasADi take half a second to import,
and commands that only read a scene or call a running node need neither.
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
    from arm_dynamics.dynamics.dynamics import Dynamics
    from arm_dynamics.model.arm import ArmModel
    from arm_dynamics.scene.load import load_scene
    from arm_dynamics.scene.schema import Scene
    from arm_dynamics.terms.table import Term

__version__ = "0.1.0"
__all__ = [
    "ArmError", "ArmModel", "ConstraintError", "Dynamics", "InvalidInput", "KernelError",
    "ModelError", "Scene", "SceneError", "Term", "Unreachable", "load_scene",
]  # fmt: skip
__getattr__, __dir__ = on_demand(__name__, __file__)
