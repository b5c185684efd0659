# SPDX-License-Identifier: Apache-2.0
"""Serialized JointStates: written into a template; received and read in a single C call.

Depends on the interfaces, ``common`` and the core's compiler, and on none of the nodes.
"""

from arm_dynamics.ros.joint_state.serialization import JointStateReader, JointStateWriter, Numbers
from arm_dynamics.ros.joint_state.topics import (
    FAILED,
    HEADER,
    SOURCE,
    CompiledReader,
    JointStateSink,
    JointStateSource,
    Sink,
    address,
    make_reader,
)

__all__ = [
    "FAILED",
    "HEADER",
    "SOURCE",
    "CompiledReader",
    "JointStateReader",
    "JointStateSink",
    "JointStateSource",
    "JointStateWriter",
    "Numbers",
    "Sink",
    "address",
    "make_reader",
]
