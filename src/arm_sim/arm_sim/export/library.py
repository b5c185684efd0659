# SPDX-License-Identifier: Apache-2.0
"""The header and the source of an exported library."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence
from pathlib import Path

from arm_dynamics import ArmModel
from arm_dynamics.codegen import compiler
from arm_sim.export.generated import static_functions
from arm_sim.export.terms import Term

_INCLUDE = re.compile(r'#include "(\w+\.h)"\n')
_FOR_EDITORS = re.compile(
    r"^#ifndef LANES /\* read alone.*?^#else\n(.*)^#endif\n", re.DOTALL | re.MULTILINE
)
_COLUMNS = 100


def header(name: str, about: str, model: ArmModel, states: int, terms: Sequence[Term]) -> str:
    """``N.h`` of a library.

    Args:
        name: Name of the library.
        about: First comment.
        model: The arm.
        states: Length of the simulator's state.
        terms: Its functions.
    """
    guard, count = f"{name.upper()}_H", f"{name.upper()}_JOINTS"
    parts = [
        f"{comment(about)}#ifndef {guard}\n#define {guard}\n\n#include <stddef.h>\n",
        '#ifdef __cplusplus\nextern "C" {\n#endif\n',
        f"enum {{ {count} = {model.n}, {name.upper()}_STATES = {states} }};\n",
        comment("Order of all vectors.")
        + f"extern const char* const {name}_joint_names[{count}];\n",
        *(comment(term.about) + f"{_signature(name, term)};\n" for term in terms),
        "#ifdef __cplusplus\n}\n#endif\n\n#endif\n",
    ]
    return "\n".join(parts)


def source(name: str, about: str, model: ArmModel, terms: Sequence[Term]) -> str:
    """``N.c`` of a library; arguments as of ``header``."""
    functions = {term.function.name(): term.function for term in terms}
    names = ", ".join(f'"{joint}"' for joint in model.joint_names)
    parts = [
        f'{comment(about)}#include "{name}.h"\n',
        elementary(),
        static_functions(list(functions.values())),
        f"const char* const {name}_joint_names[{name.upper()}_JOINTS] = {{{names}}};\n",
        *(_definition(name, term) for term in terms),
    ]
    return "\n".join(parts)


def comment(text: str) -> str:
    """A comment in C of lines that are not too long."""
    lines = [
        line
        for paragraph in text.split("\n")
        for line in textwrap.wrap(paragraph, _COLUMNS - 3) or [""]
    ]
    if len(lines) == 1:
        return f"/* {lines[0]} */\n"
    return "/* " + "\n".join(lines).replace("\n", "\n * ").replace(" * \n", " *\n") + "\n */\n"


def elementary() -> str:
    """The elementary functions that generated code calls, and the types of its numbers."""
    types = "#define casadi_real real\n#define casadi_int long long\n"
    return _inlined("scalar.h", compiler.NATIVE) + types


def _inlined(file: str, folder: Path) -> str:
    """A header with those that it includes in their places."""
    text = _FOR_EDITORS.sub(r"\1", (folder / file).read_text())
    return _INCLUDE.sub(lambda found: _inlined(found[1], folder), text)


def _signature(name: str, term: Term) -> str:
    given = [f"const double* {x}" for x in term.arguments]
    arguments = ", ".join([*given, *(f"double* {x}" for x in term.results)])
    head = f"void {name}_{term.name}("
    return "\n".join(
        textwrap.wrap(f"{head}{arguments})", _COLUMNS - 2, subsequent_indent=" " * len(head))
    )


def _definition(name: str, term: Term) -> str:
    return (
        f"{_signature(name, term)} {{\n"
        f"  const double* arg[] = {{{', '.join(term.arguments)}}};\n"
        f"  double* res[] = {{{', '.join(term.results)}}};\n"
        f"  {term.function.name()}(arg, res, NULL, NULL, 0);\n"
        "}\n"
    )
