# SPDX-License-Identifier: Apache-2.0
"""How the command line writes numbers and tables."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

_WIDE = 200  # columns where nobody's window sets them, so that a pipe gets whole lines


def console(stderr: bool = False) -> Console:
    """A console as wide as the window, or as wide as the text where there is no window."""
    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    return Console(
        stderr=stderr, width=None if stream.isatty() else _WIDE, highlight=False, emoji=False
    )


def table(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    """A table whose first column is text and whose others are numbers.

    Args:
        title: Written above it.
        columns: Headings.
        rows: Cells, already as text.
    """
    from rich import box
    from rich.table import Table

    made = Table(title=title, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD)
    for i, column in enumerate(columns):
        made.add_column(column, justify="right" if i else "left", no_wrap=i == 0)
    for row in rows:
        made.add_row(*row)
    return made


def number(value: Any, digits: int = 6) -> str:
    """A number as people write it: no noise digits, a minus sign for minus zero is dropped.

    Args:
        value: The number.
        digits: Significant digits.
    """
    text = f"{float(value):.{digits}g}"
    return "0" if text == "-0" else text


def limit(value: float, digits: int = 6) -> str:
    """A limit, or a dash where there is none."""
    return "-" if abs(value) == float("inf") else number(value, digits)


def unit(joint_type: str, turning: str, sliding: str) -> str:
    """The unit that belongs to a joint's type."""
    return sliding if joint_type == "prismatic" else turning
