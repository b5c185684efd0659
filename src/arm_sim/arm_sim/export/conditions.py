# SPDX-License-Identifier: Apache-2.0
"""C source without the parts that its own definitions rule out."""

from __future__ import annotations

import re
from dataclasses import dataclass

_DEFINE = re.compile(r"#define (\w+)(?: (.*))?$")
_IF = re.compile(r"#(ifdef|ifndef|if) (.*?)(?: */\*.*)?$")
_DEFINED = re.compile(r"\bdefined (\w+)")
_WORD = re.compile(r"\b[A-Za-z_]\w*")


@dataclass
class _Block:
    """A condition that lines are subject to: whether they stay, and whether it was decided."""

    stays: bool
    decided: bool


def decided(source: str) -> str:
    """C source in which every condition on names is decided, but for those of compilers (``__``).

    A name counts as defined from its definition on.
    """
    defined, blocks, lines = dict[str, str](), list[_Block](), list[str]()
    for line in source.splitlines(keepends=True):
        here = all(block.stays for block in blocks)
        if line.startswith("#if"):
            blocks.append(_begun(line.rstrip(), defined))
            keeps = here and not blocks[-1].decided
        elif line.startswith(("#else", "#elif", "#endif")):
            block = blocks.pop() if line.startswith("#endif") else blocks[-1]
            keeps = not block.decided and all(other.stays for other in blocks)
            block.stays ^= block.decided
        else:
            keeps = here
            if here and (found := _DEFINE.match(line.rstrip())):
                defined[found[1]] = found[2] or ""
        if keeps:
            lines.append(line)
    return "".join(lines)


def _begun(line: str, defined: dict[str, str]) -> _Block:
    found = _IF.match(line)
    if found is None or "__" in line:
        return _Block(True, decided=False)
    kind, condition = found.groups()
    if kind == "if":
        return _Block(_is_true(condition, defined), decided=True)
    return _Block((condition in defined) == (kind == "ifdef"), decided=True)


def _is_true(condition: str, defined: dict[str, str]) -> bool:
    """Whether a condition on names holds, as in ``NB && ND``, ``NC == 0``, ``defined FREE``."""
    condition = _DEFINED.sub(lambda word: str(int(word[1] in defined)), condition)

    def number(word: re.Match[str]) -> str:
        value = defined.get(word[0], "0")
        return _WORD.sub(number, value)

    plain = _WORD.sub(number, condition).replace("&&", " and ").replace("||", " or ")
    if not re.fullmatch(r"[\d\s()<>=+*-]|(?:[\d\s()<>=+*-]|and|or)+", plain):
        raise ValueError(f"cannot decide '#if {condition}'")
    return bool(eval(plain))  # noqa: S307 - digits and operators only
