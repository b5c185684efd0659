# SPDX-License-Identifier: Apache-2.0
"""Many cases on all cores, each in its own process: that one hangs or crashes is a result."""

import logging
import os
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from multiprocessing import get_context
from multiprocessing.connection import Connection

from benchmarks.stress.judge import CRASHED, HUNG, Result, examine

PATIENCE = 1800.0  # [s] for what a case has to compile and for its runs
Work = tuple[str, int, int, float]

_processes = get_context("forkserver")
_processes.set_forkserver_preload(["benchmarks.stress.judge"])


def survey(work: Sequence[Work], workers: int) -> Iterator[list[Result]]:
    """Examine many cases side by side, with a cache of compiled code that is removed then."""
    with tempfile.TemporaryDirectory(prefix="stress-") as folder:
        pool = ThreadPoolExecutor(workers)
        try:
            for job in as_completed([pool.submit(apart, each, folder) for each in work]):
                yield job.result()
        finally:
            pool.shutdown(cancel_futures=True)


def apart(work: Work, folder: str) -> list[Result]:
    """What a case's process sends, or what became of it."""
    here, there = _processes.Pipe(duplex=False)
    process = _processes.Process(target=_case, args=(there, work, folder))
    process.start()
    there.close()
    kind, seed, *_ = work
    lost = Result(kind, seed, "every method", 0.0, HUNG, message=f"nothing within {PATIENCE:g} s")
    try:
        if here.poll(PATIENCE):
            results: list[Result] = here.recv()
            return results
        return [lost]
    except EOFError:
        return [Result(kind, seed, "every method", 0.0, CRASHED)]
    finally:
        process.kill()
        process.join()


def _case(there: Connection, work: Work, folder: str) -> None:
    os.environ["XDG_CACHE_HOME"] = folder
    logging.disable(logging.WARNING)  # what is not trusted is counted
    there.send(examine(*work))
