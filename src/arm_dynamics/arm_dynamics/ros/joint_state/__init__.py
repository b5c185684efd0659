# SPDX-License-Identifier: Apache-2.0
"""JointStates as bytes: written into a template, taken and read in one call of C each.

It knows the interfaces, ``common`` and the core's compiler, and none of the nodes. Where there is
no compiler, ROS's own deserializer reads them.
"""

from arm_dynamics.ros.joint_state.serialization import JointStateWriter, Numbers
from arm_dynamics.ros.joint_state.topics import (
    CompiledReader,
    JointStateSink,
    JointStateSource,
    Sink,
    address,
    make_reader,
    native,
)

__all__ = [
    "CompiledReader",
    "JointStateSink",
    "JointStateSource",
    "JointStateWriter",
    "Numbers",
    "Sink",
    "address",
    "make_reader",
    "native",
]
