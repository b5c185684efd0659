# SPDX-License-Identifier: Apache-2.0
"""The system's C compiler and a private cache of what it made.

An entry is a shared library followed by the digest of its bytes, in a folder that only the user
may enter. Its name is the digest of source, compiler, flags and processor. An entry that does not
match its digest, or belongs to somebody else, is built again and never loaded.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import shlex
import shutil
import stat
import subprocess
import tempfile
from functools import cache
from pathlib import Path

from arm_dynamics.exceptions import KernelError

NATIVE = Path(__file__).parent / "native"
# No -ffast-math and no fused multiply-add: a compiler places them as it likes, and one arm and
# eight arms side by side would no longer give the same bits (fusing gains 14 % for one arm and
# nothing for eight). -O1: straight-line code gains nothing from -O2 and -O3, which take two and
# four times as long to compile it. The two -fno are safe: nobody reads errno after sqrt, nobody
# traps floating-point exceptions.
FLAGS = (
    "-O1",
    "-march=native",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fvisibility=hidden",
    "-Wl,-Bsymbolic",
    "-fPIC",
    "-shared",
    "-w",
)
_DIGEST = hashlib.sha256().digest_size


def find_compiler(language: str = "c") -> tuple[str, ...] | None:
    """The command of a compiler, or None.

    Args:
        language: ``c`` or ``c++``.

    Returns:
        ``$CC`` (``$CXX``) if it is set and exists, else the first of the usual names on the PATH.
    """
    variable, names = (
        ("CC", ("cc", "gcc", "clang")) if language == "c" else ("CXX", ("c++", "g++", "clang++"))
    )
    return _first_there(os.environ.get(variable, ""), names, os.environ.get("PATH"))


@cache
def _first_there(chosen: str, names: tuple[str, ...], path: str | None) -> tuple[str, ...] | None:
    command = shlex.split(chosen)
    if command:
        return tuple(command) if shutil.which(command[0], path=path) else None
    return next(((name,) for name in names if shutil.which(name, path=path)), None)


@cache
def compiler_version(command: tuple[str, ...]) -> str:
    """First line of ``command --version``; empty if it does not run."""
    try:
        done = subprocess.run(
            [*command, "--version"], capture_output=True, text=True, timeout=20, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.splitlines()[0] if done.returncode == 0 and done.stdout else ""


@cache
def processor() -> str:
    """What tells processors with other instructions apart; part of an entry's name."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return os.uname().machine
    kept = ("model name", "flags", "Features", "CPU part")
    return "\n".join(sorted({line for line in lines if line.startswith(kept)}))


def build(source: str, command: tuple[str, ...], flags: tuple[str, ...] = FLAGS) -> ctypes.CDLL:
    """Compile C or C++ source into a library, or take it from the cache.

    Args:
        source: The code.
        command: The compiler.
        flags: Its flags.

    Returns:
        The loaded library; calls release the interpreter lock.

    Raises:
        KernelError: If the compiler refuses the code.
    """
    key = _key(source, command, flags)
    folder = cache_folder()
    entry = folder / f"{key}.so"
    if not _sound(entry):
        _write(entry, _compiled(source, command, flags, folder))
    return ctypes.CDLL(str(entry))


def cache_folder() -> Path:
    """Folder of compiled kernels, owned by the user, mode 0700.

    Where that cannot be had, a new temporary folder serves this process.
    """
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    folder = Path(base) / "arm_dynamics"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        mode = folder.lstat()
        private = (
            stat.S_ISDIR(mode.st_mode) and mode.st_uid == os.getuid() and not mode.st_mode & 0o077
        )
        if private and os.access(folder, os.W_OK):
            return folder
    except OSError:
        pass
    return _temporary_folder()


@cache
def _temporary_folder() -> Path:
    return Path(tempfile.mkdtemp(prefix="arm_dynamics-"))


def _key(source: str, command: tuple[str, ...], flags: tuple[str, ...]) -> str:
    parts = (source, *command, compiler_version(command), *flags, processor())
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:40]


def _sound(entry: Path) -> bool:
    try:
        if not stat.S_ISREG(entry.lstat().st_mode) or entry.lstat().st_uid != os.getuid():
            return False
        content = entry.read_bytes()
    except OSError:
        return False
    return (
        len(content) > _DIGEST
        and hashlib.sha256(content[:-_DIGEST]).digest() == content[-_DIGEST:]
    )


def _compiled(
    source: str, command: tuple[str, ...], flags: tuple[str, ...], folder: Path
) -> bytes:
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        suffix = "cpp" if command == find_compiler("c++") else "c"
        code, library = Path(scratch) / f"kernel.{suffix}", Path(scratch) / "kernel.so"
        code.write_text(source)
        line = [*command, *flags, f"-I{NATIVE}", "-o", str(library), str(code), "-lm"]
        done = subprocess.run(
            line, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False
        )
        if done.returncode != 0:
            raise KernelError(f"{command[0]} refused generated code:\n{done.stderr[-2000:]}")
        return library.read_bytes()


def _write(entry: Path, library: bytes) -> None:
    """Put an entry in place at once, so that no other process ever sees half of it."""
    handle, name = tempfile.mkstemp(dir=entry.parent)
    with os.fdopen(handle, "wb") as file:
        file.write(library + hashlib.sha256(library).digest())
    os.replace(name, entry)
