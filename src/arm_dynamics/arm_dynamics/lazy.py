# SPDX-License-Identifier: Apache-2.0
"""Lazy import of a package's names on first use (PEP 562)."""

import ast
import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any


def on_demand(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Make ``__getattr__`` and ``__dir__`` of a package.

    Its public names are in ``__all__``, and its block ``if TYPE_CHECKING:`` imports those that
    are to be imported on first use, each from the module that defines it.

    Args:
        package: Its ``__name__``.
        file: Its ``__file__``.
    """

    @cache
    def modules() -> dict[str, str]:
        blocks = ast.parse(Path(file).read_text(encoding="utf-8")).body
        inside = (node for block in blocks if isinstance(block, ast.If) for node in block.body)
        imports = (node for node in inside if isinstance(node, ast.ImportFrom))
        return {alias.name: str(node.module) for node in imports for alias in node.names}

    def look_up(name: str) -> Any:
        module = sys.modules[package]
        if name not in module.__all__:
            message = f"module {package!r} has no attribute {name!r}"
            raise AttributeError(message, name=name, obj=module)
        value = getattr(import_module(modules()[name]), name)
        setattr(module, name, value)  # later look-ups find it directly
        return value

    return look_up, lambda: sorted(sys.modules[package].__all__)
