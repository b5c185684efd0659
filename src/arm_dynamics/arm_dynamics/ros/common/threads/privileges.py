# SPDX-License-Identifier: Apache-2.0
"""Privileges of the thread that keeps a node's deadlines, with a clear message if denied."""

import ctypes
import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.ros.common.params import parameter

_MCL_CURRENT_AND_FUTURE = 3
_TASKS = Path("/proc/self/task")


@dataclass(frozen=True)
class ThreadParams:
    """Parameters of the thread that keeps a node's deadlines."""

    priority: int = parameter(
        0, "Real-time priority of the loop (SCHED_FIFO); 0: an ordinary thread", low=0, high=99
    )
    cpus: str = parameter("", "Processors that the loop may run on, such as '0, 2'; empty: all")
    lock_memory: bool = parameter(False, "Keep the process's memory from being swapped")
    freeze_garbage: bool = parameter(
        True, "Exclude objects that exist at the start from garbage collection, where the node "
        "has a process of its own",
    )  # fmt: skip

    def __post_init__(self) -> None:
        """Refuse processors that cannot be read."""
        read_cpus(self.cpus)

    def claim(self) -> list[str]:
        """Request all privileges for the calling thread and its process.

        The process's other threads get a priority one below.

        Returns:
            A message for each privilege that was not granted, with the reason.
        """
        refused, cpus = [], read_cpus(self.cpus)
        for requested, request, refusal in (
            (self.priority, self._raise_priority,
             "no real-time priority (allow it by ulimit -r or CAP_SYS_NICE)"),
            (cpus, lambda: os.sched_setaffinity(0, cpus), "no processors of its own"),
            (self.lock_memory, _lock_memory,
             "memory is not locked (allow it by ulimit -l or CAP_IPC_LOCK)"),
        ):  # fmt: skip
            try:
                if requested:
                    request()
            except (OSError, AttributeError, ValueError) as error:
                refused.append(f"{refusal}: {error}")
        return refused

    def _raise_priority(self) -> None:
        # The others one below: a thread that waits for the interpreter lock, or for a message,
        # waits for the thread that holds it.
        below = os.sched_param(max(1, self.priority - 1))
        for task in _TASKS.iterdir():
            with suppress(ProcessLookupError):  # the thread has ended
                os.sched_setscheduler(int(task.name), os.SCHED_FIFO, below)
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(self.priority))


def read_cpus(text: str) -> tuple[int, ...]:
    """Read a list of processors such as ``0, 2``.

    Raises:
        InvalidInput: If it is not such a list.
    """
    try:
        cpus = tuple(int(word) for word in text.replace(",", " ").split())
    except ValueError:
        cpus = (-1,)
    if any(cpu < 0 for cpu in cpus):
        raise InvalidInput(f"cpus = '{text}'; allowed: numbers of processors such as '0, 2'")
    return cpus


def _lock_memory() -> None:
    if ctypes.CDLL(None, use_errno=True).mlockall(_MCL_CURRENT_AND_FUTURE):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
