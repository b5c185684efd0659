# SPDX-License-Identifier: Apache-2.0
"""C source without the parts that its own definitions rule out."""

from __future__ import annotations

import re
from dataclasses import dataclass

_DEFINE = re.compile(r"#define (\w+)(?: (.*))?$")
_IF = re.compile(r"#(ifdef|ifndef|if) (.*?)(?: */\*.*)?$")


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
    """Whether a condition holds: a name, which must not be 0, or ``NAME == number``."""
    name, _, number = condition.partition(" == ")
    value = defined.get(name, "0")
    return value == number if number else value != "0"
