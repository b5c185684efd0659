# SPDX-License-Identifier: Apache-2.0
"""Scheduling of threads: privileges with a clear message if denied, and what needs none."""

from __future__ import annotations

import ctypes
import gc
import os
import platform
import struct
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.ros.common.params import parameter

_MCL_CURRENT_AND_FUTURE = 3
# Names of threads in Fast DDS.
_ALL, _TIMERS, _BY_SHARED_MEMORY, _BY_NETWORK = "dds.", "dds.ev", "dds.shm", "dds.udp"
_TASKS = Path("/proc/self/task")
_AT_WORK = ("R", "D")  # states of threads in proc(5): on a processor or waiting for one, or a disk
_SCHED_SETATTR = {"x86_64": 314, "aarch64": 274}  # Linux's numbers of the system call
# Size, policy, flags, nice, priority, slice, two deadlines.
_SCHED_ATTR = struct.Struct("IIQiIQQQ")
_SHORT = 100_000  # [ns], the shortest time slice that Linux allows


@dataclass(frozen=True)
class ThreadParams:
    """Parameters of the thread that keeps a node's deadlines."""

    priority: int = parameter(
        0, "Real-time priority of the loop (SCHED_FIFO); 0: an ordinary thread", low=0, high=99
    )
    cpus: str = parameter("", "Processors that the loop may run on, such as '0, 2'; empty: all")
    lock_memory: bool = parameter(False, "Keep the process's memory from being swapped")
    freeze_garbage: bool = parameter(
        True,
        "Exclude objects that exist at the start from garbage collection, where the node has "
        "a process of its own",
    )

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
        for wanted, ask, missing in (
            (self.priority, self._raise_priority,
             "no real-time priority (allow it by ulimit -r or CAP_SYS_NICE)"),
            (cpus, lambda: os.sched_setaffinity(0, cpus), "no processors of its own"),
            (self.lock_memory, _lock_memory,
             "memory is not locked (allow it by ulimit -l or CAP_IPC_LOCK)"),
        ):  # fmt: skip
            try:
                if wanted:
                    ask()
            except (OSError, AttributeError, ValueError) as error:
                refused.append(f"{missing}: {error}")
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


def arrange_middleware_threads() -> None:
    """Let Fast DDS's receivers run soon after messages arrive, without interrupting the sender.

    Who sends by shared memory wakes the receiver while it holds a lock that the receiver needs: if
    the receiver ran at once on the sender's processor, both would be switched twice more, for a
    quarter of the processor time of a loop at 1 kHz. A reliable message also wakes the timer
    thread four times, and the sender waits: 7 % of a service call. Threads of real-time priority
    keep it.
    """
    for task in _TASKS.glob("*"):
        with suppress(OSError):  # the thread has ended
            thread, name = int(task.name), (task / "comm").read_text(encoding="utf-8")
            if os.sched_getscheduler(thread) != os.SCHED_OTHER:
                continue
            if name.startswith(_TIMERS):
                os.sched_setscheduler(thread, os.SCHED_BATCH, os.sched_param(0))
            elif name.startswith(_BY_SHARED_MEMORY):
                shorten_slice(thread, interrupts=False)
            elif name.startswith(_BY_NETWORK):
                shorten_slice(thread)


class MiddlewareThreads:
    """Fast DDS's threads of this process that exist when this is made; none elsewhere."""

    def __init__(self) -> None:
        self._states = list[Path]()
        for task in _TASKS.glob("*"):
            with suppress(OSError):  # the thread has ended
                if (task / "comm").read_text(encoding="utf-8").startswith(_ALL):
                    self._states.append(task / "stat")

    @property
    def busy(self) -> bool:
        """Whether one of them is at work, or waits for a processor.

        Then messages may have arrived on this machine that cannot be read yet. While all of them
        sleep, whatever has arrived can be read.
        """
        return any(map(_is_at_work, self._states))


def _is_at_work(stat: Path) -> bool:
    with suppress(OSError):  # the thread has ended
        return stat.read_text(encoding="utf-8").rpartition(")")[2].split()[0] in _AT_WORK
    return False


def shorten_slice(thread: int = 0, *, interrupts: bool = True) -> None:
    """Let a thread run as soon as it wakes although others are running, as far as that is fair.

    Linux, from version 6.12, interrupts a thread for one with a shorter time slice if both have
    had their share of the processor (docs.kernel.org/scheduler/sched-eevdf.html). Needs no
    privileges; priority and share stay the same. Without effect on other systems.

    Args:
        thread: Number that the system gave to the thread; 0: the calling thread.
        interrupts: Whether it interrupts others when it wakes; else it is only the next.
    """
    number = _SCHED_SETATTR.get(platform.machine())
    with suppress(OSError, AttributeError):  # not Linux, or the thread has ended
        if number is None or os.sched_getscheduler(thread) != os.SCHED_OTHER:
            return
        policy = os.SCHED_OTHER if interrupts else os.SCHED_BATCH
        nice = os.getpriority(os.PRIO_PROCESS, thread)
        wanted = _SCHED_ATTR.pack(_SCHED_ATTR.size, policy, 0, nice, 0, _SHORT, 0, 0)
        ctypes.CDLL(None).syscall(number, thread, wanted, 0)


def freeze_garbage() -> None:
    """Exclude all existing objects from garbage collection; for a process with one node."""
    gc.collect()
    gc.freeze()
