# SPDX-License-Identifier: Apache-2.0
"""Long generated C functions, divided into short ones.

A compiler shares registers out to all of a function at once, which takes more time for each
operation the longer the function is. In pieces a chain of 50 joints compiles in half the time; it
runs some percent slower, since what a later piece needs goes through memory. The operations and
their order stay the same, and so do the bits.
"""

from __future__ import annotations

import re

# Lines of a piece, and up to how many a function stays whole: an arm of ten joints has 2000.
# Pieces of half the length compile no faster, and longer ones run no faster.
PIECE = 1000
WHOLE = 3000

# What CasADi writes for a function of scalars: declarations of a0, a1, … and assignments.
_FUNCTION = re.compile(
    r"^static int (\w+)\((.*?)\) \{\n((?:  casadi_real a\d[a\d, ]*;\n)+)(.*?)  return 0;\n\}\n",
    re.DOTALL | re.MULTILINE,
)
_PLAIN = re.compile(r"  (?:if \(res\[\d+\]!=0\) res\[\d+\]\[\d+\]|a\d+)=[^;{}]*;")
_VARIABLE = re.compile(r"\ba\d+\b")
_WRITTEN = re.compile(r"  (a\d+)=")


def divided(source: str, whole: int = WHOLE, piece: int = PIECE) -> str:
    """Divide the long functions of generated C source.

    Args:
        source: As CasADi generates it.
        whole: Functions of up to so many lines stay as they are.
        piece: Lines of a piece.

    Returns:
        The source; functions that are not plain lists of assignments stay as they are.
    """

    def division(match: re.Match[str]) -> str:
        name, parameters, declarations, body = match.groups()
        lines = body.splitlines()
        if len(lines) <= whole or not all(map(_PLAIN.fullmatch, lines)):
            return match.group()
        parts = [lines[k : k + piece] for k in range(0, len(lines), piece)]
        places = {a: k for k, a in enumerate(_VARIABLE.findall(declarations))}
        return _pieces(name, parts, places) + _caller(name, parameters, len(parts), len(places))

    return _FUNCTION.sub(division, source)


def _pieces(name: str, parts: list[list[str]], places: dict[str, int]) -> str:
    """C functions of all pieces; ``live`` hands on the variables that later pieces read."""
    needed: set[str] = set()
    text: list[str] = []
    for number, lines in reversed(list(enumerate(parts))):
        read, written = _use(lines)
        head = f"static __attribute__((noinline)) void {name}_{number}"
        arguments = "(const casadi_real** arg, casadi_real** res, casadi_real* live)"
        declaration = f"  casadi_real {', '.join(sorted(read | written))};"
        body = _with_moves(lines, read, needed & written, places)
        text.insert(0, "\n".join([f"{head}{arguments} {{", declaration, *body, "}\n"]))
        needed = read | (needed - written)
    return "".join(text)


def _use(lines: list[str]) -> tuple[set[str], set[str]]:
    """Variables that are read before they are written, and all that are written."""
    read, written = set[str](), set[str]()
    for line in lines:
        target, sources = _target_and_sources(line)
        read |= set(sources) - written
        written |= {target} - {""}
    return read, written


def _with_moves(
    lines: list[str], read: set[str], kept: set[str], places: dict[str, int]
) -> list[str]:
    """Lines with ``read`` loaded right before the first use and ``kept`` stored when final.

    Loads and stores that all stand at the ends would fill the registers twice.
    """
    last = {_target_and_sources(line)[0]: k for k, line in enumerate(lines)}
    missing, moved = set(read), list[str]()
    for k, line in enumerate(lines):
        target, sources = _target_and_sources(line)
        moved += [f"  {a}=live[{places[a]}];" for a in dict.fromkeys(sources) if a in missing]
        missing -= {target, *sources}
        moved.append(line)
        if target in kept and last[target] == k:
            moved.append(f"  live[{places[target]}]={target};")
    return moved


def _target_and_sources(line: str) -> tuple[str, list[str]]:
    """Variable that a line writes, empty for a result, and those that it reads."""
    target, names = _WRITTEN.match(line), _VARIABLE.findall(line)
    return (target.group(1), names[1:]) if target else ("", names)


def _caller(name: str, parameters: str, count: int, variables: int) -> str:
    calls = "".join(f"  {name}_{k}(arg, res, live);\n" for k in range(count))
    memory = f"  casadi_real live[{variables}];\n"
    return f"static int {name}({parameters}) {{\n{memory}{calls}  return 0;\n}}\n"
