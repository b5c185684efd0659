# SPDX-License-Identifier: Apache-2.0
"""Lines that are typed into a terminal, and what they print there, as a reader sees it."""

import os
import pty
import re
import select
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path

PATIENCE = 300.0  # [s]


class Typed:
    """A line that was typed into a terminal."""

    def __init__(self, line: str, folder: Path, environment: dict[str, str]) -> None:
        self.line, self.said, self.silent = line, "", 0.0
        self._waits: dict[str, int] = {}
        self._screen, end = pty.openpty()
        self.process = subprocess.Popen(
            ["bash", "-c", line], cwd=folder, env=environment, stdin=subprocess.DEVNULL,
            stdout=end, stderr=end, start_new_session=True,
        )  # fmt: skip
        os.close(end)

    def _kept_waiting(self) -> float:
        """Time in [s] that its processes wanted to run while others did."""
        left = [str(self.process.pid)]
        while left:
            for task in Path("/proc", left.pop(), "task").glob("*"):
                with suppress(OSError):  # it has just ended
                    self._waits[task.name] = int((task / "schedstat").read_text().split()[1])
                    left += (task / "children").read_text().split()
        return 1e-9 * sum(self._waits.values())

    def listen(self, enough: str | None = None) -> None:
        """Listen until it ends, or has said enough."""
        begin, last = time.monotonic(), time.monotonic() - self._kept_waiting()
        while time.monotonic() - begin < PATIENCE:
            now = time.monotonic() - self._kept_waiting()
            if select.select([self._screen], [], [], 0.05)[0]:
                try:
                    self.said += os.read(self._screen, 4096).decode(errors="replace")
                    ended = False
                except OSError:  # the other end is closed
                    ended = True
                    self.process.wait()
                self.silent = max(self.silent, now - last)
                last = now
                if ended or (enough and re.search(enough, self.said)):
                    return
        raise AssertionError(f"$ {self.line}\nis not done in time:\n{self.said[-2000:]}")

    def end(self) -> None:
        """Press Ctrl-C, or more."""
        for press in (signal.SIGINT, signal.SIGKILL):
            if self.process.poll() is None:
                os.killpg(self.process.pid, press)
                try:
                    self.process.wait(10.0)
                except subprocess.TimeoutExpired:
                    continue
        os.close(self._screen)
