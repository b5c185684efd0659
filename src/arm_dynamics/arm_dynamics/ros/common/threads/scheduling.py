# SPDX-License-Identifier: Apache-2.0
"""Scheduling of the middleware's threads and the loop's, as far as it needs no privileges."""

import ctypes
import os
import platform
import struct
from contextlib import suppress
from pathlib import Path

# Names of threads in Fast DDS.
_ALL, _TIMERS, _BY_SHARED_MEMORY, _BY_NETWORK = "dds.", "dds.ev", "dds.shm", "dds.udp"
_TASKS = Path("/proc/self/task")
_AT_WORK = ("R", "D")  # states of threads in proc(5): on a processor or waiting for one, or a disk
_SCHED_SETATTR = {"x86_64": 314, "aarch64": 274}  # Linux's numbers of the system call
# Size, policy, flags, nice, priority, slice, two deadlines.
_SCHED_ATTR = struct.Struct("IIQiIQQQ")
_SHORT = 100_000  # [ns], the shortest time slice that Linux allows


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
        for stat in self._states:
            with suppress(OSError):  # the thread has ended
                if stat.read_text(encoding="utf-8").rpartition(")")[2].split()[0] in _AT_WORK:
                    return True
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
        attributes = _SCHED_ATTR.pack(_SCHED_ATTR.size, policy, 0, nice, 0, _SHORT, 0, 0)
        ctypes.CDLL(None).syscall(number, thread, attributes, 0)
