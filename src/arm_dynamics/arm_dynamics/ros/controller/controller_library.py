# SPDX-License-Identifier: Apache-2.0
"""The C code of the controller node: ordinary answers, and the rules that Python's follow too."""

from ctypes import CDLL
from functools import cache
from pathlib import Path

from arm_dynamics.codegen.header import Header
from arm_dynamics.codegen.kernel import ENTRY
from arm_dynamics.ros.common.rcl_code import code_of_nodes
from arm_dynamics.ros.joint_state.joint_state_library import HEADER as JOINT_STATE
from arm_dynamics.ros.joint_state.joint_state_library import SOURCE as JOINT_STATE_SOURCE
from arm_dynamics.trajectory.trajectory_library import SOURCE as SAMPLE
from arm_dynamics.trajectory.trajectory_library import library as evaluation

_SOURCE = Path(__file__).with_name("native") / "answers.c"
HEADER = Header(_SOURCE.with_suffix(".h"), ENTRY, JOINT_STATE)


@cache
def library() -> CDLL:
    """The compiled functions.

    Raises:
        KernelError: If they are not available.
    """
    return code_of_nodes(JOINT_STATE_SOURCE, SAMPLE, _SOURCE, headers=(JOINT_STATE, HEADER))


def prepare() -> None:
    """Compile what answers need.

    Raises:
        KernelError: If that is not possible.
    """
    library()
    evaluation()
