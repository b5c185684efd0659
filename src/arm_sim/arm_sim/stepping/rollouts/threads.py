# SPDX-License-Identifier: Apache-2.0
"""Arms distributed over threads; compiled code releases the interpreter lock."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache
from itertools import pairwise
from time import perf_counter

from arm_sim.inputs import check_whole

# Work in [s] that is worth a thread; with 16 of them, less takes longer than alone.
WORTH_A_THREAD = 7e-4
# Ticks of groups of arms that surely take little time.
FEW_TICKS = 2000


def share(
    arms: int, width: int, threads: int | None, work: Callable[[int, int], None], ticks: int = 0,
    halt: Callable[[], None] = lambda: None,
) -> None:  # fmt: skip
    """Distribute arms over threads in whole groups; compiled code releases the interpreter lock.

    If they have many ticks, this thread only waits, so that signals are handled.

    Args:
        arms: Number of arms.
        width: Arms in a group.
        threads: Number of threads; None for one per core, or fewer if the first group
            takes so little time that they are not worth it.
        work: Called with the first arm and the one after the last.
        ticks: Ticks of each arm.
        halt: Lets all that works return soon, after an exception.

    Raises:
        InvalidInput: If the number of threads is not positive.
    """
    if threads is not None:
        check_whole("threads", threads, 1)
    count, groups = threads or len(os.sched_getaffinity(0)), -(-arms // width)
    first = 0  # group that is not worked on yet
    if threads is None and count > 1 and groups > 1 and ticks <= FEW_TICKS:
        count, first = min(count, _measured_count(width, groups, work)), 1
    count = max(1, min(count, groups - first))
    edges = [first + (groups - first) * i // count for i in range(count + 1)]
    parts = [(a * width, min(arms, b * width)) for a, b in pairwise(edges)]
    own = parts[:1] if (groups - first) * ticks <= FEW_TICKS else []  # of this thread
    if own == parts:
        work(*own[0])
        return
    futures = [_thread_pool().submit(work, *part) for part in parts[len(own) :]]
    try:
        for part in own:
            work(*part)
        wait(futures)
    except BaseException:
        halt()
        raise
    finally:
        wait(futures)
    for future in futures:
        future.result()


def _measured_count(width: int, groups: int, work: Callable[[int, int], None]) -> int:
    """Threads that the groups are worth, from the time that the first takes, which is done."""
    start = perf_counter()
    work(0, width)
    return 1 + int((groups - 1) * (perf_counter() - start) / WORTH_A_THREAD)


@cache
def _thread_pool() -> ThreadPoolExecutor:
    """Threads besides the calling one, which wait for work."""
    return ThreadPoolExecutor(len(os.sched_getaffinity(0)), "arms")


os.register_at_fork(after_in_child=_thread_pool.cache_clear)  # a fork has none of them
