# SPDX-License-Identifier: Apache-2.0
"""Parameters of drives and of friction near rest, from records of simple tests.

Depends on the models in ``equations``; fits their simulated motion to the measured one.
"""

from arm_studies.identification.drives.bristles import UNITS as BRISTLE_UNITS
from arm_studies.identification.drives.bristles import SmallMotion, identify_bristles
from arm_studies.identification.drives.joint import UNITS as JOINT_UNITS
from arm_studies.identification.drives.joint import JointTest, identify_joint
from arm_studies.identification.drives.matching import Estimate, Match
from arm_studies.identification.drives.motor import UNITS as MOTOR_UNITS
from arm_studies.identification.drives.motor import MotorRecord, identify_motor

__all__ = [
    "BRISTLE_UNITS", "JOINT_UNITS", "MOTOR_UNITS", "Estimate", "JointTest", "Match", "MotorRecord",
    "SmallMotion", "identify_bristles", "identify_joint", "identify_motor",
]  # fmt: skip
