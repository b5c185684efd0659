# SPDX-License-Identifier: Apache-2.0
"""JointStates as bytes: written from a template, read at known places, in one call of C each.

It knows the interfaces, ``common`` and the core's compiler, and none of the nodes. Where there is
no compiler the same is done in Python.
"""

from arm_dynamics.ros.joint_state.serialization import (
    JointStateReader,
    JointStateWriter,
    Numbers,
    Read,
)
from arm_dynamics.ros.joint_state.topics import (
    JointStateSink,
    JointStateSource,
    make_reader,
    make_sink,
    make_source,
    native,
)

__all__ = [
    "JointStateReader",
    "JointStateSink",
    "JointStateSource",
    "JointStateWriter",
    "Numbers",
    "Read",
    "make_reader",
    "make_sink",
    "make_source",
    "native",
]
