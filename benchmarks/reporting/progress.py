# SPDX-License-Identifier: Apache-2.0
"""A progress bar that draws only between measurements, never during one."""

import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

DRAW_EVERY = 0.1  # [s]


class Bar:
    """One line for the stage that runs, one bar; no refresh thread, which would cost time."""

    def __init__(self, console: Console) -> None:
        self._rich = Progress(
            TextColumn("{task.description:<38}"), BarColumn(), MofNCompleteColumn(),
            TimeElapsedColumn(), console=console, auto_refresh=False,
        )  # fmt: skip
        self._task = self._rich.add_task("starting", total=None)
        self._began = time.perf_counter()
        self._drawn = 0.0

    @property
    def elapsed(self) -> float:
        return time.perf_counter() - self._began

    def __enter__(self) -> Self:
        self._rich.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._rich.stop()

    def stage(self, text: str, total: int | None) -> None:
        self._rich.reset(self._task, description=text, total=total)
        self._rich.refresh()

    def advance(self) -> None:
        self._rich.advance(self._task)
        now = time.perf_counter()
        if now - self._drawn > DRAW_EVERY:
            self._drawn = now
            self._rich.refresh()
