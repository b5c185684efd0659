# SPDX-License-Identifier: Apache-2.0
"""Lines that are typed into a terminal or by a program, and what they print there."""

import os
import pty
import select
import signal
import subprocess
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

PATIENCE = 300.0  # [s]


class Typed:
    """A line that was typed, and goes on; with ``screen=False`` it writes to a pipe."""

    def __init__(
        self, line: str, folder: Path, environment: dict[str, str], *, screen: bool = True
    ) -> None:
        self.line, self.said, self._ended = line, "", False
        self._output, end = pty.openpty() if screen else os.pipe()
        self.process = subprocess.Popen(
            ["bash", "-c", line], cwd=folder, env=environment, stdin=subprocess.DEVNULL,
            stdout=end, stderr=end, start_new_session=True,
        )  # fmt: skip
        os.close(end)

    def _hear(self) -> None:
        """Take what it says within a moment."""
        if not select.select([self._output], [], [], 0.02)[0]:
            return
        text = b""
        with suppress(OSError):  # the other end is closed
            text = os.read(self._output, 4096)
        self.said += text.decode(errors="replace")
        if not text:
            self._ended = True
            self.process.wait()

    def until(self, works: Callable[[], object]) -> None:
        """Listen until it works; it must not end before."""
        end = time.monotonic() + PATIENCE
        while not works():
            self._hear()
            assert not self._ended, f"$ {self.line}\nhas ended:\n{self.said[-3000:]}"
            assert time.monotonic() < end, f"$ {self.line}\ndoes not work:\n{self.said[-3000:]}"

    def finish(self) -> str:
        """Listen until it ends, which must be a success; returns what it has said."""
        end = time.monotonic() + PATIENCE
        while not self._ended:
            self._hear()
            assert time.monotonic() < end, f"$ {self.line}\nis not done:\n{self.said[-3000:]}"
        assert self.process.returncode == 0, self.said
        return self.said

    def end(self) -> int:
        """Press Ctrl-C, or more; returns its exit status."""
        for press in (signal.SIGINT, signal.SIGKILL):
            if self.process.poll() is None:
                os.killpg(self.process.pid, press)
                with suppress(subprocess.TimeoutExpired):
                    self.process.wait(30.0)
        os.close(self._output)
        return self.process.returncode
