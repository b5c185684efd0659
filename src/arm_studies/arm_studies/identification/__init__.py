# SPDX-License-Identifier: Apache-2.0
"""Identification of a scene from measured motions: masses, inertias, friction, drives.

Depends on models of arms; on simulators and recordings only where a scene is compared with a
recording (``compare``) and where files are read; not on ROS.
Public are ``identify`` and its result, an ``Identification``; ``identify_payload``
and, with intervals, ``estimate_payload``; ``write``, for a result's scene, report and figures;
``JointRecord`` (joint states as measured); ``mapped``, which matches its joints with those of a
scene; ``prepare``, which resamples and filters it into a ``MeasuredMotion`` with accelerations;
``excite``, which computes an exciting motion within a ``Room``;
``identify_motor``, ``identify_joint`` and ``identify_bristles``, for drives from simple tests;
and ``compare``, which tells how well a scene predicts a recording.
"""

from arm_studies.identification.comparison import Comparison, FreeRun, compare
from arm_studies.identification.data import JointRecord, MeasuredMotion
from arm_studies.identification.drives.bristles import SmallMotion, identify_bristles
from arm_studies.identification.drives.joint import JointTest, identify_joint
from arm_studies.identification.drives.matching import Match
from arm_studies.identification.drives.motor import MotorRecord, identify_motor
from arm_studies.identification.excitation import Box, Excitation, Room, excite
from arm_studies.identification.names import mapped
from arm_studies.identification.payload import PayloadEstimate, estimate_payload, identify_payload
from arm_studies.identification.preparation.even_record import prepare
from arm_studies.identification.report import write
from arm_studies.identification.result import Identification
from arm_studies.identification.whole_arm import identify

__all__ = [
    "Box", "Comparison", "Excitation", "FreeRun", "Identification", "JointRecord", "JointTest",
    "Match", "MeasuredMotion", "MotorRecord", "PayloadEstimate", "Room", "SmallMotion", "compare",
    "estimate_payload", "excite", "identify", "identify_bristles", "identify_joint",
    "identify_motor", "identify_payload", "mapped", "prepare", "write",
]  # fmt: skip
