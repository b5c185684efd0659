# SPDX-License-Identifier: Apache-2.0
"""From measured motions to the numbers of a scene: masses, inertias, friction, drives.

Knows models of arms and their laws, and arrays; neither files nor ROS, nor what simulates.
Public are ``identify`` and what it returns, an ``Identification``; ``identify_payload``;
``JointRecord`` (joint states as a robot told them); ``mapped``, which finds a scene's joints in
it; ``prepare``, which makes a ``MeasuredMotion`` of it (even times, no lag, with accelerations);
``excite``, which finds a motion worth measuring within a ``Room``;
``identify_motor``, ``identify_joint`` and ``identify_bristles``, for drives from simple tests.
"""

from arm_dynamics.identification.data import JointRecord, MeasuredMotion
from arm_dynamics.identification.drives import (
    JointTest,
    Match,
    MotorRecord,
    SmallMotion,
    identify_bristles,
    identify_joint,
    identify_motor,
)
from arm_dynamics.identification.excitation import Box, Excitation, Room, excite
from arm_dynamics.identification.names import mapped
from arm_dynamics.identification.payload import identify_payload
from arm_dynamics.identification.preparation import prepare
from arm_dynamics.identification.result import Identification
from arm_dynamics.identification.whole_arm import identify

__all__ = [
    "Box", "Excitation", "Identification", "JointRecord", "JointTest", "Match", "MeasuredMotion",
    "MotorRecord", "Room", "SmallMotion", "excite", "identify", "identify_bristles",
    "identify_joint", "identify_motor", "identify_payload", "mapped", "prepare",
]  # fmt: skip
