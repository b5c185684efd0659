# SPDX-License-Identifier: Apache-2.0
"""Long generated C functions, divided into short ones.

A compiler allocates registers for a whole function at once, which takes more time per operation
the longer the function is. In pieces a chain of 50 joints compiles in half the time; it runs a few
percent slower, since values pass between pieces through memory. The operations and their order
stay the same, and so do the results, bit for bit. Pieces may be compiled on several cores.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

# Lines of a piece: half as many compile no faster, and more run no faster.
PIECE_LINES = 1000
# Lines up to which a function stays undivided: an arm of ten joints has 2000.
UNDIVIDED_LINES = 3000

# What CasADi writes for a function of scalars: declarations of a0, a1, … and assignments.
_FUNCTION = re.compile(
    r"^static int (\w+)\((.*?)\) \{\n((?:  casadi_real a\d[a\d, ]*;\n)+)(.*?)  return 0;\n\}\n",
    re.DOTALL | re.MULTILINE,
)
_PLAIN = re.compile(r"  (?:if \(res\[\d+\]!=0\) res\[\d+\]\[\d+\]|a\d+)=[^;{}]*;")
_VARIABLE = re.compile(r"\ba\d+\b")
_WRITTEN = re.compile(r"  (a\d+)=")

# Where what every piece needs ends, and where a piece begins and ends.
_HEAD_ENDS = "/* end of what every piece needs */\n"
_AFTER_HELPERS = "/* Configuration this file was compiled with */\n"  # as CasADi writes it
_PIECE = re.compile(r"/\* piece \*/\n(.*?)/\* end of piece \*/\n", re.DOTALL)
_SIGNATURE = re.compile(r".*?\)(?= \{$)", re.MULTILINE)


@dataclass(frozen=True)
class _Line:
    """A line of C.

    Attributes:
        text: The line.
        target: Variable that it writes; empty for a result.
        sources: Variables that it reads.
    """

    text: str
    target: str
    sources: list[str]

    @staticmethod
    def of(text: str) -> _Line:
        target, names = _WRITTEN.match(text), _VARIABLE.findall(text)
        return _Line(text, target.group(1), names[1:]) if target else _Line(text, "", names)


def divided(source: str, whole: int = UNDIVIDED_LINES, piece: int = PIECE_LINES) -> str:
    """Generated C source with its long functions divided.

    Those of up to ``whole`` lines stay as they are, and those that are not plain lists of
    assignments.
    """

    def division(match: re.Match[str]) -> str:
        name, parameters, declarations, body = match.groups()
        lines = body.splitlines()
        if len(lines) <= whole or not all(map(_PLAIN.fullmatch, lines)):
            return match.group()
        parsed = list(map(_Line.of, lines))
        parts = [parsed[k : k + piece] for k in range(0, len(parsed), piece)]
        places = {a: k for k, a in enumerate(_VARIABLE.findall(declarations))}
        calls = "".join(f"  {name}_{k}(arg, res, live);\n" for k in range(len(parts)))
        memory = f"  casadi_real live[{len(places)}];\n"
        caller = f"static int {name}({parameters}) {{\n{memory}{calls}  return 0;\n}}\n"
        return _pieces(name, parts, places) + caller

    text = _FUNCTION.sub(division, source)
    return text if text == source else text.replace(_AFTER_HELPERS, _HEAD_ENDS + _AFTER_HELPERS, 1)


def units(source: str, count: int) -> list[str]:
    """At most ``count`` source files, about as long as one another, that make up divided source.

    The source alone if it has no pieces.
    """
    head, mark, rest = source.partition(_HEAD_ENDS)
    if not mark or count < 2:
        return [source]
    others: list[list[str]] = [[] for _ in range(count - 1)]
    lengths = [len(_PIECE.sub("", source)), *(0 for _ in others)]

    def place(match: re.Match[str]) -> str:
        shortest = min(range(count), key=lengths.__getitem__)
        lengths[shortest] += len(match.group())
        if not shortest:
            return match.group()
        others[shortest - 1].append(match.group())
        signature = _SIGNATURE.match(match.group(1))
        assert signature is not None
        return f"{signature.group()};\n"

    main = head + _PIECE.sub(place, rest)
    # In each file, the helpers that CasADi writes have names of their own.
    prefix = "#define CASADI_CODEGEN_PREFIX\n#define CODEGEN_PREFIX unit{}_\n"
    files = (prefix.format(k) + head + "".join(x) for k, x in enumerate(others) if x)
    return [main, *files]


def _pieces(name: str, parts: list[list[_Line]], places: dict[str, int]) -> str:
    """C functions of all pieces; ``live`` hands on the variables that later pieces read."""
    needed, text = set[str](), list[str]()
    for number, lines in reversed(list(enumerate(parts))):
        read, written = _use(lines)
        head = f"/* piece */\n__attribute__((noinline)) void {name}_{number}"
        arguments = "(const casadi_real** arg, casadi_real** res, casadi_real* live)"
        declaration = f"  casadi_real {', '.join(sorted(read | written))};"
        body = _with_moves(lines, read, needed & written, places)
        end = "}\n/* end of piece */\n"
        text.insert(0, "\n".join([f"{head}{arguments} {{", declaration, *body, end]))
        needed = read | (needed - written)
    return "".join(text)


def _use(lines: list[_Line]) -> tuple[set[str], set[str]]:
    """Variables that are read before they are written, and all that are written."""
    read, written = set[str](), set[str]()
    for line in lines:
        read.update(a for a in line.sources if a not in written)
        written.add(line.target)
    return read, written - {""}


def _with_moves(
    lines: list[_Line], read: set[str], kept: set[str], places: dict[str, int]
) -> list[str]:
    """Lines with ``read`` loaded right before the first use and ``kept`` stored when final.

    Loads and stores that all stand at the ends would fill the registers twice.
    """
    last = {line.target: k for k, line in enumerate(lines)}
    missing, moved = set(read), list[str]()
    for k, line in enumerate(lines):
        for a in dict.fromkeys(line.sources):
            if a in missing:
                moved.append(f"  {a}=live[{places[a]}];")
        missing.difference_update(line.sources)
        missing.discard(line.target)
        moved.append(line.text)
        if line.target in kept and last[line.target] == k:
            moved.append(f"  live[{places[line.target]}]={line.target};")
    return moved
