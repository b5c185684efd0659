# SPDX-License-Identifier: Apache-2.0
"""Numerical model of an arm: parameters from scene and URDF, validated together, in joint order.

Depends on the scene package and Pinocchio, and provides the equations with their data.
"""

from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.constraint_rows import ConstraintRows
from arm_dynamics.model.frame_motion import FrameMotion
from arm_dynamics.model.friction import JointFriction
from arm_dynamics.model.loop_closure import Closure
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.model.robot import Robot
from arm_dynamics.model.springs import SpringTerms, springs_of
from arm_dynamics.model.tree_builder import (
    contact_points,
    frame_of,
    gravity_of,
    linkage_of,
    tree_of,
)

__all__ = [
    "ArmModel", "Closure", "ConstraintRows", "FrameMotion", "JointFriction", "RigidTerms",
    "Robot", "SpringTerms", "contact_points", "frame_of", "gravity_of", "linkage_of",
    "springs_of", "tree_of",
]  # fmt: skip
