# SPDX-License-Identifier: Apache-2.0
"""A background thread for work that a real-time loop must not wait for."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, NamedTuple


class _Waiting(NamedTuple):
    """A job that has not been delivered yet; ``job`` is empty once it runs."""

    future: Future[Any]
    then: Callable[[Callable[[], Any]], None]
    job: list[Callable[[], Any]]


class Background:
    """Runs one job at a time; a new job replaces one that is not ready.

    Example:
        >>> background.start(plan, lambda result: follow(result()))
        >>> background.deliver()  # in every tick: calls the function above once the plan is ready
    """

    def __init__(self, name: str, on_finish: Callable[[], None] = lambda: None) -> None:
        """Name the thread and start it.

        ``on_finish`` is called on that thread when a job is finished.

        The thread starts now and not with the first job, because it would inherit the priority of
        the thread that submits the job, and compete with a real-time loop.
        """
        self._pool, self._on_finish = ThreadPoolExecutor(1, thread_name_prefix=name), on_finish
        self._pool.submit(lambda: None)
        self._waiting: _Waiting | None = None

    @property
    def busy(self) -> bool:
        """Whether a job has not been delivered yet."""
        return self._waiting is not None

    @property
    def ready(self) -> bool:
        """Whether a job is done and waits to be delivered."""
        return self._waiting is not None and self._waiting.future.done()

    def start[T](self, job: Callable[[], T], then: Callable[[Callable[[], T]], None]) -> bool:
        """Start a job.

        Args:
            job: Function to run.
            then: Called by ``deliver`` with a function that returns the job's result, or raises
                its exception.

        Returns:
            Whether it replaced a job that was not delivered yet.
        """
        replaces = self.give_up()
        pending = [job]
        future = self._pool.submit(lambda: pending.pop()())
        self._waiting = _Waiting(future, then, pending)
        future.add_done_callback(lambda _: self._on_finish())
        return replaces

    def give_up(self) -> bool:
        """Discard a job that was not delivered yet; return whether there was one."""
        if self._waiting is None:
            return False
        if self._waiting.future.cancel():
            self._waiting.job.clear()  # the pool keeps a reference to it until its turn
        self._waiting = None
        return True

    def deliver(self) -> None:
        """Deliver a finished job, if there is one."""
        if self.ready:
            finished, self._waiting = self._waiting, None
            finished.then(finished.future.result)

    def close(self) -> None:
        """Discard waiting jobs and end the thread."""
        self.give_up()
        self._pool.shutdown(cancel_futures=True)
