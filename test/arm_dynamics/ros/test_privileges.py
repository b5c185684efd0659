# SPDX-License-Identifier: Apache-2.0
"""Privileges that are granted take effect, others are reported; scheduling that needs none."""

import ctypes
import hashlib
import os
import platform
import struct
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest
from harness import Ros

from arm_dynamics import InvalidInput
from arm_dynamics.ros.common.threads import privileges, scheduling
from arm_dynamics.ros.common.threads.privileges import ThreadParams, read_cpus
from arm_dynamics.ros.common.threads.scheduling import (
    MiddlewareThreads,
    arrange_middleware_threads,
)

pytestmark = pytest.mark.ros


def claimed(wanted: ThreadParams) -> tuple[list[str], set[int]]:
    """What a thread of its own is refused, and where it may run."""
    result: list[tuple[list[str], set[int]]] = []
    thread = threading.Thread(
        target=lambda: result.append((wanted.claim(), os.sched_getaffinity(0)))
    )
    thread.start()
    thread.join()
    return result[0]


def thread_names() -> dict[int, str]:
    """Of this process; a thread of another test may end while they are read."""
    names = {}
    for task in Path("/proc/self/task").iterdir():
        with suppress(OSError):
            names[int(task.name)] = (task / "comm").read_text()
    return names


def test_a_processor_of_its_own() -> None:
    here = os.sched_getaffinity(0)
    assert claimed(ThreadParams()) == ([], here)
    assert claimed(ThreadParams(cpus=str(min(here)))) == ([], {min(here)})


def test_timers_of_dds_do_not_interrupt_the_loop(ros: Ros) -> None:
    """``ros`` has joined the graph, so that Fast DDS has a thread for timers."""

    def policies() -> set[int]:
        found = [task for task, name in thread_names().items() if name.startswith("dds.ev")]
        return {os.sched_getscheduler(task) for task in found}

    assert os.SCHED_OTHER in policies()
    arrange_middleware_threads()
    assert policies() == {os.SCHED_BATCH}
    assert os.sched_getscheduler(0) == os.SCHED_OTHER


def test_the_middleware_is_busy_while_one_of_its_threads_is_not_asleep() -> None:
    """With a thread named like one of Fast DDS, which sleeps, works without the lock, sleeps."""
    work, rest, ready, done = (threading.Event() for _ in range(4))

    def live() -> None:
        ctypes.CDLL(None).prctl(15, b"dds.udp.test")
        ready.set()
        work.wait()
        hashlib.sha256(bytes(2**28))
        done.set()
        rest.wait()

    other = MiddlewareThreads()  # made before: it does not know the thread
    thread = threading.Thread(target=live)
    thread.start()
    ready.wait()
    middleware = MiddlewareThreads()

    def falls_asleep(threads: MiddlewareThreads = middleware) -> bool:
        end = time.monotonic() + 20.0
        while (busy := threads.busy) and time.monotonic() < end:
            time.sleep(0.001)
        return not busy

    assert falls_asleep()
    work.set()
    seen = [middleware.busy for _ in iter(done.is_set, True)]
    assert sum(seen) > 10
    assert falls_asleep()
    rest.set()
    thread.join()
    assert falls_asleep()  # the thread is gone, a moment after it is joined
    assert falls_asleep(other)


def slice_of(thread: int) -> int:
    """The time slice of a thread in [ns]; 0 before Linux 6.12."""
    number = scheduling._SCHED_SETATTR[platform.machine()] + 1
    attributes = ctypes.create_string_buffer(56)
    ctypes.CDLL(None).syscall(number, thread, attributes, len(attributes), 0)
    return struct.unpack_from("Q", attributes, 24)[0]


@pytest.mark.skipif(platform.machine() not in scheduling._SCHED_SETATTR, reason="processor")
def test_receivers_of_dds_are_the_next_to_run_when_messages_arrive(ros: Ros) -> None:
    if not slice_of(0):
        pytest.skip("Linux before 6.12 has no time slices of threads")
    arrange_middleware_threads()
    names = thread_names()
    receivers = [x for x, name in names.items() if name.startswith(("dds.shm", "dds.udp"))]
    assert receivers and slice_of(0) > 100_000
    for task in receivers:
        assert slice_of(task) == 100_000
        # Only those that the sender itself does not wake interrupt others.
        interrupts = os.sched_getscheduler(task) == os.SCHED_OTHER
        assert interrupts == names[task].startswith("dds.udp"), names[task]


def test_refusals_are_said_and_the_rest_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.setattr(privileges.ctypes, "CDLL", refuse)
    cpu = min(os.sched_getaffinity(0))
    refused, cpus = claimed(ThreadParams(priority=50, cpus=str(cpu), lock_memory=True))
    assert len(refused) == 2
    assert "no real-time priority" in refused[0]
    assert "ulimit -l" in refused[1]
    assert cpus == {cpu}


def test_lists_of_processors() -> None:
    assert [read_cpus(text) for text in ("", "1", "0, 2 3")] == [(), (1,), (0, 2, 3)]
    for text in ("a", "-1", "1.5", "0;1"):
        with pytest.raises(InvalidInput, match="numbers of processors"):
            ThreadParams(cpus=text)
    refused, _ = claimed(ThreadParams(cpus="9999"))
    assert "no processors of its own" in refused[0]


def test_the_loop_is_the_most_urgent_thread_of_its_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The others are one below, but real-time threads, too; some may end meanwhile."""
    asked: list[tuple[int, int, int]] = []

    def schedule(task: int, policy: int, wanted: os.sched_param) -> None:
        asked.append((task, policy, wanted.sched_priority))
        if task:
            raise ProcessLookupError(3, "No such process")

    monkeypatch.setattr(os, "sched_setscheduler", schedule)
    tasks = {11, 12, 13}  # not the threads of this process: some of other tests may end here
    for task in tasks:
        (tmp_path / str(task)).mkdir()
    monkeypatch.setattr(privileges, "_TASKS", tmp_path)
    for priority, others in ((80, 79), (1, 1)):
        asked.clear()
        assert ThreadParams(priority=priority).claim() == []
        *rest, own = asked
        assert own == (0, os.SCHED_FIFO, priority)
        assert set(rest) == {(task, os.SCHED_FIFO, others) for task in tasks}
