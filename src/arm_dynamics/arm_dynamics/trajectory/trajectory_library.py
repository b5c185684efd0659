# SPDX-License-Identifier: Apache-2.0
"""The C code that evaluates trajectories, for Python and for the controller node."""

import logging
from ctypes import CDLL
from functools import cache
from pathlib import Path

from arm_dynamics.codegen.compiler import build, may_build
from arm_dynamics.codegen.header import Header
from arm_dynamics.exceptions import KernelError

SOURCE = Path(__file__).with_name("native") / "sample.c"
HEADER = Header(SOURCE.with_suffix(".h"))
_log = logging.getLogger(__name__)


@cache
def library() -> CDLL | None:
    """The compiled library; None if it is not available."""
    if not may_build():
        return None
    try:
        return build_library()
    except (KernelError, OSError) as error:
        _log.debug("trajectories are evaluated by NumPy: %s", error)
        return None


def build_library() -> CDLL:
    """Compile the library.

    Raises:
        KernelError: If it cannot be compiled.
    """
    built = build(SOURCE.read_text(encoding="utf-8"), local=(f"-I{HEADER.folder}",)).library
    HEADER.bind(built)
    return built
