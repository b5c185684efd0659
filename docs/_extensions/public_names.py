# SPDX-License-Identifier: Apache-2.0
"""The public names of the packages: what stands in ``__all__`` of a package and of its rooms."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from functools import cache
from types import ModuleType
from typing import Any

import arm_dynamics
import arm_sim
import arm_studies

ROOTS: tuple[ModuleType, ...] = (arm_dynamics, arm_sim, arm_studies)
COMMAND_LINES = "arm_sim.cli", "arm_studies.cli"  # documented by their commands


@cache
def packages() -> dict[str, tuple[str, ...]]:
    """Public packages with their public names; without names, the modules are public."""
    return {
        name: tuple(importlib.import_module(name).__dict__.get("__all__", ()))
        for root in ROOTS
        for name in [root.__name__, *_rooms(root)]
        if name not in COMMAND_LINES
    }


def _rooms(root: ModuleType) -> Iterator[str]:
    for found in pkgutil.iter_modules(root.__path__, f"{root.__name__}."):
        if found.ispkg:
            yield found.name


def modules(package: str) -> list[str]:
    """Modules of a package that are public themselves."""
    path = importlib.import_module(package).__path__
    found = pkgutil.iter_modules(path, f"{package}.")
    return [x.name for x in found if not x.ispkg and "._" not in x.name]


def home(package: str, name: str) -> str:
    """The public package in which a name is documented: the first that has this very object."""
    thing = getattr(importlib.import_module(package), name)
    for other, names in packages().items():
        if name in names and getattr(importlib.import_module(other), name) is thing:
            return other
    return package


def constant_words(package: str, name: str) -> str:
    """What the source says of a constant: the text below its assignment, or comments above it."""
    for line in ast.walk(_tree(package)):
        if isinstance(line, ast.ImportFrom) and name in {alias.name for alias in line.names}:
            found = _words_in(line.module or "", name)
            if found:
                return found
    return _words_in(package, name)


@cache
def _tree(module: str) -> ast.Module:
    return ast.parse(inspect.getsource(importlib.import_module(module)))


def _words_in(module: str, name: str) -> str:
    body = _tree(module).body
    for statement, after in zip(body, [*body[1:], ast.Pass()], strict=True):
        alias = statement.name if isinstance(statement, ast.TypeAlias) else None
        targets = getattr(statement, "targets", [getattr(statement, "target", alias)])
        if not any(isinstance(t, ast.Name) and t.id == name for t in targets):
            continue
        if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
            return inspect.cleandoc(str(after.value.value))
        lines = inspect.getsource(importlib.import_module(module)).splitlines()
        return _comment(lines, statement)
    return ""


def _comment(lines: list[str], statement: ast.stmt) -> str:
    """Comments directly above a statement, and the one at its end."""
    above = []
    for line in reversed(lines[: statement.lineno - 1]):
        if not line.startswith("#"):
            break
        above.append(line.lstrip("# "))
    _, _, behind = lines[statement.lineno - 1].partition("  # ")
    return " ".join([*reversed(above), behind]).strip()


def is_constant(thing: Any) -> bool:
    """Whether a public name is neither a class nor a function."""
    return not (inspect.isclass(thing) or inspect.isroutine(thing))


def summary(package: str) -> str:
    """A table of the names of a package with the first sentence about each, in Markdown."""
    module, rows = importlib.import_module(package), ["| name | meaning |", "|---|---|"]
    for name in packages()[package]:
        thing = getattr(module, name)
        about = constant_words(package, name) if is_constant(thing) else inspect.getdoc(thing)
        first = (about or "").partition("\n")[0].replace("``", "`").replace("|", "\\|")
        rows.append(f"| {{py:obj}}`{name} <{home(package, name)}.{name}>` | {first} |")
    return "\n".join(rows) if len(rows) > 2 else ""


def directives(package: str) -> str:
    """Directives of autodoc for the names of a package, in reStructuredText."""
    module = importlib.import_module(package)
    blocks = [f".. currentmodule:: {package}\n"]
    for name in packages()[package]:
        owner = home(package, name)
        if owner != package:
            blocks.append(
                f".. py:data:: {name}\n   :no-index:\n\n   See :py:obj:`{owner}.{name}`.\n"
            )
        elif is_constant(thing := getattr(module, name)):
            shown = repr(thing)
            value = f"   :value: {shown}\n" if len(shown) < 60 and "<" not in shown else ""
            words = constant_words(package, name).replace("\n", "\n   ")
            blocks.append(f".. py:data:: {name}\n{value}\n   {words}\n")
        else:
            kind = "class" if inspect.isclass(thing) else "function"
            members = "   :members:\n" if kind == "class" else ""
            blocks.append(f".. auto{kind}:: {package}.{name}\n{members}")
    return "\n".join(blocks)
