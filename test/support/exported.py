# SPDX-License-Identifier: Apache-2.0
"""Exported libraries, compiled and called."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array

C11, CPP17 = ("-std=c11",), ("-x", "c++", "-std=c++17")
STRICT = ("-Wall", "-Wextra", "-Wconversion", "-pedantic")
BITS = ("-O1", "-ffp-contract=off")

MATHEMATICS = frozenset(
    "sin cos sincos sqrt exp log pow tanh fabs floor fmin fmax hypot atan atan2 acos asin memcpy "
    "_GLOBAL_OFFSET_TABLE_".split()
)
"""What a library may use: functions of libm, and memcpy."""


def compilers() -> list[str]:
    """The C compilers that are here, out of gcc and clang."""
    return [name for name in ("gcc", "clang") if shutil.which(name)]


def said_by(*command: str | Path) -> str:
    """What a command prints, which must succeed."""
    done = subprocess.run(
        list(map(str, command)), capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


class Library:
    """A library, compiled and loaded.

    Args:
        folder: What ``export`` wrote.
        name: Its name.
        flags: Those of the compiler.
    """

    def __init__(self, folder: Path, name: str, flags: tuple[str, ...] = BITS) -> None:
        file = folder / f"lib{name}.so"
        said_by("cc", *flags, "-shared", "-fPIC", folder / f"{name}.c", "-o", file, "-lm")
        self.loaded, self.name = ctypes.CDLL(str(file)), name

    def __call__(self, function: str, *given: Array, shape: tuple[int, ...]) -> Array:
        """The result of a term's function at a point."""
        arrays = [np.ascontiguousarray(array, dtype=float) for array in given]
        result = np.full(shape, np.nan)
        entry: Any = getattr(self.loaded, f"{self.name}_{function}")
        entry.restype = None
        entry(*(ctypes.c_void_p(array.ctypes.data) for array in [*arrays, result]))
        return result


def symbols_of(source: Path, *flags: str) -> list[tuple[str, str]]:
    """Kinds and names of the symbols of a compiled file, as ``nm`` prints them.

    Code need not be movable, so that a table of texts needs no addresses filled in at its start.
    """
    made = source.with_suffix(".o")
    said_by("cc", *(flags or BITS), "-fno-pie", "-c", source, "-o", made)
    lines = (line.split()[-2:] for line in said_by("nm", made).splitlines())
    return [(kind, name) for kind, name in lines]
