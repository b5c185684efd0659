# SPDX-License-Identifier: Apache-2.0
"""Kernels that are found again by what they are made of, without writing their equations.

To find compiled code by the digest of its source, that source must be generated, which takes
seconds for an arm of a hundred joints. A note in the user's own cache says which code belongs to a
recipe: everything that the source is made of, such as scene, method and versions.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from arm_dynamics.codegen import compiler
from arm_dynamics.codegen.compiled_scenes import Code


class Signature(BaseModel):
    """What a caller must know of a compiled function.

    Attributes:
        name: Its name.
        inputs: Rows and columns of its arguments.
        outputs: Those of its results.
        sizes: How many pointers to arguments and to results, integers and reals it works with.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    inputs: tuple[tuple[int, int], ...]
    outputs: tuple[tuple[int, int], ...]
    sizes: tuple[int, int, int, int]


class Note(BaseModel):
    """What is kept of a kernel.

    Attributes:
        key: Which code it is, see ``Code.key``.
        functions: What it can do.
        operations: Arithmetic operations in one call of each.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    key: str
    functions: tuple[Signature, ...]
    operations: dict[str, int]


def recall(recipe: str) -> tuple[Code, Note] | None:
    """The code of a recipe; None if there is no note, or its code is not there any more."""
    content = compiler.read_sound(_place(recipe))
    if content is None:
        return None
    try:
        note = Note.model_validate_json(content)
    except ValidationError:  # of another version
        return None
    code = compiler.find(note.key)
    return (code, note) if code else None


def keep(
    recipe: str, key: str, functions: tuple[Signature, ...], operations: Mapping[str, int]
) -> None:
    """Note which code belongs to a recipe."""
    note = Note(key=key, functions=functions, operations=dict(operations))
    compiler.write_sound(_place(recipe), note.model_dump_json().encode())


@cache
def digest_of(*packages: str) -> str:
    """Digest of all that is written in Python and C below folders, such as those of packages."""
    files = sorted(
        path for folder in packages for path in Path(folder).rglob("*")
        if path.suffix in (".py", ".c", ".h", ".hpp")
    )  # fmt: skip
    return compiler.digest(*(text for path in files for text in (path.name, path.read_text())))


def _place(recipe: str) -> Path:
    return compiler.cache_folder() / f"{compiler.digest(recipe)}.json"
