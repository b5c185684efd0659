# SPDX-License-Identifier: Apache-2.0
"""Identification of a scene from measured motions: masses, inertias, friction, drives.

Depends on models of arms and on arrays; neither on files, nor on ROS, nor on simulators.
Public are ``identify`` and its result, an ``Identification``; ``identify_payload``;
``JointRecord`` (joint states as measured); ``mapped``, which matches its joints with those of a
scene; ``prepare``, which resamples and filters it into a ``MeasuredMotion`` with accelerations;
``excite``, which computes an exciting motion within a ``Room``;
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
