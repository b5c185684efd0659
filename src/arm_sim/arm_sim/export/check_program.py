# SPDX-License-Identifier: Apache-2.0
"""The test program of an exported library: its functions against the numbers expected."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path

from arm_dynamics.arrays import Array
from arm_sim.export.expected import Expected, ran
from arm_sim.export.generated import without_unused
from arm_sim.export.library import comment
from arm_sim.export.terms import Term
from arm_sim.export.tick import Tick

_NATIVE = Path(__file__).parent / "native"


def check_program(
    name: str,
    about: str,
    terms: Sequence[Term],
    expected: Expected,
    points: Sequence[tuple[Array, Array, Array]],
    tick: Tick | None,
) -> str:
    """``test_N.c`` of a library.

    Args:
        name: Name of the library.
        about: First comment.
        terms: Its functions.
        expected: Their right results.
        points: q, v, and a or tau at which they are compared.
        tick: Its tick, if any.
    """
    checks = _Checks(name)
    for k, point in enumerate(points):
        checks.at(k, *point)
        for term in terms:
            checks.compare(k, term, expected.of(term, *point))
    if tick:
        checks.run(tick)
    program = [
        comment(about) + f'#include "{name}.h"\n',
        (_NATIVE / "check.h").read_text().replace("#pragma once\n", ""),
        *checks.tables,
        "\nint main(void) {\n  int wrong = 0;",
        *checks.calls,
        '  printf(wrong ? "%d results are wrong\\n" : "all results are right\\n", wrong);',
        "  return wrong != 0;\n}\n",
    ]
    return without_unused("\n".join(program))


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

    def run(self, tick: Tick) -> None:
        """Ticks under a few commands, each held for some time, from the scene's initial state."""
        motion = ran(tick.simulator)
        name, n = self._name, tick.simulator.n
        self.tables += [
            _table("commands", motion.commands.ravel()),
            _table("last_q", motion.q),
            _table("last_v", motion.v),
        ]
        self.calls.append(
            "  {\n"
            f"    double q[{n}], v[{n}];\n"
            f"    {name}_sim* sim = ({name}_sim*)malloc({name}_sim_size());\n"
            f"    int code = sim ? {name}_sim_init(sim, NULL, NULL) : -1;\n"
            f"    for (int k = 0; k < {motion.ticks} && !code; ++k)\n"
            f"      code = {name}_sim_step(sim, commands + {n} * (k / {motion.held}));\n"
            f'    if (code) printf("ticks: %s\\n", {name}_error_text(code));\n'
            f"    wrong += code != 0;\n"
            f"    if (!code) {name}_sim_state(sim, q, v, NULL);\n"
            f'    if (!code) wrong += differs("{motion.ticks} ticks, q", q, last_q, {n});\n'
            f'    if (!code) wrong += differs("{motion.ticks} ticks, v", v, last_v, {n});\n'
            f'    printf("a simulation takes %lu bytes\\n", (unsigned long){name}_sim_size());\n'
            "    free(sim);\n"
            "  }"
        )


def _table(name: str, values: Array) -> str:
    """Numbers as a table in C, to the last bit."""
    numbers = ", ".join(repr(float(value)) for value in values)
    text = f"static const double {name}[{values.size}] = {{{numbers}}};"
    return "\n".join(textwrap.wrap(text, 98, subsequent_indent="    "))
