# SPDX-License-Identifier: Apache-2.0
"""A progress bar that draws only between measurements, never during one."""

import time

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

DRAW_EVERY = 0.1  # [s]


class Bar(Progress):
    """One line for the stage that runs, one bar; no refresh thread, which would cost time."""

    def __init__(self, console: Console) -> None:
        columns = BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
        text = TextColumn("{task.description:<38}")
        super().__init__(text, *columns, console=console, auto_refresh=False)
        self._task = self.add_task("starting", total=None)
        self._drawn = 0.0

    def stage(self, text: str, total: int | None) -> None:
        self.reset(self._task, description=text, total=total)
        self.refresh()

    def done(self) -> None:
        """One job of the stage is done."""
        self.advance(self._task)
        now = time.perf_counter()
        if now - self._drawn > DRAW_EVERY:
            self._drawn = now
            self.refresh()
