# SPDX-License-Identifier: Apache-2.0
"""The header and the source of an exported library."""

import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from arm_dynamics import ArmModel
from arm_sim.export.amalgamated import of_files
from arm_sim.export.at_rest import PREFIX, at_rest
from arm_sim.export.conditions import without_decided_conditions
from arm_sim.export.generated import c_string, static_functions, without_unused
from arm_sim.export.terms import Term
from arm_sim.export.tick import Tick

_TYPES = "#define casadi_real real\n#define casadi_int long long\n"
_STANDARD = re.compile(r"^#include <[^>\n]+>\n", re.MULTILINE)
_COLUMNS = 100  # of lines of the header
# Code in lines that are not too long, unless a name is, which stays whole
wrapped = partial(textwrap.fill, width=98, break_long_words=False, break_on_hyphens=False)
_PRAGMAS = """\
/* The same bits under all flags: no fused multiply-add, which GCC's vectorizer of straight code
 * also makes where it is forbidden. And no function of a library in the place of a loop.
 */
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#if __has_attribute(no_builtin)
#pragma clang attribute push(__attribute__((no_builtin("memset"))), apply_to = function)
#endif
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off", "no-tree-slp-vectorize")
#pragma GCC optimize("no-tree-loop-distribute-patterns")
#endif
/* Functions of the engine take the scene, whose sizes are constants here. */
#pragma GCC diagnostic ignored "-Wunused-parameter"
"""
_END = """
#if defined(__clang__)
#if __has_attribute(no_builtin)
#pragma clang attribute pop
#endif
#endif
"""


@dataclass(frozen=True)
class Library:
    """A library.

    Attributes:
        name: Its name.
        about: First comment of its files.
        model: The arm.
        terms: Its functions.
        tick: Its tick, if any.
    """

    name: str
    about: str
    model: ArmModel
    terms: Sequence[Term]
    tick: Tick | None


def header(library: Library) -> str:
    """``N.h`` of a library."""
    name, tick, n = library.name, library.tick, library.model.n
    capitals = name.upper()
    states = tick.simulator.arm.plant.nx if tick else 2 * n
    parts = [
        f"{comment(library.about)}#ifndef {capitals}_H\n#define {capitals}_H\n\n"
        "#include <stddef.h>\n", '#ifdef __cplusplus\nextern "C" {\n#endif\n',
        f"enum {{ {capitals}_JOINTS = {n}, {capitals}_STATES = {states} }};\n",
        comment("Order of all vectors.")
        + f"extern const char* const {name}_joint_names[{capitals}_JOINTS];\n",
        *(comment(term.about) + f"{_signature(library, term)};\n" for term in library.terms),
        *([named(name, _STANDARD.sub("", tick.declarations))] if tick else []),
        "#ifdef __cplusplus\n}\n#endif\n\n#endif\n",
    ]  # fmt: skip
    return "\n".join(parts)


def source(library: Library) -> str:
    """``N.c`` of a library."""
    name, tick = library.name, library.tick
    functions = {term.function.name(): term.function for term in library.terms}
    functions |= {function.name(): function for function in (tick.functions if tick else ())}
    generated = static_functions(list(functions.values()))
    names = ", ".join(map(c_string, library.model.joint_names))
    moves = any(term.name == "forward_dynamics" for term in library.terms)
    resting = at_rest(library.model) if moves else ""
    parts = [
        of_files(["scalar.h"]) + _TYPES, generated, resting,
        f"const char* const {name}_joint_names[{name.upper()}_JOINTS] = {{{names}}};\n",
        *(_definition(library, term, bool(resting)) for term in library.terms),
        named(name, tick.source) if tick else "",
    ]  # fmt: skip
    code = without_unused(without_decided_conditions("\n".join(parts)))
    standard = "".join(sorted(set(_STANDARD.findall(code))))
    head = f'{comment(library.about)}#include "{name}.h"\n\n{standard}\n{_PRAGMAS}\n'
    return head + _STANDARD.sub("", code) + _END


def named(name: str, text: str) -> str:
    """C with the library's name in its place."""
    return text.replace("library_", f"{name}_").replace("LIBRARY_", f"{name.upper()}_")


def comment(text: str) -> str:
    """A comment in C of lines that are not too long; names in it do not end it."""
    text = text.replace("*/", "* /").replace("/*", "/ *")
    lines = [
        line
        for paragraph in text.split("\n")
        for line in textwrap.wrap(paragraph, _COLUMNS - 3) or [""]
    ]
    if len(lines) == 1:
        return f"/* {lines[0]} */\n"
    return "/* " + "\n".join(lines).replace("\n", "\n * ").replace(" * \n", " *\n") + "\n */\n"


def _signature(library: Library, term: Term) -> str:
    inputs = [f"const double* {x}" for x in term.arguments]
    arguments = ", ".join([*inputs, *(f"double* {x}" for x in term.results)])
    head = f"void {library.name}_{term.name}("
    indent = " " * (len(head) if len(head) <= _COLUMNS - 40 else 4)
    return wrapped(f"{head}{arguments})", subsequent_indent=indent)


def _definition(library: Library, term: Term, sticks: bool) -> str:
    """C of the function of a term; of joints that may stick, the engine finds accelerations."""
    call = f"{term.function.name()}(arg, res, NULL, NULL, 0);"
    if sticks and term.name == "forward_dynamics":
        at_rest = f"if ({PREFIX}is_resting(v)) {PREFIX}accelerations_at_rest(q, v, tau, a);"
        call = f"{at_rest}\n  else {call}"
    return "\n".join([
        f"{_signature(library, term)} {{",
        f"  const double* arg[] = {{{', '.join(term.arguments)}}};",
        f"  double* res[] = {{{', '.join(term.results)}}};",
        f"  {call}",
        "}\n",
    ])  # fmt: skip
