# SPDX-License-Identifier: Apache-2.0
"""Child processes that are always terminated, each with its own log."""

import os
import signal
import socket
import subprocess
import sys
from contextlib import AbstractContextManager
from pathlib import Path

import click

from arm_dynamics.ros.common.transport import clear_dead
from arm_sim.cli.interrupts import handled_by

_PATIENCE = 5.0  # [s] for a clean exit
_TAIL = 12  # lines of a log in a message
_DOMAINS = range(1, 100)


class DemoFailed(click.ClickException):
    """The loop was not closed; the message states the reason."""


class Processes(AbstractContextManager["Processes"]):
    """Child processes by name; leaving the ``with`` statement ends those that still run."""

    def __init__(self, folder: Path) -> None:
        """Write logs to ``folder``."""
        self._folder = folder
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def __exit__(self, *_: object) -> None:
        """End all child processes, the newest first, ignoring interrupts."""
        with handled_by(signal.SIG_IGN):
            self.stop(*reversed(self._running))

    def start(self, name: str, *arguments: str) -> subprocess.Popen[bytes]:
        """Run a command of the suite.

        Args:
            name: Name of the process and its log.
            arguments: The command line after ``./arm``.
        """
        with self.log(name).open("wb") as log:
            self._running[name] = subprocess.Popen(
                [sys.executable, "-P", "-m", "arm_sim.cli", *arguments],
                stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                start_new_session=True,  # Ctrl-C is passed on to them in order
            )  # fmt: skip
        return self._running[name]

    def check(self) -> None:
        """Check that all processes are running.

        Raises:
            DemoFailed: If one has ended.
        """
        for name, process in self._running.items():
            if (status := process.poll()) is not None:
                how = f"with status {status}"
                if status < 0:
                    how = f"(killed by {signal.Signals(-status).name})"
                log = self.tail(name) or "its log is empty"
                raise DemoFailed(f"the {name} process ended unexpectedly {how}:\n{log}")

    def stop(self, *names: str) -> None:
        """Ask all processes to end, and kill those that do not."""
        running = [self._running[name] for name in names if name in self._running]
        for process in running:
            process.send_signal(signal.SIGINT)  # ignored if it has ended
        for process in running:
            try:
                process.wait(_PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        if any(process.returncode == -signal.SIGKILL for process in running):
            clear_dead()
        for name in names:
            self._running.pop(name, None)

    def log(self, name: str) -> Path:
        """Log file of a process."""
        return self._folder / f"{name}.log"

    def tail(self, name: str) -> str:
        """The last lines of a process's log, indented."""
        lines = self.log(name).read_text(errors="replace").splitlines()[-_TAIL:]
        return "\n".join(f"    {line}" for line in lines)


def free_domain() -> int:
    """A ROS domain that is not in use on this machine: its first discovery port is free.

    Port numbers: OMG RTPS 2.5, section 9.6.1.1.

    Raises:
        DemoFailed: If all are taken.
    """
    first = os.getpid() % len(_DOMAINS)
    for domain in (*_DOMAINS[first:], *_DOMAINS[:first]):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("", 7410 + 250 * domain))
            except OSError:
                continue
            return domain
    raise DemoFailed("every ROS domain from 1 to 99 is in use on this machine")
