# SPDX-License-Identifier: Apache-2.0
"""The test program of an exported library: its functions against reference values."""

from collections.abc import Sequence

from arm_dynamics.arrays import Array
from arm_sim.export.amalgamated import of_files
from arm_sim.export.generated import without_unused
from arm_sim.export.library import Library, comment, wrapped
from arm_sim.export.reference_values import Point, ReferenceMotion, ReferenceResults, test_motion
from arm_sim.export.terms import Term
from arm_sim.export.tick import Tick

_ROUNDING = 1e-12  # difference of results here and there, relative to the largest or 1


def check_program(library: Library, reference: ReferenceResults, points: Sequence[Point]) -> str:
    """``test_N.c`` of a library.

    Args:
        library: The library.
        reference: Right results of its functions.
        points: Where they are compared.
    """
    checks = _Checks(library)
    for k, point in enumerate(points):
        checks.add_point(k, *point)
        for term in library.terms:
            checks.add_term(k, term, reference.of(term, *point))
    if library.tick:
        checks.add_motion(library.tick)
    program = [
        comment(library.about) + f'#include "{library.name}.h"\n', of_files(["check.h"]),
        *checks.tables, "\nint main(void) {\n  int wrong = 0;", *checks.calls,
        '  printf(wrong ? "%d results are wrong\\n" : "all results are right\\n", wrong);',
        "  return wrong != 0;\n}\n",
    ]  # fmt: skip
    return without_unused("\n".join(program))


class _Checks:
    """Tables of numbers, and calls that compare with them."""

    def __init__(self, library: Library) -> None:
        self._name = library.name
        self.tables, self.calls = list[str](), list[str]()

    def add_point(self, k: int, q: Array, v: Array, a: Array) -> None:
        for name, values in (("q", q), ("v", v), ("a", a)):
            self.tables.append(_table(f"{name}{k}", values))

    def add_term(self, k: int, term: Term, results: Sequence[Array]) -> None:
        """Add a call of a term at point k, and the comparison with its right results."""
        tables = {"q": f"q{k}", "v": f"v{k}", "a": f"a{k}", "tau": f"a{k}"}  # a or tau
        inputs = [tables.get(x, "NULL") for x in term.arguments]
        outputs = [f"result{i}" for i in range(len(results))]
        lines = [f"double result{i}[{values.size}];" for i, values in enumerate(results)]
        lines.append(f"{self._name}_{term.name}({', '.join([*inputs, *outputs])});")
        for i, values in enumerate(results):
            table = f"{term.name}_{k}" + (f"_{term.results[i]}" if i else "")
            self.tables.append(_table(table, values))
            arguments = f'"{term.name}", result{i}, {table}, {values.size}, {_ROUNDING}'
            lines.append(f"wrong += differs({arguments});")
        self.calls.append("  {\n    " + "\n    ".join(lines) + "\n  }")

    def add_motion(self, tick: Tick) -> None:
        """Ticks under a few commands, each held for some time, from the scene's initial state."""
        motion = test_motion(tick.simulator, differentiable=tick.differentiable)
        name, n, tolerance = self._name, tick.simulator.n, _ROUNDING
        ticks = motion.duration * len(motion.commands)
        tables = {"commands": motion.commands.ravel(), "last_q": motion.q, "last_v": motion.v}
        for matrix, slope in zip("AB", motion.derivatives or (), strict=False):
            tables[f"expected_{matrix}"] = slope.ravel()
        self.tables += [_table(table, values) for table, values in tables.items()]
        self.calls.append(
            "  {\n"
            f"    double q[{n}], v[{n}];\n"
            f"    {name}_sim* sim = ({name}_sim*)malloc({name}_sim_size());\n"
            f"    int code = sim ? {name}_sim_init(sim, NULL, NULL) : -1;\n"
            f"    for (int k = 0; k < {ticks} && !code; ++k)\n"
            f"      code = {name}_sim_step(sim, commands + {n} * (k / {motion.duration}));\n"
            f'    if (code) printf("ticks: %s\\n", {name}_error_text(code));\n'
            f"    wrong += code != 0;\n"
            f"    if (!code) {name}_sim_state(sim, q, v, NULL);\n"
            f'    if (!code) wrong += differs("{ticks} ticks, q", q, last_q, {n}, {tolerance});\n'
            f'    if (!code) wrong += differs("{ticks} ticks, v", v, last_v, {n}, {tolerance});\n'
            f"{self._derivatives_check(motion)}"
            f'    printf("a simulation takes %lu bytes\\n", (unsigned long){name}_sim_size());\n'
            "    free(sim);\n"
            "  }"
        )

    def _derivatives_check(self, motion: ReferenceMotion) -> str:
        """Derivatives at the end of the ticks; a refusal, which they may get, is no mistake."""
        if motion.derivatives is None:
            return ""
        name, sizes = self._name, [slope.size for slope in motion.derivatives]
        last = motion.commands.size - motion.commands.shape[1]
        checks = "".join(
            f'    if (!code) wrong += differs("derivatives, {matrix}", {matrix}, '
            f"expected_{matrix}, {size}, {_ROUNDING});\n"
            for matrix, size in zip("AB", sizes, strict=True)
        )
        return (
            f"    double A[{sizes[0]}], B[{sizes[1]}];\n"
            f"    if (!code) code = {name}_sim_linearize(sim, commands + {last}, A, B);\n"
            f'    if (code) printf("derivatives: %s\\n", {name}_error_text(code));\n{checks}'
        )


def _table(name: str, values: Array) -> str:
    """Numbers as a table in C, to the last bit."""
    numbers = ", ".join(f"{float(value)!r}" for value in values)
    text = f"static const double {name}[{values.size}] = {{{numbers}}};"
    return wrapped(text, subsequent_indent="    ")
