# SPDX-License-Identifier: Apache-2.0
"""What the equations of motion of a robot arm are: M(q) q̈ + C(q, q̇) q̇ + G(q) + F(q, q̇) = τ."""

from arm_dynamics.dynamics import Dynamics, Term
from arm_dynamics.exceptions import ArmError, InvalidInput, KernelError, ModelError, SceneError
from arm_dynamics.model import ArmModel
from arm_dynamics.scene import Scene
from arm_dynamics.scene_file import load_scene

__all__ = [
    "ArmError",
    "ArmModel",
    "Dynamics",
    "InvalidInput",
    "KernelError",
    "ModelError",
    "Scene",
    "SceneError",
    "Term",
    "load_scene",
]
