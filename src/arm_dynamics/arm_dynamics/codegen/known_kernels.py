# SPDX-License-Identifier: Apache-2.0
"""Kernels that are recalled by their inputs, without generating their source.

To find compiled code by the digest of its source, that source must be generated, which takes
seconds for an arm of a hundred joints. A note in the user's own cache maps a recipe, the inputs of
the source such as scene, method and versions, to its code.
"""

import hashlib
import os
from functools import cache
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from arm_dynamics.codegen import compiler, user_cache
from arm_dynamics.codegen.compiled_scenes import Code


class Signature(BaseModel):
    """Signature of a compiled function.

    Attributes:
        name: Its name.
        inputs: Rows and columns of its arguments.
        outputs: Rows and columns of its results.
        sizes: Numbers of pointers to arguments and to results, and of integers and reals it needs.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    inputs: tuple[tuple[int, int], ...]
    outputs: tuple[tuple[int, int], ...]
    sizes: tuple[int, int, int, int]


class Note(BaseModel):
    """Description of a kernel in the cache.

    Attributes:
        key: Key of its code, see ``Code.key``.
        functions: Its functions.
        operations: Arithmetic operations in one call of each.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    key: str
    functions: tuple[Signature, ...]
    operations: dict[str, int]


def recall(recipe: str) -> tuple[Code, Note] | None:
    """The code of a recipe; None if there is no note, or its code no longer exists."""
    if (content := user_cache.read(_note_file(recipe))) is None:
        return None
    try:
        note = Note.model_validate_json(content)
    except ValidationError:  # of another version
        return None
    code = compiler.find(note.key)
    return (code, note) if code else None


def keep(recipe: str, note: Note) -> None:
    """Note which code belongs to a recipe."""
    user_cache.write(_note_file(recipe), note.model_dump_json().encode())


@cache
def digest_of(*packages: str) -> str:
    """Digest of all Python and C files below folders, such as those of packages."""
    digest = hashlib.sha256()
    for package in packages:
        for folder, folders, files in os.walk(package):
            folders.sort()
            for name in sorted(files):
                if name.endswith((".py", ".c", ".h", ".hpp")):
                    with open(os.path.join(folder, name), "rb") as file:
                        digest.update(f"\0{name}\0".encode() + file.read())
    return digest.hexdigest()


def _note_file(recipe: str) -> Path:
    return user_cache.folder() / f"{user_cache.digest(recipe)}.json"
