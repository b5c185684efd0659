# SPDX-License-Identifier: Apache-2.0
"""Output of the command line: numbers, tables and progress."""

from __future__ import annotations

import io
import json
import logging
import math
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from shutil import get_terminal_size
from threading import Event, Thread
from time import monotonic
from typing import TYPE_CHECKING, Any, TextIO

from arm_dynamics.exceptions import ARM
from arm_dynamics.logs import heard_by

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from arm_sim.recording import Recording

PATIENCE = 2.0  # [s] without output
_WIDE = 200  # columns without a terminal, so that a pipe gets whole lines


def as_called(text: str) -> str:
    """Text with the command as it is called here: ``arm`` where pip has installed it."""
    return re.sub(r"\./arm(?![\w/-]|\.\w)", ARM, text)


def examples(*lines: str) -> str:
    """Examples at the end of a command's help, which are never re-wrapped."""
    title = "Example:" if len(lines) == 1 else "Examples:"
    return as_called("\n".join(["\b", title, *(f"  {line}" for line in lines)]))


def console() -> Console:
    """A console as wide as the terminal; without a terminal, as wide as the text."""
    from rich.console import Console

    return Console(width=None if sys.stdout.isatty() else _WIDE, highlight=False, emoji=False)


def print_anything() -> None:
    """Print a question mark in place of a character that the encoding of the output lacks."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            with suppress(OSError):  # it is flushed first, which may fail
                stream.reconfigure(errors="replace")


def progress_on_stderr() -> AbstractContextManager[None]:
    """Print progress messages of the cores on stderr within the context."""
    return heard_by(_StderrHandler())


class _StderrHandler(logging.Handler):
    """Writes to the current stderr, so that lines appear above a progress bar."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write a line; ignore errors, as on a full disk."""
        try:
            print(as_called(self.format(record)), file=sys.stderr)
        except OSError:
            self.handleError(record)


_tasks: list[Callable[[], str]] = []  # that the command waits for, the innermost last


@contextmanager
def waiting(task: str | Callable[[], str], *, in_lines: bool = False) -> Iterator[None]:
    """Print on a terminal, before two seconds have passed, what the command waits for.

    Args:
        task: The text, or a function that returns the present one.
        in_lines: Also print it without a terminal, in lines, each after twice the time.
    """
    _tasks.append(task if callable(task) else lambda: task)
    end, in_place = Event(), sys.stderr.isatty()
    report = _report if (in_place or in_lines) and len(_tasks) == 1 else None
    reporter = Thread(target=report, args=(end, sys.stderr, in_place), daemon=True)
    reporter.start()
    try:
        yield
    finally:
        end.set()
        reporter.join()
        _tasks.pop()


def _report(end: Event, stream: TextIO, in_place: bool) -> None:
    """Print the innermost task until the end; lines at growing intervals fill no log."""
    begin, pause, erase = monotonic(), 0.5 * PATIENCE, ""
    while not end.wait(pause):
        text = f"{_tasks[-1]()} … {monotonic() - begin:.0f} s"
        if in_place:
            erase, pause = "\r\033[K", 0.5
            text = f"{erase}{text[: get_terminal_size().columns - 1]}"
        else:
            pause *= 2.0
        print(text, end="" if in_place else "\n", file=stream, flush=True)
    print(erase, end="", file=stream, flush=True)


@contextmanager
def progress(
    stream: TextIO, otherwise: Callable[..., object] = lambda **_: None, *columns: Any,
    refresh: bool = False, **task: Any,
) -> Iterator[Callable[..., object]]:  # fmt: skip
    """Show progress by a bar on a terminal; yields a function that updates it.

    Args:
        stream: Where to show it.
        otherwise: Receives the updates without a terminal.
        columns: Columns of the bar; by default its text, the bar and a percentage.
        refresh: Draw it at each update, not from a thread of its own.
        task: First update: description, completed, total.
    """
    if not stream.isatty():
        yield otherwise
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn

    columns = columns or ("{task.description}", BarColumn(), TaskProgressColumn())
    with Progress(
        *columns, console=Console(file=stream), transient=True, auto_refresh=not refresh
    ) as display:
        task_id = display.add_task(**{"description": "", "total": None, **task})
        yield lambda **changes: display.update(task_id, refresh=refresh, **changes)


def to_json(facts: Mapping[str, Any], indent: int | None = None) -> str:
    """Facts as JSON: arrays and sets as lists, null for numbers that it lacks."""
    return json.dumps(_plain(facts), indent=indent, default=str)


def _plain(value: Any) -> Any:
    """A value as JSON knows it: lists, names, and null where a number is not finite."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {name: _plain(entry) for name, entry in value.items()}
    if isinstance(value, frozenset):
        value = sorted(value)
    if isinstance(value, list | tuple | bytes):
        return [_plain(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@contextmanager
def quiet() -> Iterator[None]:
    """Log no warnings, as the command prints their content itself."""
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        yield
    finally:
        logging.disable(before)


def checked(recording: Recording) -> str:
    """The verdict of a second run, without warnings, and with progress."""
    with waiting("checking by a second run"), quiet():
        return recording.verdict


def table(
    columns: Sequence[str], rows: Iterable[Sequence[str]], text: Sequence[int] = (0,)
) -> Table:
    """A table with headings; the columns ``text`` are left-aligned, numbers right-aligned."""
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    grid = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    for i, column in enumerate(columns):
        grid.add_column(escape(column), justify="left" if i in text else "right", no_wrap=True)
    for row in rows:
        grid.add_row(*map(escape, row))
    return grid


def facts(rows: Iterable[tuple[str, str]]) -> Table:
    """A list of names and values, with long lines indented."""
    from rich.markup import escape
    from rich.table import Table

    grid = Table.grid(padding=(0, 2))
    grid.add_column(style="bold", no_wrap=True)
    grid.add_column()
    for name, value in rows:
        grid.add_row(f" {escape(name)}", escape(value))
    return grid


def show(out: Console, grid: Table) -> None:
    """Print a table; on a narrow terminal its lines wrap, but no number is truncated."""
    from rich.console import Console

    needed = out.measure(grid, options=out.options.update(max_width=10_000)).maximum
    if needed > out.width:
        out = Console(width=needed, highlight=False, emoji=False)
    out.print(grid)


def say(*parts: Any) -> None:
    """Print tables, and other things as they are, without markup."""
    out = console()
    for part in parts:
        if hasattr(part, "add_column"):
            show(out, part)
        else:
            out.print(str(part), markup=False)


def shortened(value: Any) -> str:
    """A text, or a value as JSON, of at most 60 characters."""
    text = value if isinstance(value, str) else to_json(value)
    return text if len(text) <= 60 else text[:59] + "…"


def number(value: Any, digits: int = 6) -> str:
    """A number with some significant digits; negative zero is printed as 0."""
    text = f"{float(value):.{digits}g}"
    return "0" if text == "-0" else text


def limit(value: float, digits: int = 6) -> str:
    """A limit, or a dash where there is none."""
    return "-" if abs(value) == float("inf") else number(value, digits)
