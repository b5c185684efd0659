# SPDX-License-Identifier: Apache-2.0
"""Exported libraries, compiled and called."""

import ctypes
import shutil
import subprocess
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array

C11, CPP17 = ("-std=c11",), ("-x", "c++", "-std=c++17")
STRICT = ("-Wall", "-Wextra", "-Wconversion", "-pedantic")
BITS = ("-O0", "-ffp-contract=off")

_LIBM = "sin cos sincos sqrt exp log pow tanh fabs floor fmin fmax hypot atan atan2 acos asin"
MATHEMATICS = frozenset([*_LIBM.split(), *(f"{name}f" for name in _LIBM.split()), "memcpy"])
"""What a library may use: functions of libm, and what copies structures."""
LEVELS = ("-O0", "-O1", "-O2", "-O3", "-Os")
"""Levels of optimization."""


def compilers() -> list[str]:
    """Of gcc and clang those that are here, or what there is."""
    return [name for name in ("gcc", "clang") if shutil.which(name)] or ["cc"]


def said_by(*command: str | Path) -> str:
    """What a command prints, which must succeed."""
    done = subprocess.run(
        list(map(str, command)), capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


class Library:
    """A library, compiled and loaded."""

    def __init__(
        self, folder: Path, name: str, flags: tuple[str, ...] = BITS, compiler: str = "cc"
    ) -> None:
        self.file, self.name = folder / f"lib{name}_{compiler}.so", name
        said_by(compiler, *flags, "-shared", "-fPIC", folder / f"{name}.c", "-o", self.file, "-lm")
        self.loaded = ctypes.CDLL(str(self.file))

    def __call__(self, function: str, *given: Array, shape: tuple[int, ...]) -> Array:
        """The result of a term's function at a point."""
        arrays, result = [np.ascontiguousarray(array) for array in given], np.full(shape, np.nan)
        entry: Any = getattr(self.loaded, f"{self.name}_{function}")
        entry.restype = None
        entry(*(ctypes.c_void_p(array.ctypes.data) for array in [*arrays, result]))
        return result


class Ticks:
    """A compiled simulation."""

    def __init__(self, library: Library, n: int) -> None:
        self._library, self.n = library, n
        size = self.function("sim_size")
        size.restype = ctypes.c_size_t
        self.memory = np.zeros(int(size()) // 8)

    def function(self, name: str) -> Any:
        return getattr(self._library.loaded, f"{self._library.name}_{name}")

    def init(self, q: Array | None = None, v: Array | None = None) -> int:
        return int(self.function("sim_init")(*map(pointer, (self.memory, q, v))))

    def step(self, command: Array) -> int:
        return int(self.function("sim_step")(pointer(self.memory), pointer(command)))

    def set(self, parameter: str, value: float) -> int:
        place = pointer(self.memory)
        return int(self.function("sim_set")(place, parameter.encode(), ctypes.c_double(value)))

    def text(self, code: int) -> str:
        function = self.function("error_text")
        function.restype = ctypes.c_char_p
        return str(function(code).decode())

    def state(self) -> tuple[Array, Array, Array]:
        q, v, effort = np.full((3, self.n), np.nan)
        self.function("sim_state")(*map(pointer, (self.memory, q, v, effort)))
        return q, v, effort

    def run(self, commands: Array) -> Array:
        rows = []
        for command in commands:
            assert self.step(command) == 0
            rows.append(np.concatenate(self.state()[:2]))
        return np.array(rows)


def pointer(array: Array | None) -> ctypes.c_void_p:
    return ctypes.c_void_p(None if array is None else array.ctypes.data)


def run_test_program(library: Library, source: Path, program: Path) -> tuple[int, str]:
    """Exit status and words of an exported test program, which calls a compiled library."""
    include = f"-I{library.file.parent}"
    said_by("cc", *BITS, include, source, library.file, "-o", program, "-lm")
    done = subprocess.run([program], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout


def assert_clean(
    source: Path,
    name: str,
    levels: tuple[str, ...] = ("-O2",),
    languages: tuple[tuple[str, ...], ...] = (C11,),
) -> None:
    """Code needs mathematics only, has no data that changes, and keeps to its names.

    Code need not be movable, so that a table of texts needs no addresses filled in at its start.
    """
    made = source.with_suffix(".o")
    for compiler, level, language in product(compilers(), levels, languages):
        said_by(compiler, *language, level, "-fno-pie", "-c", source, "-o", made)
        symbols = [line.split()[-2:] for line in said_by("nm", made).splitlines()]
        assert {used for kind, used in symbols if kind == "U"} <= MATHEMATICS
        assert [own for kind, own in symbols if kind.lower() in "bdc"] == []
        mine = {own for kind, own in symbols if kind.isupper() and kind != "U"}
        assert {own for own in mine if not own.startswith(f"{name}_")} == set()
        made.unlink()


def assert_sound(folder: Path, name: str) -> None:
    """The test program passes, and sanitizers for addresses and undefined behaviour are silent."""
    sanitizers = "-fsanitize=address,undefined", "-fno-sanitize-recover=all"
    program, files = folder / "sanitized", (folder / f"{name}.c", folder / f"test_{name}.c")
    for compiler in compilers():
        said_by(compiler, "-O0", *sanitizers, *files, "-o", program, "-lm")
        assert "all results are right" in said_by(program)


def assert_no_compiler_warns(folder: Path, name: str) -> None:
    """Library and test program are C11 and C++17 without a warning, for gcc and clang."""
    for compiler, language in product(compilers(), (C11, CPP17)):
        for file in (f"{name}.c", f"test_{name}.c"):
            said = said_by(compiler, *language, *STRICT, "-fsyntax-only", folder / file)
            assert said == ""


def assert_portable(
    folder: Path, name: str, levels: tuple[str, ...] = ("-O2",),
    languages: tuple[tuple[str, ...], ...] = (C11,),
) -> None:  # fmt: skip
    """No compiler warns, sanitizers find nothing, and code needs only what it may."""
    assert_no_compiler_warns(folder, name)
    assert_sound(folder, name)
    assert_clean(folder / f"{name}.c", name, levels, languages)
