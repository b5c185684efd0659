# SPDX-License-Identifier: Apache-2.0
"""Serialized JointStates: written into a template; received and read in a single C call.

Depends on the interfaces, ``common`` and the core's compiler, and on none of the nodes. Without a
compiler, ROS's own deserializer reads them.
"""

from arm_dynamics.ros.joint_state.serialization import JointStateReader, JointStateWriter, Numbers
from arm_dynamics.ros.joint_state.topics import (
    FAILED,
    SOURCE,
    CompiledReader,
    JointStateSink,
    JointStateSource,
    Sink,
    address,
    make_reader,
    native,
)

__all__ = [
    "FAILED",
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
    "native",
]
