# SPDX-License-Identifier: Apache-2.0
"""Numerical model of an arm: parameters from scene and URDF, validated together, in joint order.

Depends on the scene package and Pinocchio, and provides the equations with their data.
"""

from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.friction.joint_friction import JointFriction
from arm_dynamics.model.robot import Robot

__all__ = ["ArmModel", "JointFriction", "Robot"]
