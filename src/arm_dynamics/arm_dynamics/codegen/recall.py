# SPDX-License-Identifier: Apache-2.0
"""Kernels by what they were made from, so that known code needs no equations written again.

For a robot of 100 joints writing the equations takes as long as compiling them. A note in the
user's cache says which code a description led to, and what its functions take and give. It is
found by the digest of the description, to the last bit, and of this software as it was when the
process began, and it is worth no more than the code that it names: that is found by its own digest
and checked as ever (see ``compiler``). Functions and constants of this software that are replaced
while it runs are not seen.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
from pydantic import BaseModel, ConfigDict, ValidationError

from arm_dynamics.codegen import compiled_scenes, compiler
from arm_dynamics.codegen.kernel import Interface, Kernel

PACKAGES = (Path(__file__).parents[1],)
_SOURCES = (".py", ".c", ".h", ".hpp")
# Sources that changed after this may not be those that run; imports take some seconds.
BEGAN = time.time() - 10.0


class Note(BaseModel):
    """What a description led to.

    Attributes:
        code: Key of the code, see ``compiler.build``.
        functions: Its functions by name.
        operations: In one call of each.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    code: str
    functions: dict[str, Interface]
    operations: dict[str, int]


def recalled(
    description: str | None, packages: tuple[Path, ...], make: Callable[[], Kernel]
) -> Kernel:
    """The kernel that a description led to before, else a new one.

    Args:
        description: All that the kernel follows from but the software; None for what cannot be
            described.
        packages: Folders of the software that makes it, this package aside.
        make: Makes it.
    """
    if description is None or not compiler.keeps_code() or changed(packages):
        return make()
    place = compiler.cache_folder() / f"{_digest(description, packages)}.json"
    note = _read(place)
    code = compiler.kept(note.code) if note else None
    if note and code:
        return Kernel.of_code(code, note.functions, note.operations)
    kernel = make()
    if kernel.key and not changed(packages):
        counts = {name: kernel.operations(name) for name in kernel.interfaces}
        note = Note(code=kernel.key, functions=kernel.interfaces, operations=counts)
        compiled_scenes.put(place, _sealed(note.model_dump_json().encode()), 0o600)
    return kernel


def exact(value: Any) -> str | None:
    """A value as text that no other value has; None if a part of it is of no known kind."""
    try:
        return _exact(value)
    except TypeError:
        return None


def _exact(value: Any) -> str:
    """Numbers stand to the last bit, in Pinocchio's models with 17 digits, which is the same."""
    if value is None or isinstance(value, bool | int | float | str | np.generic):
        return repr(value)
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        return f"array({value.dtype.str} {value.shape} {value.tobytes().hex()})"
    if isinstance(value, pin.Model):
        return f"Model({value.saveToString()})"
    parts: Iterable[str]
    if isinstance(value, Mapping):
        parts = (f"{_exact(key)}: {_exact(item)}" for key, item in value.items())
    elif isinstance(value, list | tuple):
        parts = map(_exact, value)
    elif isinstance(value, BaseModel):
        parts = (f"{name}: {_exact(item)}" for name, item in value)
    elif is_dataclass(value):
        parts = (f"{one.name}: {_exact(getattr(value, one.name))}" for one in fields(value))
    else:
        raise TypeError(type(value))
    return f"{type(value).__qualname__}[{', '.join(parts)}]"


def _read(place: Path) -> Note | None:
    """A note, None if there is none or it is not as it was written."""
    content = compiler.own_file(place)
    if content is None or _sealed(text := content.partition(b"\n")[2]) != content:
        return None
    try:
        return Note.model_validate_json(text)
    except ValidationError:
        return None


def _sealed(text: bytes) -> bytes:
    return hashlib.sha256(text).hexdigest().encode() + b"\n" + text


def _digest(description: str, packages: tuple[Path, ...]) -> str:
    parts = description, software(packages)
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:40]


@cache
def software(packages: tuple[Path, ...]) -> str:
    """Digest of the sources of this package and of others, and of what they build on."""
    versions = (ca.__version__, pin.__version__, np.__version__)
    found = hashlib.sha256("\0".join(versions).encode())
    for folder in (*PACKAGES, *packages):
        for path in sorted(_sources([folder])):
            content = path.read_bytes()
            found.update(f"{path.relative_to(folder)}\0{len(content)}\0".encode() + content)
    return found.hexdigest()


def changed(packages: tuple[Path, ...]) -> bool:
    """Whether a source came or changed since the process began, and may not be what runs."""
    return any(path.stat().st_ctime > BEGAN for path in _sources([*PACKAGES, *packages]))


def _sources(folders: Iterable[Path]) -> Iterable[Path]:
    return (path for folder in folders for path in folder.rglob("*") if path.suffix in _SOURCES)
