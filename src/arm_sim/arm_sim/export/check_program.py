# SPDX-License-Identifier: Apache-2.0
"""The test program of an exported library: its functions against the numbers expected."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path

from arm_dynamics.arrays import Array
from arm_sim.export.expected import Expected
from arm_sim.export.library import comment
from arm_sim.export.terms import Term

_NATIVE = Path(__file__).parent / "native"


def check_program(
    name: str,
    about: str,
    terms: Sequence[Term],
    expected: Expected,
    points: Sequence[tuple[Array, Array, Array]],
) -> str:
    """``test_N.c`` of a library.

    Args:
        name: Name of the library.
        about: First comment.
        terms: Its functions.
        expected: Their right results.
        points: q, v, and a or tau at which they are compared.
    """
    checks = _Checks(name)
    for k, point in enumerate(points):
        checks.at(k, *point)
        for term in terms:
            checks.compare(k, term, expected.of(term, *point))
    return "\n".join(
        [
            comment(about) + f'#include "{name}.h"\n',
            (_NATIVE / "check.h").read_text().replace("#pragma once\n", ""),
            *checks.tables,
            "\nint main(void) {\n  int wrong = 0;",
            *checks.calls,
            '  printf(wrong ? "%d results are wrong\\n" : "all results are right\\n", wrong);',
            "  return wrong != 0;\n}\n",
        ]
    )


class _Checks:
    """Tables of numbers, and calls that compare with them."""

    def __init__(self, name: str) -> None:
        self._name = name
        self.tables, self.calls = list[str](), list[str]()

    def at(self, k: int, q: Array, v: Array, a: Array) -> None:
        self.tables += [_table(f"q{k}", q), _table(f"v{k}", v), _table(f"a{k}", a)]

    def compare(self, k: int, term: Term, results: Sequence[Array]) -> None:
        given = [f"{'a' if x == 'tau' else x}{k}" for x in term.arguments]
        made = [f"got{i}" for i in range(len(results))]
        lines = [f"double got{i}[{values.size}];" for i, values in enumerate(results)]
        lines.append(f"{self._name}_{term.name}({', '.join([*given, *made])});")
        for i, values in enumerate(results):
            table = f"{term.name}_{k}" + (f"_{term.results[i]}" if i else "")
            self.tables.append(_table(table, values))
            lines.append(f'wrong += differs("{term.name}", got{i}, {table}, {values.size});')
        self.calls.append("  {\n    " + "\n    ".join(lines) + "\n  }")


def _table(name: str, values: Array) -> str:
    """Numbers as a table in C, to the last bit."""
    numbers = ", ".join(repr(float(value)) for value in values)
    text = f"static const double {name}[{values.size}] = {{{numbers}}};"
    return "\n".join(textwrap.wrap(text, 98, subsequent_indent="    "))
