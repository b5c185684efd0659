# SPDX-License-Identifier: Apache-2.0
"""C of CasADi functions without what only CasADi itself asks for.

CasADi writes a file that a program may load at run time, with a dozen functions that describe each
one. A library keeps the functions and the helpers that they use, all of them static, so that
several libraries can be linked into one program. The arithmetic is not touched.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

import casadi as ca

from arm_dynamics.codegen import generate

_FUNCTION = re.compile(
    r"\A((?:static )?[^\n]*\()([^()\n]*\bcasadi_real\*\* arg[^()\n]*)(\) ?\{\n)"
)
_EXPORT = "CASADI_SYMBOL_EXPORT "
_NAME = re.compile(r"(\w+)[(\[]")
_WORD = re.compile(r"\w+")
# CasADi's helpers call fmax and fmin only where C99 is declared, which C++ does not do.
_OLD_C = re.compile(r"^/\* Pre-c99.*?^#else\n(.*?)^#endif\n", re.DOTALL | re.MULTILINE)


def static_functions(functions: Sequence[ca.Function]) -> str:
    """C source of functions, each ``static int NAME(arg, res, iw, w, mem)``.

    Required definitions: ``casadi_real`` and ``casadi_int``, and the elementary functions of
    ``codegen/native/scalar.h``.
    """
    found = dict(_definitions(generate(functions)))
    kept = _reachable(found, [function.name() for function in functions])
    return "\n".join(_static(text) for name, text in found.items() if name in kept)


def _definitions(source: str) -> Iterator[tuple[str, str]]:
    """Names and texts of the functions and tables of generated source, in their order."""
    lines: list[str] = []
    for line in source.splitlines(keepends=True):
        if not lines and not line[0].isalpha() and not line.startswith("_"):
            continue  # between definitions
        lines.append(line)
        if line == "}\n" or (len(lines) == 1 and line.rstrip().endswith(("}", ";"))):
            text, lines = "".join(lines), []
            yield _NAME.findall(text.replace("__attribute__((", ""))[0], text


def _reachable(definitions: Mapping[str, str], names: Sequence[str]) -> set[str]:
    """The definitions that some need, themselves included."""
    found, left = set[str](), list(names)
    while left:
        if (name := left.pop()) not in found:
            found.add(name)
            left += definitions.keys() & set(_WORD.findall(definitions[name]))
    return found


def _static(text: str) -> str:
    text = _OLD_C.sub(r"\1", text.removeprefix(_EXPORT))
    text = _FUNCTION.sub(_with_unused, text)
    return text if text.startswith("static ") else f"static {text}"


def _with_unused(head: re.Match[str]) -> str:
    """The head of a function that says that some of its arguments may not be used."""
    names = (argument.split()[-1].lstrip("*") for argument in head[2].split(","))
    return f"{head[0]}  {', '.join(f'(void){name}' for name in names)};\n"
