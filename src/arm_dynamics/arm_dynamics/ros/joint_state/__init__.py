# SPDX-License-Identifier: Apache-2.0
"""Serialized JointStates: written into a template; received and read in a single C call.

Depends on the interfaces, ``common`` and the core's compiler, and on none of the nodes.
"""

from arm_dynamics.ros.joint_state.format import JointStateFormat
from arm_dynamics.ros.joint_state.reader import FAILED, NONE, Clip, JointStateReader, Numbers, Read
from arm_dynamics.ros.joint_state.serialization import JointStateWriter, parsed
from arm_dynamics.ros.joint_state.sink import JointStateSink

__all__ = [
    "FAILED", "NONE", "Clip", "JointStateFormat", "JointStateReader", "JointStateSink",
    "JointStateWriter", "Numbers", "Read", "parsed",
]  # fmt: skip
