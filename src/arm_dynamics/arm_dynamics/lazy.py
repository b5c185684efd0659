# SPDX-License-Identifier: Apache-2.0
"""Lazy import of a package's names on first use (PEP 562)."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any


def on_demand(
    package: str, homes: Mapping[str, Sequence[str]]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Make ``__getattr__`` and ``__dir__`` of a package.

    Args:
        package: Its ``__name__``.
        homes: Public names by the module within the package that defines them.
    """
    module_of = {name: module for module, names in homes.items() for name in names}

    def look_up(name: str) -> Any:
        if name not in module_of:
            said = f"module {package!r} has no attribute {name!r}"
            raise AttributeError(said, name=name, obj=sys.modules[package])
        value = getattr(import_module(f"{package}.{module_of[name]}"), name)
        setattr(sys.modules[package], name, value)  # later look-ups find it directly
        return value

    return look_up, lambda: sorted(sys.modules[package].__all__)
