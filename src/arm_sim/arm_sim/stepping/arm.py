# SPDX-License-Identifier: Apache-2.0
"""An arm that compiled code advances tick by tick."""

import ctypes
from pathlib import Path
from typing import Any

from arm_dynamics.codegen.header import Header

ARM = Header(Path(__file__).with_name("native") / "arm/arm.h")


class Arm(ctypes.Structure):
    """``arm_t`` of arm.h.

    Attributes:
        memory: Owners of what its pointers point at, kept alive.
    """

    _fields_ = ARM.fields("arm_t")
    memory: tuple[Any, ...]
