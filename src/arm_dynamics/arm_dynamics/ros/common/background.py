# SPDX-License-Identifier: Apache-2.0
"""Work on a thread of its own, for a loop that must not wait for it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, NamedTuple

_TURN = 5e-5  # [s]


def take_short_turns() -> None:
    """Keep background work from holding up the loop longer than a twentieth of a millisecond.

    Python's threads otherwise take turns of 5 ms. For a process that runs one node.
    """
    sys.setswitchinterval(_TURN)


class _Waiting(NamedTuple):
    """A job that has not been delivered yet; ``job`` is empty once it runs."""

    future: Future[Any]
    then: Callable[[Callable[[], Any]], None]
    job: list[Callable[[], Any]]


class Background:
    """Does one job at a time; a new job takes the place of one that is not ready.

    Example:
        >>> background.start(plan, lambda result: follow(result()))
        >>> background.deliver()  # in every tick: calls what was given, once the plan is ready
    """

    def __init__(self, name: str) -> None:
        """Name the thread and start it.

        It does not wait for the first job, because then it would begin with the priority of who
        gives that: a loop that keeps deadlines would have to wait for its equal.
        """
        self._pool = ThreadPoolExecutor(1, thread_name_prefix=name)
        self._pool.submit(lambda: None)
        self._waiting: _Waiting | None = None

    @property
    def busy(self) -> bool:
        """Whether something has not been delivered yet."""
        return self._waiting is not None

    @property
    def ready(self) -> bool:
        """Whether something is done, and waits to be delivered."""
        return self._waiting is not None and self._waiting.future.done()

    def start[T](self, job: Callable[[], T], then: Callable[[Callable[[], T]], None]) -> bool:
        """Begin a job.

        Args:
            job: What to do there.
            then: Called by ``deliver`` with a function that returns the job's result, or raises
                what it raised.

        Returns:
            Whether another job, not delivered yet, was given up for it.
        """
        given_up = self.give_up()
        once = [job]
        self._waiting = _Waiting(self._pool.submit(lambda: once.pop()()), then, once)
        return given_up

    def give_up(self) -> bool:
        """Forget a job that was not delivered yet, and say whether there was one."""
        if self._waiting is None:
            return False
        if self._waiting.future.cancel():
            self._waiting.job.clear()  # the pool keeps what it has for it until its turn comes
        self._waiting = None
        return True

    def deliver(self) -> None:
        """Hand over what is ready, if anything is."""
        if self.ready:
            done, self._waiting = self._waiting, None
            done.then(done.future.result)

    def close(self) -> None:
        """Give up what waits and end the thread."""
        self.give_up()
        self._pool.shutdown(cancel_futures=True)
