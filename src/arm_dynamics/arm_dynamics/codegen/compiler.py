# SPDX-License-Identifier: Apache-2.0
"""From C or C++ source to a loaded library, by the system's compiler or from a cache.

The folders of ARM_CACHE come first (see ``compiled_scenes``), then the user's own cache, then the
compiler. The name of an entry is the digest of source, headers, compiler, flags and processor; one
that is not intact is built again and never loaded.
"""

import ctypes
import hashlib
import logging
import os
import re
import shlex
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from threading import Lock

from arm_dynamics.codegen import compiled_scenes, processor, user_cache
from arm_dynamics.codegen.compiled_scenes import Code, Manifest
from arm_dynamics.codegen.one_at_a_time import others_may_build
from arm_dynamics.codegen.split_functions import units
from arm_dynamics.exceptions import ARM, CompilerMissing, KernelError

NATIVE = Path(__file__).parent / "native"
# No -ffast-math and no fused multiply-add: compilers place them differently, and one arm and
# eight arms side by side would no longer give the same bits (fusing gains 14 % for one arm and
# nothing for eight). -O1: straight-line code gains nothing from -O2 and -O3, which take two and
# four times as long to compile it. The two -fno are safe: no code reads errno after sqrt, none
# traps floating-point exceptions.
FLAGS = (
    "-O1", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math", "-fvisibility=hidden",
    "-Wl,-Bsymbolic", "-fPIC", "-shared", "-w",
)  # fmt: skip
# C++ is the language of many arms side by side: what is done lane by lane, such as finding angles
# beyond the sine's range, becomes code without loops. Its own headers, which take a compiler
# longer than many a kernel, are not needed: those of C are there.
_FLAGS_OF_LANGUAGE = {"c": (), "c++": ("-funroll-loops", "-nostdinc++")}
HOW_TO_GET_CODE = (
    "install one (apt install gcc), or compile the scene on another machine "
    f"({ARM} build SCENE --out DIR) and set ARM_CACHE=DIR"
)
# Lines of C that take a compiler more than about two seconds.
LONG_SOURCE = 20_000
_COMPILERS = {
    "c": ("C", "CC", ("cc", "gcc", "clang")),
    "c++": ("C++", "CXX", ("c++", "g++", "clang++")),
}
_INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)', re.MULTILINE)
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Destination:
    """Folder for compiled scenes, and their description.

    Attributes:
        folder: An existing folder.
        scene: Name of the scene file.
        kernel: Part of the scene.
        target: The processor: one of ``processor.TARGETS``.
    """

    folder: Path
    scene: str
    kernel: str
    target: str


_destination: ContextVar[Destination | None] = ContextVar("destination", default=None)
_building: dict[str, Lock] = {}  # by what is compiled: two threads may want the same


def find_compiler(language: str = "c") -> tuple[str, ...] | None:
    """The command of a compiler for ``c`` or ``c++``, or None.

    It is ``$CC`` (``$CXX``) if that is set and exists, else the first usual name on the PATH.
    """
    _, variable, names = _COMPILERS[language]
    return _first_installed(os.environ.get(variable, ""), names, os.environ.get("PATH"))


@cache
def _first_installed(own: str, names: tuple[str, ...], path: str | None) -> tuple[str, ...] | None:
    command = shlex.split(own)
    if command:
        return tuple(command) if shutil.which(command[0], path=path) else None
    return next(((name,) for name in names if shutil.which(name, path=path)), None)


@cache
def compiler_version(command: tuple[str, ...]) -> str:
    """First line of ``command --version``; empty if it does not run."""
    try:
        process = subprocess.run(
            [*command, "--version"], capture_output=True, text=True, timeout=20, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return process.stdout.partition("\n")[0] if process.returncode == 0 else ""


def may_build(language: str = "c") -> bool:
    """Whether ``build`` can succeed: there is a compiler, or ARM_CACHE names folders."""
    return find_compiler(language) is not None or bool(compiled_scenes.folders())


def instructions() -> frozenset[str]:
    """Extensions of the instruction set that code may use that is compiled now."""
    destination = _destination.get()
    return processor.needed(destination.target if destination else processor.NATIVE)


def build(
    source: str,
    language: str = "c",
    flags: tuple[str, ...] = FLAGS,
    local: tuple[str, ...] = (),
    others: tuple[str, ...] = (),
) -> Code:
    """Compile source into a library, or take it from a folder of ARM_CACHE or the user's cache.

    Args:
        source: The code.
        language: ``c`` or ``c++``.
        flags: Flags of the compiler, without the processor and what the language adds.
        local: Further flags, which name folders and libraries of this machine. Headers in the
            folders are part of the code, where they are is not.
        others: Further units of the library.

    Returns:
        The loaded library.

    Raises:
        CompilerMissing: If there is neither a compiler nor a library that may be loaded.
        KernelError: If the compiler refuses the code.
    """
    flags += _FLAGS_OF_LANGUAGE[language]
    names = (Path(flag).name for flag in local)
    texts = [source, *others]
    key = user_cache.digest(*texts, *_headers(texts, flags + local), language, *flags, *names)
    with others_may_build(), _building.setdefault(key, Lock()):
        if (destination := _destination.get()) is not None:
            return _build_into(destination, key, texts, language, flags + local)
        code, refusals = compiled_scenes.search(key)
        if code is None:
            if (command := find_compiler(language)) is None:
                raise CompilerMissing(_no_compiler_message(language, refusals))
            entry, version = _cache_entry(key, command)
            if user_cache.read(entry) is None:
                library = _compile(texts, language, command, flags + local, processor.NATIVE)
                user_cache.write(entry, library)
            code = Code(ctypes.CDLL(str(entry)), version, key)
    for refusal in refusals:
        _log.warning("%s", refusal)
    return code


def destination() -> Destination | None:
    """Where code is compiled to now, if not to the user's own cache."""
    return _destination.get()


@contextmanager
def describing(kernel: str) -> Iterator[None]:
    """Within this block, code that is built into a folder is described so."""
    outer = _destination.get()
    token = _destination.set(outer and replace(outer, kernel=kernel))
    try:
        yield
    finally:
        _destination.reset(token)


def find(key: str) -> Code | None:
    """A library that ``build`` compiled before, by ``Code.key``; None if it no longer exists."""
    if _destination.get() is not None:
        return None
    code, _ = compiled_scenes.search(key)
    command = find_compiler()
    if code is None and command is not None:
        entry, version = _cache_entry(key, command)
        if user_cache.read(entry) is not None:
            return Code(ctypes.CDLL(str(entry)), version, key)
    return code


@contextmanager
def building_into(destination: Destination) -> Iterator[None]:
    """Within this block, libraries are built into a folder of compiled scenes and loaded from it.

    Raises:
        KernelError: If this processor lacks instructions of the target, so that what is built
            could not be checked.
    """
    if missing := processor.missing(processor.needed(destination.target)):
        raise KernelError(
            f"code for {destination.target} cannot be checked here: this processor lacks "
            f"{', '.join(missing)}"
        )
    token = _destination.set(destination)
    try:
        yield
    finally:
        _destination.reset(token)


def _headers(texts: list[str], flags: tuple[str, ...]) -> list[str]:
    """Texts of all headers in our folder or in one of a flag -I, recursively."""
    folders = [Path(flag[2:]) for flag in flags if flag.startswith("-I")] + [NATIVE]
    headers, unread = dict[Path, str](), [*texts]
    while unread:
        for name in _INCLUDE.findall(unread.pop()):
            for path in (folder / name for folder in folders):
                if path not in headers and path.is_file():
                    headers[path] = path.read_text(errors="replace")
                    unread.append(headers[path])
    return [headers[path] for path in sorted(headers)]


def _no_compiler_message(language: str, refusals: list[str]) -> str:
    title, variable, names = _COMPILERS[language]
    missing = f"no {title} compiler found (${variable}, {', '.join(names)})"
    if not compiled_scenes.folders():
        return missing
    listed = os.environ[compiled_scenes.VARIABLE]
    why = "; ".join(refusals) or "nothing in it was compiled for this scene, method and version"
    return f"{missing}, and none of ARM_CACHE={listed} can be used: {why}"


def _build_into(
    destination: Destination, key: str, texts: list[str], language: str, flags: tuple[str, ...]
) -> Code:
    """Compile into a folder of compiled scenes, unless the entry exists already."""
    if (command := find_compiler(language)) is None:
        raise CompilerMissing(_no_compiler_message(language, []))
    entry, version = destination.folder / f"{key}.so", compiler_version(command)
    needs = sorted(processor.needed(destination.target))
    try:
        old = compiled_scenes.read_manifest(entry)
        present = (old.compiler, old.target, old.instructions)
    except KernelError:  # there is none, or it cannot be used
        present = None
    if present != (version, destination.target, needs):
        library = _compile(texts, language, command, flags, destination.target)
        manifest = Manifest(
            scene=destination.scene, kernel=destination.kernel, compiler=version,
            target=destination.target, machine=os.uname().machine, instructions=needs,
            sha256=hashlib.sha256(library).hexdigest(),
        )  # fmt: skip
        compiled_scenes.store(entry, library, manifest)
    return compiled_scenes.load(entry)


def _cache_entry(key: str, command: tuple[str, ...]) -> tuple[Path, str]:
    """File of the user's own cache, and the compiler's version."""
    version = compiler_version(command)
    name = user_cache.digest(key, *command, version, *sorted(processor.instructions()))
    return user_cache.folder() / f"{name}.so", version


def _compile(
    texts: list[str], language: str, command: tuple[str, ...], flags: tuple[str, ...], target: str
) -> bytes:
    """A library of a source, which may be divided, and of further units."""
    source, *others = texts
    suffix = "c" if language == "c" else "cpp"
    compile_ = [*command, f"-march={target}", *flags, f"-I{NATIVE}"]
    parts = [*units(source, len(os.sched_getaffinity(0))), *others]
    if (lines := source.count("\n")) > LONG_SOURCE:
        _log.info("compiling %d lines of C on %d cores", lines, len(parts))
    with tempfile.TemporaryDirectory(dir=user_cache.folder()) as scratch:
        library, names = Path(scratch) / "kernel.so", list[str]()
        for number, text in enumerate(parts):
            code = Path(scratch) / f"kernel{number or ''}.{suffix}"
            code.write_text(text, encoding="utf-8")
            names.append(str(code))
        if len(names) > 1:
            objects = [f"{name}.o" for name in names]
            pairs = zip(objects, names, strict=True)
            _run(*([*compile_, "-c", "-o", output, name] for output, name in pairs))
            names = objects
        _run([*compile_, "-o", str(library), *names, "-lm"])
        return library.read_bytes()


def _run(*commands: list[str]) -> None:
    """Run all compiler commands in parallel; an interruption ends them."""
    silent, pipe = subprocess.DEVNULL, subprocess.PIPE
    with ExitStack() as stack:
        processes = [
            stack.enter_context(
                subprocess.Popen(command, stdin=silent, stdout=silent, stderr=pipe, text=True)
            )
            for command in commands
        ]
        try:
            messages = [process.communicate()[1] for process in processes]
        except BaseException:
            for process in processes:
                process.terminate()
            raise
    for command, process, message in zip(commands, processes, messages, strict=True):
        if (status := process.returncode) < 0:
            name = signal.Signals(-status).name
            raise KernelError(f"{command[0]} was ended by {name} before it had compiled the code")
        if status > 0:
            message = message[-2000:] or f"status {status}, and no message"
            raise KernelError(f"{command[0]} refused generated code:\n{message}")
