# SPDX-License-Identifier: Apache-2.0
"""The engine and a scene in one file of C."""

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from arm_dynamics.codegen import compiler
from arm_sim.stepping.engine import NATIVE

OWN = Path(__file__).parent / "native"
# Files that stand in another place of a library
ELSEWHERE = frozenset({"scalar.h"})
_FOLDERS = (OWN, NATIVE, compiler.NATIVE)
_FIRST_COMMENT = re.compile(r"\A/\*.*?\*/\n", re.DOTALL)
_INCLUDE = re.compile(r'^#include "([\w/]+\.[ch])"\n', re.MULTILINE)


def of_files(files: Sequence[str], included: Iterable[str] = ()) -> str:
    """C of files one after another, see ``amalgamated``."""
    return amalgamated("".join(f'#include "{file}"\n' for file in files), {*included})


def amalgamated(text: str, included: set[str]) -> str:
    """C with the files that it includes in their places, each once; what they export is static.

    First comments of this package's own files, which say what they need, are left out.

    Args:
        text: The source.
        included: Files that are there already, as they are included; others are added.
    """

    def contents(include: re.Match[str]) -> str:
        if (file := include[1]) in included:
            return ""
        included.add(file)
        [path] = (folder / file for folder in _FOLDERS if (folder / file).is_file())
        own = path.read_text(encoding="utf-8").replace("\nEXPORTED ", "\nstatic ")
        return amalgamated(_FIRST_COMMENT.sub("", own) if path.parent == OWN else own, included)

    return _INCLUDE.sub(contents, text.replace("#pragma once\n", ""))
