# SPDX-License-Identifier: Apache-2.0
"""The C code of the sim node: rules of the loop, recording, ticks."""

from ctypes import CDLL
from functools import cache
from pathlib import Path

from arm_dynamics.codegen.header import Header
from arm_dynamics.codegen.kernel import ENTRY
from arm_dynamics.ros.common.rcl_code import code_of_nodes
from arm_dynamics.ros.joint_state.joint_state_library import HEADER as JOINT_STATE
from arm_dynamics.ros.joint_state.joint_state_library import SOURCE as JOINT_STATE_SOURCE
from arm_sim.stepping.arm import ARM

_HERE = Path(__file__).parent
_FILES = tuple(_HERE / name for name in ("native/timing", "record/native/record", "native/ticks"))
TIMING, RECORD = (Header(file.with_suffix(".h"), ENTRY) for file in _FILES[:2])
TICKS = Header(_FILES[2].with_suffix(".h"), JOINT_STATE, TIMING, RECORD, ARM)


@cache
def library(*others: Path) -> CDLL:
    """The compiled functions, with those of other files.

    Raises:
        KernelError: If they are not available.
    """
    files = (JOINT_STATE_SOURCE, *(file.with_suffix(".c") for file in _FILES), *others)
    return code_of_nodes(
        *files, headers=(JOINT_STATE, TIMING, RECORD, TICKS), folders=(ARM.folder,)
    )
