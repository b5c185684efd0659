# SPDX-License-Identifier: Apache-2.0
"""Mutation testing: small mistakes are made in ``src``, one at a time, which tests should detect.

Run it by hand with ``./arm python tools/mutate.py``; ``--help`` shows how. A draw is the same for
the same seed and the same tree. It goes evenly through all files of ``src``, by the number of
their lines that a mistake can be made in, and chooses a kind of mistake and a place at random.

Every mutation is made in a copy of the tree in a temporary folder, with a cache of compiled
kernels of its own. The tests that run the changed line come first, then others that run the same
file, then, with ``--everything``, all. Which tests those are is recorded by running all of them
once. A failure counts only if the test fails again alone, and passes in a
copy without the mutation: tests that are flaky, or fail anyway, catch nothing. A test that hangs,
or a process that crashes, is a failure like any other.
"""

from __future__ import annotations

import ast
import difflib
import fnmatch
import io
import json
import math
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import tokenize
from bisect import bisect_left, bisect_right
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import cached_property
from itertools import accumulate, zip_longest
from pathlib import Path
from typing import NamedTuple

import click
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

ROOT = Path(__file__).resolve().parents[1]
SOURCE, TESTS = "src", "test"
SUFFIXES = (".py", ".c", ".h", ".hpp")

# --- what brakes, limits, refuses or arbitrates ------------------------------------------------

SAFETY_PATHS = (
    "*/arguments.py",
    "*/arrays.py",
    "*/commands/*",
    "*/inputs.py",
    "*/schema*",
)
"""Files of which every line concerns safety."""

SAFETY_NAMES = re.compile(
    r"admit|allow|arbit|beyond|brak|check|clamp|conflict|\bcut|finite|forbid|fresh|guard|limit"
    r"|overrun|patience|refus|reject|requir|saturat|stale|stop|timeout|trouble|unsafe|valid|watch",
    re.IGNORECASE,
)
"""Parts of the names of such functions, classes, fields and constants everywhere else."""

# --- how tests are run -------------------------------------------------------------------------

PYTEST = (sys.executable, "-m", "pytest", "-p", "_hypothesis_pytestplugin")
TRACING = ("-p", "sitecustomize", "-p", "xdist", "-n", "auto", "--dist", "loadscope")
WATCH = Path(__file__).parent / "line_trace"  # holds that file
TRACE_LIMIT = 1800.0  # [s] for all tests while their lines are recorded
SLOWER = 4.0  # how much longer than recorded tests may take: kernels are compiled anew
EVERYTHING = 4  # everything may take so many times as long as the related tests
HANG = 150  # [s] for one test: the slowest takes a quarter of that
MEMORY = 8 << 30  # bytes of its own that a process may have
NO_TESTS, USAGE = 5, 4  # exit codes of pytest

DECLARED = ("test/arm_studies/cli/test_options.py", "test/docs/test_stated.py")
"""Tests of defaults and ranges, which no function has run when they are looked at."""

TRACE_HELP = "Folder that keeps which test runs which line, for the next draw at this commit."

EXAMPLES = """\b
Examples:
  ./arm python tools/mutate.py --count 60 --seed 1 --list
  ./arm python tools/mutate.py --count 60 --seed 1 --only 7 --list     the diff
  ./arm python tools/mutate.py --count 60 --seed 1 --jobs 2 --write test/mutations.md
  ./arm python tools/mutate.py --count 60 --seed 1 --resume --everything --write test/mutations.md
  ./arm python tools/mutate.py --count 20 --seed 2 --safety
  ./arm python tools/mutate.py --count 10 --seed 3 --under src/arm_sim --tests 'test/unit/test_s*'
"""


# --- a mutation --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Mutation:
    """A small mistake.

    Attributes:
        path: The file, from the root of the tree.
        line: Where in it, from 1.
        owner: Function, class or name that the place belongs to; empty at the level of the file.
        kind: What kind of mistake.
        start: First character that is replaced.
        end: The one after the last.
        after: What is put in.
        shown: The surroundings before and after, for people.
    """

    path: str
    line: int
    owner: str
    kind: str
    start: int
    end: int
    after: str
    shown: tuple[str, str]

    @property
    def place(self) -> str:
        """File and line."""
        return f"{self.path}:{self.line}"

    @property
    def area(self) -> str:
        """The folder in ``src`` without doubled names."""
        parts = Path(self.path).parent.parts[1:]
        return "/".join(p for k, p in enumerate(parts) if k == 0 or p != parts[k - 1])

    @property
    def safety(self) -> bool:
        """Whether it is made in what brakes, limits, refuses or arbitrates."""
        declared = any(fnmatch.fnmatch(self.path, pattern) for pattern in SAFETY_PATHS)
        return declared or bool(SAFETY_NAMES.search(self.owner))

    @property
    def change(self) -> str:
        """What was changed, on one line."""
        return " → ".join(f"`{text}`" for text in self.shown)

    @property
    def key(self) -> tuple[str, str, str]:
        """What tells it apart, even after lines were added above it."""
        return self.path, self.owner, self.change

    def apply(self, text: str) -> str:
        """The file with the mistake."""
        return text[: self.start] + self.after + text[self.end :]

    def matters(self, text: str) -> bool:
        """Whether it makes another program of a file, and one that can be read."""
        after = self.apply(text)
        try:
            return not self.path.endswith(".py") or _meaning(after) != _meaning(text)
        except SyntaxError:
            return False


def _meaning(text: str) -> str:
    return ast.dump(ast.parse(text))


def surroundings(text: str, start: int, end: int, after: str, wide: tuple[int, int]) -> tuple:
    """What stands in a range before and after a change, without line breaks, shortened."""
    low, high = wide
    pair = (text[low:high], text[low:start] + after + text[end:high])
    return tuple(_short(part) for part in pair)


def _short(text: str) -> str:
    line = " ".join(text.split()).replace("`", "'") or "(nothing)"
    return line if len(line) <= 100 else f"{line[:60]} … {line[-35:]}"


def other_numbers(literal: str) -> list[str]:
    """What a number could have been by mistake."""
    text = literal.replace("_", "")
    if re.fullmatch(r"\d+", text):
        value = int(text)
        return {0: ["1"], 1: ["0", "2"]}.get(value, [str(value + 1), str(value - 1)])
    if not re.fullmatch(r"(\d+\.\d*|\.\d+|\d+)([eE][+-]?\d+)?", text):
        return []  # hexadecimal, complex, with a suffix
    value = Decimal(text)
    others = {Decimal(0): [Decimal("1.0")], Decimal(1): [Decimal("0.0"), Decimal("10.0")]}
    halves = {Decimal("0.5"): Decimal("1.0"), Decimal("2"): Decimal("1.0")}
    found = others.get(value, [value * 10, value / 10])
    return [f"{float(v)!r}" for v in (*found, *([halves[value]] if value in halves else []))]


ORDER = {"<": "<= >", "<=": "< >=", ">": ">= <", ">=": "> <=", "==": "!=", "!=": "=="}
SUMS = {"+": "-", "-": "+", "*": "/", "/": "*", "//": "/", "%": "//", "**": "*", "&": "|"}
SUMS |= {"|": "&", "<<": ">>", ">>": "<<"}
UPDATES = {"+=": "-=", "-=": "+=", "*=": "/=", "/=": "*=", "|=": "&=", "&=": "|=", "^=": "|="}
TWINS = [("min", "max"), ("minimum", "maximum"), ("fmin", "fmax"), ("floor", "ceil")]
TWINS += [("argmin", "argmax"), ("any", "all"), ("sin", "cos"), ("logic_and", "logic_or")]
CALLS = {a: b for pair in TWINS for a, b in (pair, pair[::-1])}
MAGNITUDES = ("abs", "fabs", "absolute", "norm_inf")


# --- which arguments may be taken for one another ----------------------------------------------

Signatures = dict[str, list[list[str]]]
"""Types of the positional parameters of each function, by name; a class has those of its maker."""
UNKNOWN = {name: [["float", "float"]] for name in ("pow", "atan2", "arctan2", "fmod", "copysign")}
UNKNOWN |= {name: [["array", "array"]] for name in ("cross", "outer", "solve", "matmul", "dot")}


def alike(signatures: Signatures, name: str, first: int) -> bool:
    """Whether a parameter and the next one are of the same type: only then a swap is subtle."""
    if name in CALLS:  # max(a, b) is max(b, a)
        return False
    known = signatures.get(name, []) + UNKNOWN.get(name, [])
    return any(t[first : first + 1] == t[first + 1 : first + 2] != [] for t in known)


def python_signatures(text: str) -> Iterator[tuple[str, list[str]]]:
    """The functions and classes that a Python file defines."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ClassDef):
            fields = [n.annotation for n in node.body if isinstance(n, ast.AnnAssign)]
            yield node.name, [ast.unparse(field) for field in fields]
            makers = (n for n in node.body if isinstance(n, ast.FunctionDef))
            yield from ((node.name, _types(n)) for n in makers if n.name == "__init__")
        elif isinstance(node, ast.FunctionDef):
            yield node.name, _types(node)


def _types(function: ast.FunctionDef) -> list[str]:
    given = [*function.args.posonlyargs, *function.args.args]
    return [ast.unparse(a.annotation) if a.annotation else a.arg for a in given if a.arg != "self"]


def c_signatures(text: str) -> Iterator[tuple[str, list[str]]]:
    """The functions that a C file defines."""
    for name, parameters in re.findall(r"(\w+)\(([^()]*)\) *\{", text):
        if name not in C_CONTROL:
            types = (re.sub(r"\w+(\[\w*\])*$", "", p.strip()) for p in parameters.split(","))
            yield name, [" ".join(t.split()) for t in types]


# --- mistakes in Python ------------------------------------------------------------------------

LOGS = {"debug", "info", "warning", "warn", "error", "fatal", "critical", "exception", "echo"}
LOGS |= {"secho", "print"}
TYPING = {"annotation", "returns", "type_params", "type_comment"}
BOUND = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
BODIES = ("body", "orelse", "finalbody")
WIDEST = 70  # characters of an expression that is shown whole
NARROW = 15  # below which its line is shown


class PythonMistakes(ast.NodeVisitor):
    """Finds every place in a Python file where a mistake can be made, and makes none."""

    def __init__(self, path: str, text: str, signatures: Signatures) -> None:
        """Read the file; ``visit_all`` returns the mistakes."""
        self.path, self.text, self.signatures = path, text, signatures
        self.found: list[Mutation] = []
        self.owners: list[str] = []
        self.lines = text.split("\n")
        self.starts = [0]
        for line in self.lines:
            self.starts.append(self.starts[-1] + len(line) + 1)
        self.tree = ast.parse(text)
        self.parents = {
            child: node for node in ast.walk(self.tree) for child in ast.iter_child_nodes(node)
        }
        words = tokenize.generate_tokens(io.StringIO(text).readline)
        self.words = [
            (self.starts[t.start[0] - 1] + t.start[1], t.string)
            for t in words
            if t.type in (tokenize.OP, tokenize.NAME)
        ]

    def visit_all(self) -> list[Mutation]:
        """Every mistake."""
        self.visit(self.tree)
        return self.found

    # --- places ---

    def _offset(self, line: int, byte: int) -> int:
        return self.starts[line - 1] + len(self.lines[line - 1].encode()[:byte].decode())

    def _span(self, node: ast.AST) -> tuple[int, int]:
        start = self._offset(node.lineno, node.col_offset)
        return start, self._offset(node.end_lineno, node.end_col_offset)

    def _text(self, node: ast.AST) -> str:
        return self.text[slice(*self._span(node))]

    def _between(self, low: int, high: int, wanted: Iterable[str]) -> Iterator[tuple]:
        for start, word in self.words[bisect_left(self.words, (low, "")) :]:
            if start >= high:
                break
            if word in wanted:
                yield start, start + len(word), word

    def _wide(self, node: ast.AST) -> tuple[int, int]:
        """The largest piece around a node that fits on a line."""
        span = self._span(node)
        while (node := self.parents.get(node)) and hasattr(node, "lineno"):
            low, high = self._span(node)
            if high - low > WIDEST or isinstance(node, BOUND):
                break
            span = low, high
        if isinstance(node, (ast.If, ast.While)) and span == self._span(node.test):
            span = self._span(node)[0], span[1]
        if isinstance(node, ast.arguments):
            names = [*node.posonlyargs, *node.args, *node.kwonlyargs]
            span = max(low for low, _ in map(self._span, names) if low < span[0]), span[1]
        return span

    def _add(self, kind: str, node: ast.AST, span: tuple[int, int], after: str) -> None:
        start, end = span
        wide = self._wide(node)
        wide = min(wide[0], start), max(wide[1], end)
        if wide[1] - wide[0] < NARROW:
            row = bisect_right(self.starts, start)
            wide = self.starts[row - 1], max(end, self.starts[row] - 1)
        owner = ".".join(self.owners)
        line = bisect_right(self.starts, start)
        shown = surroundings(self.text, start, end, after, wide)
        self.found.append(Mutation(self.path, line, owner, kind, start, end, after, shown))

    # --- what is left alone ---

    def visit(self, node: ast.AST) -> None:
        """Find the mistakes in a node, unless it is of a kind that is left alone."""
        if self._left_alone(node):
            return
        if isinstance(node, ast.stmt):
            self._dropped(node)
        super().visit(node)

    def _left_alone(self, node: ast.AST) -> bool:
        match node:
            case ast.Import() | ast.ImportFrom() | ast.JoinedStr():
                return True
            case ast.If(test=test) if "TYPE_CHECKING" in ast.dump(test) or "__name__" in ast.dump(
                test
            ):
                return True
            case ast.Assign(targets=[ast.Name(id="__all__" | "__slots__")]):
                return True
            case ast.Subscript(value=ast.Name(id="Literal" | "Callable")):
                return True
            case ast.Call(func=ast.Attribute(value=ast.Constant(value=str()))):
                return True  # "...".format(...) and the like
            case ast.keyword(arg="strict"):
                return True  # of zip: a second look at what is sure
        return isinstance(node, ast.Call) and _called(node) in {*LOGS, "dataclass", "TypeVar"}

    def generic_visit(self, node: ast.AST) -> None:
        """Visit the children, except types and decorators of data classes."""
        for name, value in ast.iter_fields(node):
            if name in TYPING or (isinstance(node, ast.Raise) and name in ("exc", "cause")):
                continue
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST):
                    self.visit(child)

    def _inside(self, name: str, node: ast.AST) -> None:
        self.owners.append(name)
        self.generic_visit(node)
        self.owners.pop()

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        """Go into a class."""
        self._inside(node.name, node)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        """Go into a function."""
        self._inside(node.name, node)

    def visit_Assign(self, node: ast.Assign) -> None:
        """Outside functions the place belongs to the name that is assigned."""
        self._assigned(node, node.targets[0])

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        """As Assign."""
        self._assigned(node, node.target)

    def _assigned(self, node: ast.AST, target: ast.AST) -> None:
        if isinstance(self.parents[node], (ast.Module, ast.ClassDef)):
            self._inside(self._text(target), node)
        else:
            self.generic_visit(node)

    # --- statements ---

    def _dropped(self, node: ast.stmt) -> None:
        match node:
            case ast.Expr(value=ast.Call()):
                drop = not self._left_alone(node.value)
            case ast.Return() | ast.Continue() | ast.Break() | ast.Raise():
                drop = isinstance(self.parents[node], ast.If) and self._goes_on(self.parents[node])
            case ast.AugAssign() | ast.Delete():
                drop = True
            case ast.Assign():
                drop = all(self._bound_before(target) for target in node.targets)
            case _:
                drop = False
        if drop:
            self._add("statement dropped", node, self._span(node), "pass")

    def _goes_on(self, node: ast.stmt) -> bool:
        """Whether something follows a statement in its block or around it."""
        parent = self.parents[node]
        for name in BODIES:
            block = getattr(parent, name, None)
            if isinstance(block, list) and node in block and node is not block[-1]:
                return True
        return isinstance(parent, (ast.For, ast.While))

    def _bound_before(self, target: ast.AST) -> bool:
        function: ast.AST | None = target
        while function and not isinstance(function, ast.FunctionDef):
            function = self.parents.get(function)
        if not isinstance(function, ast.FunctionDef):
            return False
        if isinstance(target, ast.Tuple):
            return all(self._bound_before(part) for part in target.elts)
        if isinstance(target, ast.Attribute):
            return function.name not in ("__init__", "__post_init__", "__new__")
        if not isinstance(target, ast.Name):
            return isinstance(target, ast.Subscript)
        here = self._span(target)[0]
        return any(
            (isinstance(n, ast.arg) and n.arg == target.id)
            or (isinstance(n, ast.Name) and n.id == target.id and self._span(n)[0] < here)
            for n in ast.walk(function)
        )

    # --- conditions ---

    def _negated(self, test: ast.expr) -> None:
        if not (isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not)):
            self._add("condition negated", test, self._span(test), f"not ({self._text(test)})")

    def visit_If(self, node: ast.If) -> None:
        """Negate the condition."""
        self._negated(node.test)
        self.generic_visit(node)

    def visit_While(self, node: ast.While) -> None:
        """Negate the condition."""
        if not isinstance(node.test, ast.Constant):
            self._negated(node.test)
        self.generic_visit(node)

    def visit_IfExp(self, node: ast.IfExp) -> None:
        """Negate the condition."""
        self._negated(node.test)
        self.generic_visit(node)

    def visit_comprehension(self, node: ast.comprehension) -> None:
        """Negate the conditions."""
        for test in node.ifs:
            self._negated(test)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        """Take ``and`` for ``or``."""
        for left, right in zip(node.values, node.values[1:], strict=False):
            low, high = self._span(left)[1], self._span(right)[0]
            for start, end, word in self._between(low, high, ("and", "or")):
                other = "or" if word == "and" else "and"
                self._add("and/or", node, (start, end), other)
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        """Take one comparison for another."""
        sides = [node.left, *node.comparators]
        for left, op, right in zip(sides, node.ops, sides[1:], strict=False):
            low, high = self._span(left)[1], self._span(right)[0]
            words = list(self._between(low, high, (*ORDER, "is", "in", "not")))
            span = words[0][0], words[-1][1]
            word = " ".join(word for *_, word in words)
            named = {ast.Is: "is not", ast.IsNot: "is", ast.In: "not in", ast.NotIn: "in"}
            others = [named[type(op)]] if type(op) in named else ORDER[word].split()
            for other in others:
                self._add("comparison", node, span, other)
        self.generic_visit(node)

    # --- arithmetic ---

    def visit_BinOp(self, node: ast.BinOp) -> None:
        """Take one operator for another, or the wrong sign."""
        sides = node.left, node.right
        if not any(_is_text_or_list(side) for side in sides) and not any(map(_is_type, sides)):
            low, high = self._span(node.left)[1], self._span(node.right)[0]
            for start, end, word in self._between(low, high, SUMS):
                self._add("operator", node, (start, end), SUMS[word])
            whole = isinstance(self.parents[node], (ast.Assign, ast.Return, ast.AugAssign))
            if whole and isinstance(node.op, (ast.Mult, ast.Div)):
                self._add("sign", node, self._span(node), f"-({self._text(node)})")
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        """Take one operator for another."""
        low, high = self._span(node.target)[1], self._span(node.value)[0]
        if not _is_text_or_list(node.value):
            for start, end, word in self._between(low, high, UPDATES):
                self._add("operator", node, (start, end), UPDATES[word])
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        """Drop a minus or a ``not``."""
        span = self._span(node)[0], self._span(node.operand)[0]
        kind = {ast.USub: "sign", ast.Not: "condition negated"}.get(type(node.op))
        if kind and "(" not in self.text[slice(*span)]:
            self._add(kind, node, span, "")
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        """Take one number for another, True for False."""
        parent = self.parents[node]
        default = isinstance(parent, ast.arguments)
        if isinstance(node.value, bool):
            kind = "default" if default else "True/False"
            self._add(kind, node, self._span(node), str(not node.value))
        elif isinstance(node.value, (int, float)):
            kind = "default" if default else "constant"
            for other in other_numbers(self._text(node)):
                self._add(kind, node, self._span(node), other)

    # --- indices, calls ---

    def visit_Slice(self, node: ast.Slice) -> None:
        """Begin or end one early or late."""
        for bound in (node.lower, node.upper):
            if bound is not None and not isinstance(bound, ast.Constant):
                for other in ("+ 1", "- 1"):
                    span = self._span(bound)
                    self._add("off by one", bound, span, f"{self._text(bound)} {other}")
        self.generic_visit(node)

    def visit_Attribute(self, node: ast.Attribute) -> None:
        """Forget to transpose."""
        if node.attr == "T":
            self._add("call", node, self._span(node), self._text(node.value))
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        """Call something similar, with arguments swapped or missing."""
        name, plain = _called(node), isinstance(node.func, ast.Name)
        end = self._span(node.func)[1]
        place = end - len(name), end
        if name in CALLS:
            self._add("call", node, place, CALLS[name])
        if plain and name in ("round", "int") and len(node.args) == 1:
            self._add("call", node, place, "int" if name == "round" else "round")
        if name in MAGNITUDES and len(node.args) == 1 and not node.keywords:
            self._add("abs dropped", node, self._span(node), f"({self._text(node.args[0])})")
        if name == "copy" and not node.args and isinstance(node.func, ast.Attribute):
            self._add("call", node, self._span(node), self._text(node.func.value))
        if plain and name == "range":
            self._ranges(node)
        self._swapped(node, name)
        self._missing(node)
        self.generic_visit(node)

    def _ranges(self, node: ast.Call) -> None:
        for k, bound in enumerate(node.args[:2]):
            if not isinstance(bound, (ast.Constant, ast.Starred)):
                other = "+ 1" if k == 0 and len(node.args) > 1 else "- 1"
                self._add("off by one", node, self._span(bound), f"{self._text(bound)} {other}")

    def _swapped(self, node: ast.Call, name: str) -> None:
        for k, (left, right) in enumerate(zip(node.args, node.args[1:], strict=False)):
            if any(isinstance(argument, ast.Starred) for argument in node.args[: k + 2]):
                break
            if not alike(self.signatures, name, k) or _is_text_or_list(left):
                continue
            (low, middle), (after, high) = self._span(left), self._span(right)
            swapped = self._text(right) + self.text[middle:after] + self._text(left)
            self._add("arguments swapped", node, (low, high), swapped)

    def _missing(self, node: ast.Call) -> None:
        for keyword in node.keywords:
            odd = keyword.arg is None or self._left_alone(keyword)
            if odd or _is_text_or_list(keyword.value):
                continue
            low, high = self._span(keyword)
            commas = list(self._between(self._span(node)[0], low, (",", "(")))
            if commas and commas[-1][2] == ",":
                low = commas[-1][0]
            else:
                high = next(self._between(high, self._span(node)[1], (",",)), (0, high))[1]
            self._add("argument dropped", node, (low, high), "")


def _called(node: ast.Call) -> str:
    match node.func:
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name
    return ""


def _is_text_or_list(node: ast.AST) -> bool:
    if isinstance(node, ast.Constant):
        return isinstance(node.value, str | bytes)
    if isinstance(node, ast.BinOp):
        return _is_text_or_list(node.left) or _is_text_or_list(node.right)
    return isinstance(node, (ast.JoinedStr, ast.List, ast.ListComp, ast.Dict, ast.DictComp))


def _is_type(node: ast.AST) -> bool:
    match node:
        case ast.Constant(value=None):
            return True
        case ast.Name(id="int" | "float" | "str" | "bool" | "bytes"):
            return True
        case ast.Subscript(value=value):
            return _is_type(value)
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name[0].isupper() and not name.isupper()
    return False


# --- mistakes in C -----------------------------------------------------------------------------

C_TOKEN = re.compile(
    r"""(?P<skip>//[^\n]*|/\*.*?\*/|^[ \t]*\#(?:\\\n|[^\n])*|\n|[ \t\r\f]+)
    |(?P<text>"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*')
    |(?P<number>(?:0[xX][0-9a-fA-F]+|(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)[uUlLfF]*)
    |(?P<name>[A-Za-z_]\w*)
    |(?P<op><<=|>>=|->|\+\+|--|<<|>>|&&|\|\||[-+*/%&|^<>=!]=|.)""",
    re.VERBOSE | re.DOTALL | re.MULTILINE,
)
C_WORDS = {"if", "for", "while", "switch", "return", "case", "else", "do", "sizeof", "default"}
C_WORDS |= {"goto", "struct", "enum", "union", "typedef", "static", "const", "inline", "operator"}
C_CONTROL = ("if", "for", "while", "switch")
C_ASSIGNING = ("=", *UPDATES)


class CToken(NamedTuple):
    """A word of C: what it is, what it says, and where."""

    kind: str
    text: str
    start: int
    end: int


class CMistakes:
    """Finds every place in a C or C++ file where a mistake can be made, and makes none."""

    def __init__(self, path: str, text: str, signatures: Signatures) -> None:
        """Read the file; ``visit_all`` returns the mistakes."""
        self.path, self.text, self.signatures = path, text, signatures
        self.words = [
            CToken(str(m.lastgroup), m.group(), m.start(), m.end())
            for m in C_TOKEN.finditer(text)
            if m.lastgroup != "skip"
        ]
        self.partner = self._pairs()
        self.functions = self._owners()
        self.begins: list[int] = []  # first word of the statement that each word is in
        self.depths: list[int] = []  # parentheses around it
        for k, word in enumerate(self.words):
            new = not k or self.words[k - 1].text in (";", "{", "}") or self._after_control(k)
            self.begins.append(k if new else self.begins[-1])
            left = k and self.words[k - 1].text == "("
            self.depths.append((self.depths[-1] if k else 0) + left - (word.text == ")"))
        self.found: list[Mutation] = []

    def _pairs(self) -> dict[int, int]:
        """Which bracket belongs to which."""
        pairs, open_ = {}, []
        for k, word in enumerate(self.words):
            if word.text in ("(", "[", "{") and word.kind == "op":
                open_.append(k)
            elif word.text in (")", "]", "}") and word.kind == "op":
                pairs[k] = open_.pop()
                pairs[pairs[k]] = k
        return pairs

    def _owners(self) -> list[str]:
        """Name of the function that each word is in the body of, empty outside."""
        owners, name, until = [], "", -1
        for k, word in enumerate(self.words):
            if k > until:
                name = ""
            if not name and word.text == "{" and k and self.words[k - 1].text == ")":
                before = self.partner[k - 1] - 1
                while self.words[before].kind == "op":
                    before -= 1
                name, until = self.words[before].text, self.partner[k]
            owners.append(name)
        return owners

    def visit_all(self) -> list[Mutation]:
        """Every mistake."""
        for k, word in enumerate(self.words):
            if word.kind == "number":
                self._number(k)
            elif self.functions[k] and word.kind == "op":
                self._operator(k)
            elif self.functions[k] and word.kind == "name":
                self._call(k)
                self._statement(k)
        for k, word in enumerate(self.words):  # statements that begin with *
            if self.functions[k] and word.text == "*":
                self._statement(k)
        return self.found

    def _add(self, kind: str, k: int, span: tuple[int, int], after: str) -> None:
        start, end = span
        low = self.text.rfind("\n", 0, start) + 1
        high = self.text.find("\n", end)
        line = self.text.count("\n", 0, start) + 1
        shown = surroundings(self.text, start, end, after, (low, high))
        owner = self.functions[k] or self._assigned(k)
        self.found.append(Mutation(self.path, line, owner, kind, start, end, after, shown))

    def _span(self, first: int, last: int) -> tuple[int, int]:
        return self.words[first].start, self.words[last].end

    def _assigned(self, k: int) -> str:
        """Name that a word outside functions is the value of."""
        names = [w.text for w in self.words[self.begins[k] : k] if w.kind == "name"]
        return names[-1] if names else ""

    def _after_control(self, k: int) -> bool:
        """Whether the word is the first one after ``if (...)`` or ``else``."""
        last = self.words[k - 1].text
        if last == ")":
            return self.words[self.partner[k - 1] - 1].text in C_CONTROL
        return last in ("else", "do")

    def _is_operand(self, k: int) -> bool:
        word = self.words[k]
        if word.kind == "name":
            return word.text not in C_WORDS
        return word.kind == "number" or word.text in (")", "]")

    def _declares(self, k: int) -> bool:
        """Whether a number is the size of an array that is declared."""
        head = self.words[self.begins[k] : k]
        assigns = any(word.text in (*C_ASSIGNING, "(") for word in head)
        names = [a.kind == b.kind == "name" for a, b in zip(head, head[1:], strict=False)]
        return not assigns and (any(names) or not self.functions[k])

    def _number(self, k: int) -> None:
        if self.words[k - 1].text == "case" or self._declares(k):
            return
        if not self.functions[k] and "=" not in (w.text for w in self.words[self.begins[k] : k]):
            return
        for other in other_numbers(self.words[k].text):
            self._add("constant", k, self._span(k, k), other)

    def _operator(self, k: int) -> None:
        word, span = self.words[k].text, self._span(k, k)
        if self.words[k - 1].text == "operator":
            return
        spaced = self.text[span[0] - 1] == " " == self.text[span[1] : span[1] + 1]
        binary = self._is_operand(k - 1)
        if word in ORDER:
            for other in ORDER[word].split():
                self._add("comparison", k, span, other)
        elif word in UPDATES:
            self._add("operator", k, span, UPDATES[word])
        elif word in ("&&", "||"):
            self._add("and/or", k, span, "||" if word == "&&" else "&&")
        elif word in SUMS and binary and (spaced or word not in "*&"):
            self._add("operator", k, span, SUMS[word])
        elif word == "-" and not binary:
            self._add("sign", k, span, "")
        elif word == "!":
            self._add("condition negated", k, span, "")

    def _call(self, k: int) -> None:
        name, following = self.words[k].text, self.words[k + 1]
        if following.text != "(":
            return
        close = self.partner[k + 1]
        if name in ("if", "while"):
            low, high = following.end, self.words[close].start
            self._add("condition negated", k, (low, high), f"!({self.text[low:high]})")
        if name in C_WORDS or close == k + 2:
            return
        arguments = self._arguments(k + 1)
        if name in CALLS:
            self._add("call", k, self._span(k, k), CALLS[name])
        if name in MAGNITUDES and len(arguments) == 1:
            self._add("abs dropped", k, self._span(k, k), "")
        for n, (left, right) in enumerate(zip(arguments, arguments[1:], strict=False)):
            (low, middle), (after, high) = left, right
            first, second = self.text[low:middle], self.text[after:high]
            if first != second and alike(self.signatures, name, n):
                swapped = second + self.text[middle:after] + first
                self._add("arguments swapped", k, (low, high), swapped)

    def _arguments(self, open_: int) -> list[tuple[int, int]]:
        spans, first, k = [], open_ + 1, open_ + 1
        while k <= self.partner[open_]:
            word = self.words[k].text
            if word == "," or k == self.partner[open_]:
                spans.append(self._span(first, k - 1))
                first = k + 1
            k = self.partner[k] + 1 if word in ("(", "[", "{") else k + 1
        return spans

    def _statement(self, k: int) -> None:
        if self.begins[k] != k or self.depths[k]:
            return
        end = k
        while self.words[end].text not in (";", "{", "}"):
            end = self.partner[end] + 1 if self.words[end].text in ("(", "[") else end + 1
        word, following = self.words[k].text, self.words[k + 1].text
        leaves = word in ("break", "continue") or (word == "return" and self._after_control(k))
        acts = word not in C_WORDS and following in (*C_ASSIGNING, "(", "[", "->", ".")
        stores = word == "*" and any(w.text in C_ASSIGNING for w in self.words[k:end])
        if self.words[end].text == ";" and (leaves or acts or stores):
            self._add("statement dropped", k, (self.words[k].start, self.words[end].start), "")


# --- the draw ----------------------------------------------------------------------------------


class Project:
    """The tree as git sees it, without what it ignores."""

    def __init__(self, root: Path) -> None:
        """List the files."""
        listed = subprocess.run(
            ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
            cwd=root,
            capture_output=True,
            check=True,
        )
        names = sorted(set(listed.stdout.decode().split("\0")) - {""})
        self.root, self.files = root, [n for n in names if os.path.lexists(root / n)]

    def text(self, name: str) -> str:
        """What stands in a file."""
        return (self.root / name).read_text(encoding="utf-8")

    @cached_property
    def sources(self) -> list[str]:
        """Code of the packages in ``src``, without their set-up files."""
        below = (n for n in self.files if n.startswith(f"{SOURCE}/") and n.endswith(SUFFIXES))
        return [n for n in below if self._in_package(n)]

    @cached_property
    def tests(self) -> list[str]:
        """All test files."""
        return [n for n in self.files if re.match(rf"{TESTS}/(.*/)?test_\w+\.py$", n)]

    def _in_package(self, name: str) -> bool:
        return any((self.root / p / "__init__.py").exists() for p in Path(name).parents)

    def mistakes(self, name: str) -> list[Mutation]:
        """All mistakes that can be made in a file."""
        found = PythonMistakes if name.endswith(".py") else CMistakes
        return found(name, self.text(name), self.signatures).visit_all()

    @cached_property
    def signatures(self) -> Signatures:
        """Types of the parameters of all functions."""
        found: Signatures = defaultdict(list)
        for name in self.sources:
            read = python_signatures if name.endswith(".py") else c_signatures
            for function, types in read(self.text(name)):
                found[function].append(types)
        return found

    def matters(self, mutation: Mutation) -> bool:
        """Whether a mutation makes another program, and one that can be read."""
        return mutation.matters(self.text(mutation.path))


def draw(
    pools: dict[str, list[Mutation]],
    count: int,
    seed: int,
    matters: Callable[[Mutation], bool] = lambda _: True,
) -> list[Mutation]:
    """Draw mutations, evenly over the files by the number of lines that one can be made in.

    Args:
        pools: All that can be made, by file.
        count: How many to draw; fewer are drawn where there are not enough.
        seed: Of the generator.
        matters: Whether one is worth a try; another is drawn instead.
    """
    rng = random.Random(seed)
    paths = sorted(path for path in pools if pools[path])
    lines = [len({m.line for m in pools[path]}) for path in paths]
    step = sum(lines) / count
    place = step * rng.random()
    drawn: list[Mutation] = []
    for path, size in zip(paths, lines, strict=True):
        left = list(pools[path])
        while place < size:
            one = None
            while left and not one:
                kind = rng.choice(sorted({m.kind for m in left}))
                one = rng.choice([m for m in left if m.kind == kind])
                left.remove(one)
                one = one if matters(one) else None
            if one:
                drawn.append(one)
                left = [m for m in left if m.line != one.line]
            place += step
        place -= size
    return drawn


# --- which tests run a line --------------------------------------------------------------------


class Trace:
    """Which tests run which line, and for how long.

    Recorded once by running all tests, ``line_trace/sitecustomize.py`` watching. A line of C
    counts as run by the tests that run the Python files which name its file.
    """

    def __init__(self, project: Project, folder: Path) -> None:
        """Read what was recorded in a folder."""
        self.project = project
        self.lines: dict[tuple[str, int], set[str]] = defaultdict(set)
        self.files: dict[str, set[str]] = defaultdict(set)
        self.seconds: dict[str, float] = {}
        for found in map(_read, sorted(folder.glob("*.json"))):
            self.seconds |= found["seconds"]
            for test, files in found["lines"].items():
                for name, numbers in files.items():
                    self.files[f"{SOURCE}/{name}"].add(test)
                    for number in numbers:
                        self.lines[f"{SOURCE}/{name}", number].add(test)

    def tests_of(self, mutation: Mutation, limit: float) -> list[str]:
        """Tests that take ``limit`` seconds together: first those that run the line.

        Then others in the same files, for what is built once and kept is run by the first of
        them only; then all that run anything of the file that is changed.
        """
        near = self._users(mutation.path)
        of_file = {test for name in near for test in self.files[name]}
        if not of_file:  # nothing but declarations, which work where they are imported
            of_file = {test for name in self._importers(near) for test in self.files[name]}
        of_line = {test for place in self._places(mutation) for test in self.lines[place]}
        of_line |= self._named_in(mutation.path)
        if not of_line and mutation.path.endswith(".py"):  # it is run at import, or never
            of_line = {test for test in self.seconds if _file(test) in DECLARED}
        neighbours = {_file(test) for test in of_line}
        chosen: list[str] = []
        for tests in (of_line, {t for t in of_file if _file(t) in neighbours}, of_file):
            chosen += self._in_turns(mutation, tests - set(chosen))
        times = accumulate(self.seconds.get(test, 1.0) for test in chosen)
        affordable = [test for test, until in zip(chosen, times, strict=True) if until <= limit]
        files = {_file(test): k for k, test in reversed(list(enumerate(affordable)))}
        return sorted(affordable, key=lambda test: files[_file(test)])  # fixtures are made once

    def _in_turns(self, mutation: Mutation, tests: set[str]) -> Iterator[str]:
        """Tests in the order in which they are likely to notice.

        First those that go where few others go in the function that is changed; then those in
        files that name what is changed, the module in their own name, the class and the function
        in their text; then those in folders of the same name. Among files that are equally near
        one test of each in turn, those whose names speak of it and quick ones first.
        """
        place, crowds = Path(mutation.path), self._crowds(mutation)
        owners = [name for name in mutation.owner.split(".") if not name.startswith("__")]
        queues = defaultdict(list)
        words = {place.stem.strip("_"), *owners} - {""}

        def order(test: str) -> tuple:
            speaks = any(word in test.rpartition("::")[2] for word in words)
            return crowds[test], not speaks, self.seconds.get(test, 1.0), test

        for test in sorted(tests, key=order):
            queues[_file(test)].append(test)
        groups = defaultdict(list)
        for file in sorted(queues):
            text, own = self.project.text(file), place.stem.strip("_") in Path(file).stem
            named = own + sum(bool(name) and name in text for name in owners)
            near = len({*place.parts} & {*Path(file).parts})
            groups[crowds[queues[file][0]], -named, -near].append(queues[file])
        for group in sorted(groups):
            for turn in zip_longest(*groups[group]):
                yield from filter(None, turn)

    def _crowds(self, mutation: Mutation) -> dict[str, int]:
        """By test how many run the line of the changed function that fewest run; in powers of two.

        What few tests run is what they are about.
        """
        found: dict[str, int] = defaultdict(lambda: sys.maxsize)
        for place in self._around(mutation):
            tests = self.lines.get(place, set())
            for test in tests:
                found[test] = min(found[test], len(tests).bit_length())
        return found

    def _places(self, mutation: Mutation) -> list[tuple[str, int]]:
        """The line; of C those of Python beside its folder that call its function."""
        if mutation.path.endswith(".py"):
            return [(mutation.path, mutation.line)]
        called, folder = f".{mutation.owner}(", f"{Path(mutation.path).parents[1]}/"
        return [
            (name, number)
            for name in self.project.sources
            if mutation.owner and name.endswith(".py") and name.startswith(folder)
            for number, line in enumerate(self.project.text(name).splitlines(), 1)
            if called in line
        ]

    def _around(self, mutation: Mutation) -> list[tuple[str, int]]:
        """The lines of the function; of C its places."""
        path, functions = mutation.path, (ast.FunctionDef, ast.AsyncFunctionDef)
        if not path.endswith(".py"):
            return self._places(mutation)
        spans = [
            (node.lineno, node.end_lineno)
            for node in ast.walk(ast.parse(self.project.text(path)))
            if isinstance(node, functions) and node.lineno <= mutation.line <= node.end_lineno
        ]
        first, last = max(spans, default=(mutation.line, mutation.line))
        return [(path, line) for line in range(first, last + 1)]

    def _users(self, name: str) -> set[str]:
        """The file itself, or the Python files that name one of C or one that includes it."""
        seen, todo = set[str](), {name}
        while todo:
            seen |= todo
            natives = {Path(n).name for n in todo if not n.endswith(".py")}
            named = {n for n in self.project.sources if self._names(n) & natives}
            todo = named - seen
        return {n for n in seen if n.endswith(".py")}

    def _importers(self, names: set[str]) -> set[str]:
        """Files of ``src`` that import one of these."""
        stems = "|".join(Path(name).stem for name in names)
        pattern = re.compile(rf"import .*\b({stems})\b|from [\w.]*\b({stems}) import")
        return {n for n in self.project.sources if pattern.search(self.project.text(n))}

    def _named_in(self, name: str) -> set[str]:
        """Tests in files that speak of a file of C by its name: they compile it themselves."""
        if name.endswith(".py"):
            return set()
        files = {t for t in self.project.tests if Path(name).name in self.project.text(t)}
        return {test for test in self.seconds if _file(test) in files}

    def _names(self, source: str) -> set[str]:
        text = self.project.text(source)
        return set(re.findall(r'"[^"\n]*?([\w.]+\.(?:c|h|hpp))"', text)) - {Path(source).name}


def _read(file: Path) -> dict:
    return json.loads(file.read_text(encoding="utf-8"))


def _file(test: str) -> str:
    return test.partition("::")[0]


# --- copies of the tree and what runs in them --------------------------------------------------


class Copy:
    """A copy of the tree with a cache and a temporary folder of its own."""

    def __init__(self, project: Project, folder: Path, kernels: Path | None) -> None:
        """Make it; ``kernels`` holds compiled ones that it may use."""
        self.tree, self.cache, self.scratch = (folder / p for p in ("tree", "cache", "tmp"))
        for made in (self.tree, self.cache, self.scratch):
            made.mkdir(parents=True, mode=0o700)
        for name in project.files:
            (self.tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(project.root / name, self.tree / name, follow_symlinks=False)
        if kernels is not None:
            shutil.copytree(kernels, self.cache, dirs_exist_ok=True, copy_function=os.link)
        self.runs = 0

    def environment(self, traces: Path | None = None) -> dict[str, str]:
        """Surroundings in which Python imports the sources of this copy, and may be watched."""
        source, ours = str(ROOT / SOURCE), str(self.tree / SOURCE)
        path = os.environ.get("PYTHONPATH", "").split(os.pathsep)
        moved = [ours + p[len(source) :] if p.startswith(source + os.sep) else p for p in path]
        watched = {"LINE_TRACE": str(traces), "LINE_TRACE_SOURCE": f"{ours}/"} if traces else {}
        if traces:  # with a folder of compiled scenes, tests write the equations that they use
            watched["ARM_CACHE"] = str(self.scratch)
        return {
            **os.environ,
            **watched,
            "PYTHONPATH": os.pathsep.join([str(WATCH), *moved] if traces else moved),
            "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",
            "XDG_CACHE_HOME": str(self.cache),
            "TMPDIR": str(self.scratch),
        }


class Stopped(Exception):
    """The user has had enough."""


class Ending(NamedTuple):
    """How a run of pytest ended: in words, and where; ``test`` is empty if nobody knows."""

    words: str  # "passed", "failed", "not collected", "hangs", "crashes", "out of time"
    test: str = ""


def run_pytest(
    copy: Copy,
    options: Iterable[str],
    limit: float,
    stop: threading.Event,
    traces: Path | None = None,
) -> Ending:
    """Run tests in a copy until one fails."""
    copy.runs += 1
    memory = copy.scratch / f"pytest-{copy.runs}"
    told, errors = memory.with_suffix(".out"), memory.with_suffix(".err")
    hang = ("-o", f"faulthandler_timeout={HANG}", "-o", "faulthandler_exit_on_timeout=true")
    line = [*PYTEST, "-x", "-v", "--tb=no", "-o", f"cache_dir={memory}", *hang, *options]
    with told.open("wb") as out, errors.open("wb") as err:
        code = run_alone(line, copy, copy.environment(traces), out, err, limit, stop)
    if code is None:
        return Ending("out of time")
    if code in (0, NO_TESTS):
        return Ending("passed")
    failed = memory / "v/cache/lastfailed"
    if failed.exists() and (tests := list(json.loads(failed.read_text()))):
        return Ending("failed", tests[0])
    if code == USAGE:
        return Ending("not collected")
    pattern = r"^(\S+\.py::.*?) *(?:(?:PASSED|FAILED|ERROR|SKIPPED|XFAIL).*)?$"
    last = re.findall(pattern, told.read_text(errors="replace"), re.MULTILINE)
    words = "hangs" if "Timeout (" in errors.read_text(errors="replace") else "crashes"
    return Ending(words, last[-1] if last else "")


def run_alone(line: list[str], copy: Copy, env: dict, out, err, limit: float, stop):
    """Run a command in a session of its own and end all of it; None if it took too long."""
    process = subprocess.Popen(
        line,
        cwd=copy.tree,
        env=env,
        stdin=subprocess.DEVNULL,
        stdout=out,
        stderr=err,
        start_new_session=True,
    )
    until = time.monotonic() + limit
    try:
        resource.prlimit(process.pid, resource.RLIMIT_DATA, (MEMORY, MEMORY))
        while time.monotonic() < until and not stop.is_set():
            try:
                return process.wait(0.5)
            except subprocess.TimeoutExpired:
                continue
    finally:
        end_group(process, copy)
    if stop.is_set():
        raise Stopped
    return None


def end_group(process: subprocess.Popen, copy: Copy) -> None:
    """End a process, its group, and what it has put into sessions of their own."""
    for number, patience in ((signal.SIGINT, 5.0), (signal.SIGKILL, 5.0)):
        try:
            os.killpg(process.pid, number)
            process.wait(patience)
        except (ProcessLookupError, subprocess.TimeoutExpired):
            continue
    mark = f"XDG_CACHE_HOME={copy.cache}".encode()
    for entry in Path("/proc").glob("[0-9]*/environ"):
        try:
            if mark in entry.read_bytes().split(b"\0"):
                os.kill(int(entry.parent.name), signal.SIGKILL)
        except OSError:
            continue


# --- the verdicts ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Result:
    """What became of a mutation.

    Attributes:
        mutation: The mutation.
        outcome: ``caught``, ``survived`` or ``out of time``.
        by: The test that caught it, and how.
        seconds: How long it took.
        verdict: What a person says about a survivor.
    """

    mutation: Mutation
    outcome: str
    by: str = ""
    seconds: float = 0.0
    verdict: str = ""

    @property
    def equivalent(self) -> bool:
        """Whether a person has found that no test could notice."""
        return self.outcome != "caught" and self.verdict.lower().startswith("equivalent")


class Laboratory:
    """Tries mutations in a temporary folder."""

    def __init__(self, project: Project, folder: Path, options: dict) -> None:
        """Prepare a copy without mutations and the kernels that all copies begin with."""
        self.project, self.folder = project, folder
        self.chosen, self.limit = options["tests"], options["limit"]
        self.everything, self.more = options["everything"], tuple(options["pytest"].split())
        self.stop = threading.Event()
        self.kernels = folder / "kernels"
        self._copy_kernels()
        self.sound = Copy(project, folder / "sound", self.kernels)
        self._passing: dict[str, bool] = {}
        self._one_at_a_time = threading.Lock()
        self.traces: Path = (options["trace"] or folder / "trace").absolute()
        self.trace: Trace | None = None

    def prepare(self) -> None:
        """Record which tests run which line, unless that is known or the tests are given."""
        if self.chosen:
            return
        folder = self.traces
        if not folder.exists():
            folder.mkdir(parents=True)
            all_tests = (*TRACING, "--maxfail=50", TESTS)  # those that fail will catch nothing
            ending = run_pytest(self.sound, all_tests, TRACE_LIMIT, self.stop, folder)
            if ending.words not in ("passed", "failed"):
                raise click.ClickException(f"tests {ending.words} without a mutation")
        self.trace = Trace(self.project, folder)

    def _copy_kernels(self) -> None:
        user = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "arm_dynamics"
        (self.kernels / "arm_dynamics").mkdir(parents=True, mode=0o700)
        for entry in [*user.glob("*.so"), *user.glob("*.o")]:
            shutil.copy2(entry, self.kernels / "arm_dynamics")

    def tests_of(self, mutation: Mutation) -> list[str]:
        """Tests that run first."""
        if self.trace is None:
            return fnmatch.filter(self.project.tests, self.chosen)
        return self.trace.tests_of(mutation, self.limit / SLOWER)

    def examine(self, number: int, mutation: Mutation) -> Result:
        """Make a mutation and run tests."""
        begin = time.monotonic()
        place = self.folder / str(number)
        # The caches of a header's users may not know it by its content.
        kernels = None if mutation.path.endswith((".h", ".hpp")) else self.kernels
        try:
            copy = Copy(self.project, place, kernels)
            file = copy.tree / mutation.path
            file.write_text(mutation.apply(file.read_text(encoding="utf-8")), encoding="utf-8")
            ending = self._judge(copy, self.tests_of(mutation))
        finally:
            shutil.rmtree(place, ignore_errors=True)
        outcome = {"passed": "survived", "out of time": "out of time"}.get(ending.words, "caught")
        name = ending.test or "the start of pytest"
        by = {"failed": name, "hangs": f"{name} (hangs)", "crashes": f"{name} (crashes)"}
        return Result(mutation, outcome, by.get(ending.words, ""), time.monotonic() - begin)

    def _judge(self, copy: Copy, related: list[str]) -> Ending:
        ending = Ending("passed")
        if related:
            ending = self._first_failure(copy, related, self.limit)
        if ending.words == "not collected":  # a mutation may rename tests, which catches nothing
            files = sorted({_file(test) for test in related})
            ending = self._first_failure(copy, files, self.limit)
        if ending.words == "passed" and self.everything:
            ending = self._first_failure(copy, self.project.tests, EVERYTHING * self.limit)
        return ending

    def _first_failure(self, copy: Copy, files: list[str], limit: float) -> Ending:
        """The first failure that is due to the mutation."""
        until = time.monotonic() + limit
        left, without = list(files), []
        while left:
            remaining = until - time.monotonic()
            ending = run_pytest(copy, (*self.more, *left, *without), remaining, self.stop)
            if ending.words in ("passed", "out of time", "not collected"):
                return ending
            if self._is_due(copy, ending):
                return ending
            if "::" in ending.test:
                without.append(f"--deselect={ending.test}")
            else:
                left.remove(ending.test)
        return Ending("passed")

    def _is_due(self, copy: Copy, ending: Ending) -> bool:
        """Whether a test fails again alone, and passes without the mutation."""
        if not ending.test:
            return True
        again = run_pytest(copy, (ending.test,), 2 * HANG, self.stop)
        return again.words != "passed" and self._passes(ending.test)

    def _passes(self, test: str) -> bool:
        with self._one_at_a_time:
            if test not in self._passing:
                ending = run_pytest(self.sound, (test,), 2 * HANG, self.stop)
                self._passing[test] = ending.words == "passed"
            return self._passing[test]


# --- tables ------------------------------------------------------------------------------------

COLUMNS = ("#", "place", "in", "kind", "change", "outcome", "by", "time [s]")
VERDICT = "verdict of a person"


def row(number: int, result: Result) -> list[str]:
    """A result as cells."""
    m = result.mutation
    cells = [str(number), m.place, m.owner, m.kind, m.change, result.outcome, result.by]
    return [*cells, f"{result.seconds:.0f}"]


def totals(results: Iterable[Result]) -> list[list[str]]:
    """Rows of area, number, caught, survived, out of time, equivalent and per cent."""
    areas = defaultdict(list)
    for result in results:
        areas[result.mutation.area].append(result)
        areas["what brakes, limits, refuses or arbitrates"] += [result] * result.mutation.safety
        areas["all"].append(result)
    last = ("what brakes, limits, refuses or arbitrates", "all")
    order = [*sorted(set(areas) - set(last)), *(name for name in last if areas[name])]
    return [[name, *_counts(areas[name])] for name in order]


def _counts(results: list[Result]) -> list[str]:
    said = Counter("equivalent" if r.equivalent else r.outcome for r in results)
    counting = len(results) - said["equivalent"]
    part = f"{math.floor(100 * said['caught'] / counting)} %" if counting else "-"
    kinds = ("caught", "survived", "out of time", "equivalent")
    return [str(len(results)), *(str(said[kind]) for kind in kinds), part]


TOTALS = ("area", "mutations", "caught", "survived", "out of time", "equivalent", "caught of rest")


def page(results: dict[int, Result], command: str, commit: str) -> str:
    """All results as Markdown."""
    lines = [
        "# Mutations",
        "",
        "Small mistakes made in `src` one at a time, and the test that noticed each. Made by",
        "",
        f"    {command}",
        "",
        f"at {commit}. A person looks at every survivor: the verdict is empty, or begins with",
        "`equivalent:` and says why no test could notice; `--resume` keeps verdicts and counts",
        "again.",
        "",
        *_markdown(TOTALS, totals(results.values())),
        "",
        *_markdown(
            (*COLUMNS, VERDICT), [[*row(k, r), r.verdict] for k, r in sorted(results.items())]
        ),
    ]
    return "\n".join(lines) + "\n"


def _markdown(head: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    cells = [list(head), ["---"] * len(list(head)), *rows]
    return ["| " + " | ".join(c.replace("|", "\\|") for c in line) + " |" for line in cells]


def earlier(file: Path, drawn: dict[int, Mutation]) -> dict[int, Result]:
    """Results of drawn mutations that a page already holds."""
    if not file.exists():
        return {}
    numbers = {m.key: k for k, m in drawn.items()}
    found = {}
    for line in file.read_text(encoding="utf-8").splitlines():
        cells = [c.strip().replace("\\|", "|") for c in re.split(r"(?<!\\)\|", line)[1:-1]]
        if len(cells) != len(COLUMNS) + 1 or not cells[0].isdigit():
            continue
        place, owner, _, change, outcome, by, seconds, verdict = cells[1:]
        k = numbers.get((place.rpartition(":")[0], owner, change))
        if k is not None:
            found[k] = Result(drawn[k], outcome, by, float(seconds), verdict)
    return found


def show(console: Console, head: Iterable[str], rows: Iterable[Iterable[str]]) -> None:
    """Print a table."""
    table = Table(*(escape(name) for name in head), show_lines=False)
    for cells in rows:
        table.add_row(*(escape(cell) for cell in cells))
    console.print(table)


def diff(project: Project, mutation: Mutation) -> str:
    """A mutation as a unified diff."""
    text = project.text(mutation.path)
    before, after = text.splitlines(), mutation.apply(text).splitlines()
    names = f"a/{mutation.path}", f"b/{mutation.path}"
    return "\n".join(difflib.unified_diff(before, after, *names, lineterm="", n=2))


# --- the command -------------------------------------------------------------------------------


def examine_all(
    laboratory: Laboratory, todo: dict[int, Mutation], jobs: int, console: Console
) -> Iterator[tuple[int, Result]]:
    """Yield the results as they come."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    progress = Progress(*columns, TimeElapsedColumn(), console=console, transient=True)
    with progress, ThreadPoolExecutor(jobs) as pool:
        bar = progress.add_task("recording which test runs which line", total=len(todo))
        laboratory.prepare()

        def examine(k: int) -> tuple[int, Result]:
            progress.update(bar, description=f"{k}: {escape(todo[k].place)}")
            return k, laboratory.examine(k, todo[k])

        waiting = [pool.submit(examine, k) for k in todo]
        try:
            while waiting:
                for future in [f for f in waiting if f.done()]:
                    waiting.remove(future)
                    k, result = future.result()
                    progress.advance(bar)
                    line = "  ".join(row(k, result))
                    console.print(line, markup=False, highlight=False, soft_wrap=True)
                    yield k, result
                time.sleep(0.1)
        finally:
            laboratory.stop.set()
            pool.shutdown(cancel_futures=True)


def interrupted(number: int, _: object) -> None:
    """End in order, so that temporary folders and processes go."""
    raise SystemExit(128 + number)


@click.command(help=__doc__, epilog=EXAMPLES, context_settings={"max_content_width": 99})
@click.option("--count", default=60, show_default=True, help="Number of mutations drawn.")
@click.option("--seed", default=1, show_default=True, help="Seed of the draw.")
@click.option("--under", default=SOURCE, show_default=True, help="Only files in this folder.")
@click.option(
    "--safety", is_flag=True, help="Only code that brakes, limits, refuses or arbitrates."
)
@click.option("--only", type=int, help="Only the mutation of this number.")
@click.option("--list", "only_list", is_flag=True, help="Only list the drawn mutations.")
@click.option("--tests", help="Files that run first, as in 'test/unit/test_s*', for every one.")
@click.option("--trace", type=click.Path(path_type=Path), help=TRACE_HELP)
@click.option("--everything", is_flag=True, help="Also run all other tests.")
@click.option("--pytest", default="", help="More options for pytest.")
@click.option("--limit", default=600.0, show_default=True, help="Seconds for the tests run first.")
@click.option("--jobs", default=1, show_default=True, help="Mutations tested in parallel.")
@click.option("--write", type=click.Path(path_type=Path), help="Write the table as Markdown.")
@click.option(
    "--resume", is_flag=True, help="Run only mutations that are missing or open in that file."
)
def main(**options) -> None:
    """Make small mistakes and see whether tests notice."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, interrupted)
    console, project = Console(), Project(ROOT)
    under = options["under"].rstrip("/")
    pools = {
        name: [m for m in project.mistakes(name) if m.safety or not options["safety"]]
        for name in project.sources
        if name == under or name.startswith(f"{under}/")
    }
    drawn = dict(enumerate(draw(pools, options["count"], options["seed"], project.matters), 1))
    if options["only"] is not None and options["only"] not in drawn:
        raise click.BadParameter(f"--only {options['only']}: 1 to {len(drawn)} are drawn")
    todo = {k: m for k, m in drawn.items() if options["only"] in (None, k)}
    if options["only_list"]:
        list_drawn(console, project, todo)
        return
    run(console, project, drawn, todo, options)


def list_drawn(console: Console, project: Project, todo: dict[int, Mutation]) -> None:
    """Show what would be done; a single mutation with its diff."""
    if len(todo) == 1:
        ((_, mutation),) = todo.items()
        console.print(diff(project, mutation), markup=False, highlight=False, soft_wrap=True)
        return
    console.width = max(console.width, 160)
    show(console, COLUMNS[:5], [row(k, Result(m, ""))[:5] for k, m in todo.items()])


def run(
    console: Console,
    project: Project,
    drawn: dict[int, Mutation],
    todo: dict[int, Mutation],
    options: dict,
) -> None:
    """Try the mutations, tell what became of them, and write it down."""
    file: Path | None = options["write"]
    known = earlier(file, drawn) if file else {}
    results = known if options["resume"] or options["only"] else {}
    if options["resume"]:
        done = {k for k, r in results.items() if r.outcome == "caught" or r.verdict}
        todo = {k: m for k, m in todo.items() if k not in done}
    command = " ".join(["./arm python tools/mutate.py", *_telling(options)])
    commit = subprocess.run(
        ["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True
    ).stdout.strip()
    try:
        if todo:
            with tempfile.TemporaryDirectory(prefix="mutate-", ignore_cleanup_errors=True) as name:
                laboratory = Laboratory(project, Path(name), options)
                for k, result in examine_all(laboratory, todo, options["jobs"], console):
                    verdict = known[k].verdict if k in known else ""
                    results[k] = replace(result, verdict=verdict)
                    if file:
                        file.write_text(page(results, command, commit), encoding="utf-8")
    finally:
        if file and not todo:
            file.write_text(page(results, command, commit), encoding="utf-8")
        console.width = max(console.width, 160)
        show(console, COLUMNS, [row(k, r) for k, r in sorted(results.items())])
        show(console, TOTALS, totals(results.values()))


def _telling(options: dict) -> list[str]:
    """The options that decide what is drawn and run."""
    words = ["--count", str(options["count"]), "--seed", str(options["seed"])]
    words += ["--under", options["under"]] if options["under"] != SOURCE else []
    flags = [f"--{name}" for name in ("safety", "everything") if options[name]]
    return [*words, *flags, *(["--tests", f"'{options['tests']}'"] if options["tests"] else [])]


if __name__ == "__main__":
    main()
