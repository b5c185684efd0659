# SPDX-License-Identifier: Apache-2.0
"""Serialized JointStates: written into a template; received and read in a single C call.

Depends on the interfaces, ``common`` and the core's compiler, and on none of the nodes.
"""

from arm_dynamics.ros.joint_state.joint_state_library import HEADER, SOURCE
from arm_dynamics.ros.joint_state.reader import FAILED, NONE, JointStateReader, Numbers, Read
from arm_dynamics.ros.joint_state.serialization import JointStateWriter, parsed
from arm_dynamics.ros.joint_state.topics import JointStateSink, Sink

__all__ = [
    "FAILED", "HEADER", "NONE", "SOURCE", "JointStateReader", "JointStateSink",
    "JointStateWriter", "Numbers", "Read", "Sink", "parsed",
]  # fmt: skip
