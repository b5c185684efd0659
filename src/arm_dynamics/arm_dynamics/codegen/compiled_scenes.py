# SPDX-License-Identifier: Apache-2.0
"""Folders of code compiled elsewhere, for machines without a compiler.

An entry is a shared library ``KEY.so`` and its description ``KEY.json``. The key is the digest of
the source, its headers and flags, so that it is found without a compiler. An entry is loaded only
if only this user or root can have written it, its digest matches and this processor has the
instructions that it needs. The variable ARM_CACHE lists the folders; they are only read.
"""

import ctypes
import hashlib
import os
import stat
import tempfile
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from arm_dynamics.codegen import processor
from arm_dynamics.exceptions import ARM, KernelError

VARIABLE = "ARM_CACHE"
_WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH


@dataclass(frozen=True)
class Code:
    """A loaded library.

    Attributes:
        library: The library; calls release the interpreter lock.
        origin: Compiler and place of compilation, as text.
        key: Digest of its source, headers and flags.
    """

    library: ctypes.CDLL
    origin: str
    key: str


class Manifest(BaseModel):
    """Description of a library.

    Attributes:
        scene: Name of the scene file for which it was compiled.
        kernel: Part of the scene.
        compiler: Name and version of the compiler.
        target: The processor for which it was compiled: ``native`` or a level.
        machine: Architecture, as printed by ``uname -m``.
        instructions: Extensions of the instruction set that it needs.
        sha256: Digest of the library.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    scene: str
    kernel: str
    compiler: str
    target: str
    machine: str
    instructions: list[str]
    sha256: str


def folders() -> list[Path]:
    """The folders that ARM_CACHE lists, separated by ``os.pathsep``."""
    listed = os.environ.get(VARIABLE, "").split(os.pathsep)
    return [Path(folder).absolute() for folder in listed if folder]


def search(key: str) -> tuple[Code | None, list[str]]:
    """Look for an entry in the folders of ARM_CACHE.

    Returns:
        The first one that may be loaded, if any, and for each one refused on the way its file and
        the reason.
    """
    refusals = []
    for folder in folders():
        if not folder.is_dir():
            refusals.append(f"{folder}: no such folder")
        elif os.path.lexists(entry := folder / f"{key}.so"):
            try:
                return load(entry), refusals
            except KernelError as error:
                refusals.append(str(error))
    return None, refusals


def load(entry: Path) -> Code:
    """Load an entry; the error says why it must not or cannot be loaded."""
    manifest = read_manifest(entry)
    try:
        library = ctypes.CDLL(str(entry))
    except OSError as error:
        raise KernelError(f"{entry} cannot be loaded: {error}") from error
    origin = f"{manifest.compiler}, compiled for {manifest.target} in {entry.parent}"
    return Code(library, origin, entry.stem)


def read_manifest(entry: Path) -> Manifest:
    """Check an entry and read its description; the error says why it must not be loaded."""
    description = entry.with_suffix(".json")
    for path in (entry.parent.resolve(), entry, description):
        _check_owner(path)
    try:
        manifest = Manifest.model_validate_json(description.read_bytes())
    except ValidationError as error:
        raise KernelError(f"{description} is damaged or of another version: {error}") from error
    name = f"{entry} ({manifest.scene}: {manifest.kernel})"
    if manifest.machine != (machine := os.uname().machine):
        raise KernelError(f"{name} was compiled for {manifest.machine}; this machine is {machine}")
    if missing := processor.missing(manifest.instructions):
        raise KernelError(
            f"{name} needs instructions that this processor lacks: {', '.join(missing)}; "
            f"{ARM} build --processor compiles for older ones"
        )
    if hashlib.sha256(entry.read_bytes()).hexdigest() != manifest.sha256:
        raise KernelError(f"{name} is damaged: its digest is not the one in {description.name}")
    return manifest


def make_folder(folder: Path) -> None:
    """Create a folder for entries, writable by its owner only.

    Raises:
        KernelError: If it exists already and others may write to it.
        OSError: If it cannot be created.
    """
    if not folder.is_dir():
        folder.mkdir(parents=True)
        folder.chmod(0o755)  # regardless of the user's umask
    _check_owner(folder.resolve())


def store(entry: Path, library: bytes, manifest: Manifest) -> None:
    """Write an entry, each of its files atomically."""
    write_atomically(entry, library, 0o644)
    description = manifest.model_dump_json(indent=1) + "\n"
    write_atomically(entry.with_suffix(".json"), description.encode(), 0o644)


def write_atomically(path: Path, content: bytes, mode: int) -> None:
    """Put a file in place atomically, so that no other process ever sees a partial one."""
    handle, name = tempfile.mkstemp(dir=path.parent)
    with os.fdopen(handle, "wb") as file:
        file.write(content)
        os.fchmod(handle, mode)
    os.replace(name, path)


def _check_owner(path: Path) -> None:
    """Refuse a file or folder that another user can have written, or that is a link."""
    try:
        status = path.lstat()
    except OSError as error:
        raise KernelError(f"{path} cannot be read: {error.strerror}") from error
    if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
        raise KernelError(f"{path} is not a plain file")
    if status.st_uid not in (0, os.getuid()):
        raise KernelError(
            f"{path} belongs to user {status.st_uid}, neither to root nor to this one "
            f"({os.getuid()})"
        )
    if status.st_mode & _WRITABLE_BY_OTHERS:
        raise KernelError(
            f"{path} can be written by others (mode {stat.S_IMODE(status.st_mode):o}); "
            "chmod go-w makes it safe"
        )
