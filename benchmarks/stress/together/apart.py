# SPDX-License-Identifier: Apache-2.0
"""Every case in a process of its own: that one hangs or crashes is a result like others."""

from __future__ import annotations

import logging
import os
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path

from benchmarks.stress.together.cases import draw
from benchmarks.stress.together.judge import CRASHED, SLOW, Result, examine

PATIENCE = 300.0  # [s] of processor time for what a case has to compile and for a run
WAITING = 10.0 * PATIENCE  # [s] of the clock, for a process that needs no processor
GLANCE = 1.0  # [s] between looks at a process

_processes = get_context("forkserver")
_processes.set_forkserver_preload(["benchmarks.stress.together.judge"])


def survey(seeds: Sequence[int], runs: int, workers: int) -> Iterator[list[Result]]:
    """Examine many cases side by side; compiled code goes to a folder that is removed at the end.

    Args:
        seeds: of the cases.
        runs: of each.
        workers: processes at a time.

    Yields:
        The results of a case, as they come; the same for the same seeds, in any order.
    """
    with tempfile.TemporaryDirectory(prefix="stress-") as folder:
        pool = ThreadPoolExecutor(workers)
        try:
            jobs = [pool.submit(_watched, seed, runs, folder) for seed in seeds]
            for job in as_completed(jobs):
                yield job.result()
        finally:
            pool.shutdown(cancel_futures=True)


def _watched(seed: int, runs: int, folder: str) -> list[Result]:
    """What a case's process sends, and what became of it if it does not come to an end."""
    here, there = _processes.Pipe(duplex=False)
    process = _processes.Process(target=_case, args=(there, seed, runs, folder))
    process.start()
    there.close()
    results: list[Result] = []
    while True:
        if not _comes(here, process.pid):
            process.kill()
            ended = SLOW, f"nothing within {PATIENCE:g} s of processor time"
            break
        try:
            result = here.recv()
        except EOFError:
            process.join()
            ended = CRASHED, f"the process ended with {process.exitcode}"
            break
        if result is None:
            process.join()
            return results
        results.append(result)
    process.join()
    return [*results, _ended(seed, runs, len({result.run for result in results}), *ended)]


def _comes(here: Connection, pid: int | None) -> bool:
    """Whether a process sends something before its time is up; other load does not count."""
    began, used = time.monotonic(), _used(pid)
    while not here.poll(min(GLANCE, PATIENCE)):
        if _used(pid) - used > PATIENCE or time.monotonic() - began > WAITING:
            return False
    return True


def _used(pid: int | None) -> float:
    """Processor time of a process and of the compilers that it has waited for, in [s]."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:  # it has just ended, and its pipe tells
        return 0.0
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def _ended(seed: int, runs: int, last: int, outcome: str, message: str) -> Result:
    """The run that a case's process did not come back from."""
    case = draw(seed, runs)
    return Result(
        seed, last, case.setting.name, case.setting.dt, case.label, outcome,
        familiar=case.familiar, touches=case.touches, message=message,
    )  # fmt: skip


def _case(there: Connection, seed: int, runs: int, folder: str) -> None:
    """Examine a case in a process of its own."""
    os.environ["XDG_CACHE_HOME"] = folder
    logging.getLogger("arm_sim").setLevel(logging.ERROR)  # what is not trusted is counted
    for result in examine(seed, runs):
        there.send(result)
    there.send(None)
