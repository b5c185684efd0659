# SPDX-License-Identifier: Apache-2.0
"""The C code that receives, reads and publishes JointStates."""

import ctypes
from functools import cache
from pathlib import Path

from arm_dynamics.codegen.header import Header
from arm_dynamics.codegen.kernel import ENTRY
from arm_dynamics.ros.common.rcl_code import code_of_nodes

SOURCE = Path(__file__).with_name("native") / "joint_state.c"
HEADER = Header(SOURCE.with_suffix(".h"), ENTRY)


@cache
def library() -> ctypes.CDLL:
    """The compiled functions.

    Raises:
        KernelError: If they are not available.
    """
    return code_of_nodes(SOURCE, headers=(HEADER,))
