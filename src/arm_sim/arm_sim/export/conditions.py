# SPDX-License-Identifier: Apache-2.0
"""C source without the parts that its own definitions rule out."""

import re
from dataclasses import dataclass

_DEFINE = re.compile(r"#define (\w+)(.*)$")
_IF = re.compile(r"#(ifdef|ifndef|if) ([A-Za-z_]\w*)(?: == (\d+))?(?: */\*.*)?$")


@dataclass
class _Conditional:
    """A condition that lines are subject to: whether they stay, and whether it was decided."""

    active: bool
    decided: bool


def without_decided_conditions(source: str) -> str:
    """C source in which every condition on names is decided, but for those of compilers (``__``).

    A name counts as defined from its definition on, in whichever branch of a compiler's condition.

    Raises:
        ValueError: If one is none of ``#ifdef NAME``, ``#ifndef NAME``, ``#if NAME`` and ``#if
            NAME == number``, the value of a name is no whole number, or there is ``#undef``.
    """
    defined, conditionals, lines = dict[str, str](), list[_Conditional](), list[str]()
    for line in source.splitlines(keepends=True):
        active = all(condition.active for condition in conditionals)
        if line.startswith("#if"):
            conditionals.append(_conditional(line.rstrip(), defined))
            keeps = active and not conditionals[-1].decided
        elif line.startswith(("#else", "#endif")):
            last = conditionals.pop() if line.startswith("#endif") else conditionals[-1]
            keeps = not last.decided and all(outer.active for outer in conditionals)
            last.active ^= last.decided
        elif line.startswith(("#elif", "#undef")):
            raise ValueError(f"{line.rstrip()!r}; allowed: neither #elif nor #undef")
        else:
            keeps = active
            if active and (definition := _DEFINE.match(line.rstrip())):
                defined[definition[1]] = definition[2].strip()
        if keeps:
            lines.append(line)
    return "".join(lines)


def _conditional(line: str, defined: dict[str, str]) -> _Conditional:
    """What is known of a condition, from its line and the definitions before it."""
    if "__" in line:
        return _Conditional(True, decided=False)
    condition = _IF.match(line)
    kind, name, number = condition.groups() if condition else ("if", line, None)
    if kind != "if":
        return _Conditional((name in defined) == (kind == "ifdef"), decided=True)
    value = defined.get(name, "0") if condition else ""
    if not value.isdecimal():
        raise ValueError(f"{line!r}; allowed: #ifdef NAME, #if NAME and #if NAME == number")
    return _Conditional(value == number if number else value != "0", decided=True)
