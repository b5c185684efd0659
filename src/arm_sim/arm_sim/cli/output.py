# SPDX-License-Identifier: Apache-2.0
"""How the command line writes numbers and tables."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from threading import Timer
from typing import TYPE_CHECKING, Any

from arm_dynamics.logs import heard_by

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

PATIENCE = 2.0  # [s] without a word
_WIDE = 200  # columns where no window sets them, so that a pipe gets whole lines


def examples(*lines: str) -> str:
    """The end of a command's help: lines as they are to be typed, never re-wrapped."""
    return "\b\n" + "\n".join(
        ["Example:" if len(lines) == 1 else "Examples:", *(f"  {x}" for x in lines)]
    )


def console() -> Console:
    """A console as wide as the window, or as wide as the text where there is no window."""
    from rich.console import Console

    width = None if sys.stdout.isatty() else _WIDE
    return Console(width=width, highlight=False, emoji=False)


def told_meanwhile() -> AbstractContextManager[None]:
    """Say on stderr what the cores are busy with, as they log it, while the context lasts."""
    return heard_by(_Said())


class _Said(logging.Handler):
    """Writes to what is stderr at the time, so that lines go above a bar."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write a line; where it cannot be written, as on a full disk, go on without."""
        try:
            print(self.format(record), file=sys.stderr)
        except OSError:
            self.handleError(record)


@contextmanager
def waiting(what: str) -> Iterator[None]:
    """Show on a terminal what is waited for, and for how long, once that is two seconds."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    progress = Progress(*columns, console=Console(stderr=True), transient=True)
    progress.add_task(what, total=None)
    begin = Timer(PATIENCE, progress.start)
    begin.start()
    try:
        yield
    finally:
        begin.cancel()
        begin.join()
        progress.stop()


def table(
    columns: Sequence[str], rows: Iterable[Sequence[str]], text: Sequence[int] = (0,)
) -> Table:
    """A table with headings; the columns ``text`` begin at the left, numbers end at the right."""
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    made = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    for i, column in enumerate(columns):
        made.add_column(escape(column), justify="left" if i in text else "right", no_wrap=True)
    for row in rows:
        made.add_row(*map(escape, row))
    return made


def facts(rows: Iterable[tuple[str, str]]) -> Table:
    """Names and what is to be said of them, long lines indented."""
    from rich.markup import escape
    from rich.table import Table

    grid = Table.grid(padding=(0, 2))
    grid.add_column(style="bold", no_wrap=True)
    grid.add_column()
    for name, value in rows:
        grid.add_row(f" {escape(name)}", escape(value))
    return grid


def show(out: Console, made: Table) -> None:
    """Print a table; in a narrow window its lines run over, but no number is ever cut."""
    from rich.console import Console

    needed = out.measure(made, options=out.options.update(max_width=10_000)).maximum
    if needed > out.width:
        out = Console(width=needed, highlight=False, emoji=False)
    out.print(made)


def number(value: Any, digits: int = 6) -> str:
    """A number to some significant digits, without the minus sign of a minus zero."""
    text = f"{float(value):.{digits}g}"
    return "0" if text == "-0" else text


def limit(value: float, digits: int = 6) -> str:
    """A limit, or a dash where there is none."""
    return "-" if abs(value) == float("inf") else number(value, digits)


def units(joint_types: Iterable[str], turning: str, sliding: str, between: str = ", ") -> str:
    """The unit of joints of these types, both where both kinds are."""
    kinds = {kind == "prismatic" for kind in joint_types}
    return between.join([turning] * (False in kinds) + [sliding] * (True in kinds))
