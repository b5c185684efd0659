# SPDX-License-Identifier: Apache-2.0
"""Distribution of runs to processes of this machine or a cluster; rows return in any order."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from threading import Thread
from typing import Any

from arm_dynamics import ArmError
from arm_dynamics.exceptions import InvalidInput, missing, plain
from arm_sim.inputs import check_whole
from arm_studies.sweeps.runs import Job, Recipe, Row
from arm_studies.sweeps.world import world_of

_TIMEOUT = 10  # [s] timeout of a scheduler
_WATCH_INTERVAL = 0.5  # [s] between checks of a worker for its parent


@dataclass(frozen=True)
class Task:
    """Some runs of one world; without runs the world is only built, which fills the code cache.

    Attributes:
        recipe: Recipe of the world.
        jobs: The runs.
        compiled: Whether its runs are simulated entirely in compiled code.
    """

    recipe: Recipe
    jobs: tuple[Job, ...]
    compiled: bool


def run_task(task: Task, parent: int | None = None) -> list[Row]:
    """Rows of the runs of a task, in a process that ends with its parent, even if that is killed.

    Args:
        task: The task.
        parent: Process id of the parent; None in a process that does not end with it.
    """
    if parent is not None:
        _end_with_parent(parent)
    try:
        world = world_of(task.recipe)
        if task.compiled:
            world.compile()
    except ArmError as error:
        return [Row.failed(job, error, task.recipe.metrics) for job in task.jobs]
    return world.rows(task.jobs)


@cache
def _end_with_parent(parent: int) -> None:
    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_WATCH_INTERVAL)
        os._exit(1)

    Thread(target=watch, daemon=True).start()


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0))


def check_libraries(workers: int | None, cluster: str | None) -> None:
    """Find the libraries by which runs are shared out.

    Raises:
        InvalidInput: If one is missing.
    """
    alone = cluster is None and (cores() if workers is None else workers) == 1
    for module in () if alone else ("joblib", *(("distributed",) if cluster else ())):
        if find_spec(module) is None:
            raise InvalidInput(missing(module, "sweep") + "; a single worker does not require it")


@contextmanager
def worker_pool(workers: int | None, cluster: str | None) -> Iterator[Workers]:
    """The workers, for the duration of the context.

    Args:
        workers: Number of processes; None for one per core, 1 for this process alone.
        cluster: Address of a Dask scheduler, whose workers are used instead.

    Raises:
        InvalidInput: If no scheduler answers at the address.
    """
    if workers is not None:
        check_whole("workers", workers, 1)
    if cluster is not None:
        if workers is not None:
            raise InvalidInput("workers and cluster are given; a cluster has its own workers")
        import distributed

        try:
            connection = distributed.Client(cluster, timeout=_TIMEOUT, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise InvalidInput(
                f"cluster = {cluster!r}: no Dask scheduler answers there ({plain(error, 200)}); "
                "the address that 'dask scheduler' prints is expected, such as tcp://10.0.0.2:8786"
            ) from None
        with connection as client:
            threads = sum(client.nthreads().values())
            if not threads:
                raise InvalidInput(f"cluster '{cluster}' has no workers; at least one is expected")
            yield Workers(threads, {"backend": "dask", "client": client, "n_jobs": threads})
        return
    count = cores() if workers is None else workers
    if count == 1:
        yield Workers(1, None)
        return
    from joblib.externals.loky import get_reusable_executor

    try:
        yield Workers(count, {"backend": "loky", "n_jobs": count})
    finally:
        get_reusable_executor(max_workers=count).shutdown(wait=True, kill_workers=True)


@dataclass(frozen=True)
class Workers:
    """Workers.

    Attributes:
        size: Number of workers in parallel.
        backend: Backend of joblib; None for this process alone.
    """

    size: int
    backend: dict[str, Any] | None

    def results(self, tasks: Iterable[Task]) -> Iterator[list[Row]]:
        """Rows of each, in order of completion; tasks are taken as workers become free."""
        if self.backend is None:
            yield from map(run_task, tasks)
            return
        from joblib import Parallel, delayed, parallel_config

        parent = os.getpid() if self.backend["backend"] == "loky" else None
        try:
            with parallel_config(**self.backend):
                parallel = Parallel(return_as="generator_unordered", batch_size=1)
                yield from parallel(delayed(run_task)(task, parent) for task in tasks)
        except (RuntimeError, ConnectionError) as error:
            of_joblib = isinstance(error, BrokenExecutor | ConnectionError)
            if not of_joblib and type(error).__module__.partition(".")[0] != "distributed":
                raise
            raise ArmError(
                "workers ended before their runs were done (killed, or out of memory); with an "
                "output folder, finished runs are kept and the same call continues from there"
            ) from error
