# SPDX-License-Identifier: Apache-2.0
"""Work in the background: results are delivered on the caller's thread, of the newest job only."""

import threading
import time
import weakref
from collections.abc import Callable, Iterator

import pytest

from arm_dynamics.ros.common.threads.background import Background


@pytest.fixture
def background() -> Iterator[Background]:
    made = Background("test")
    yield made
    made.close()


def wait(background: Background) -> None:
    end = time.monotonic() + 10.0
    while background.busy and time.monotonic() < end:
        background.deliver()
        time.sleep(1e-3)
    assert not background.busy


def test_a_job_runs_elsewhere_and_is_delivered_here(background: Background) -> None:
    got: list[tuple[str, str]] = []
    here = threading.current_thread().name
    background.start(
        lambda: threading.current_thread().name,
        lambda result: got.append((result(), threading.current_thread().name)),
    )
    assert background.busy
    wait(background)
    assert got == [("test_0", here)]


def test_jobs_that_were_given_up_are_not_kept_until_their_turn_comes(
    background: Background,
) -> None:
    class Load:
        """Stands for a long message."""

    def job(load: Load) -> Callable[[], Load]:
        return lambda: load

    go, begun, got = threading.Event(), threading.Event(), []
    background.start(lambda: begun.set() or go.wait(10.0), lambda result: None)
    assert begun.wait(10.0)
    loads = []
    for _ in range(5):
        load = Load()
        loads.append(weakref.ref(load))
        background.start(job(load), lambda result: got.append(result()))
    del load
    assert [load() is None for load in loads] == [True] * 4 + [False]
    go.set()
    wait(background)
    assert got == [loads[-1]()]
