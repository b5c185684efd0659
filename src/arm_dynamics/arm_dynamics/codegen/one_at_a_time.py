# SPDX-License-Identifier: Apache-2.0
"""Expressions are built by one thread at a time.

CasADi (3.8) releases the interpreter lock in every call, but counts references to constants and
sparsity patterns, which all expressions share, without a lock: two threads that build expressions
at the same time end with a segmentation fault.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property, wraps
from threading import Lock, get_ident
from typing import Any

_TURN = Lock()
_builder: int | None = None  # the thread whose turn it is


def is_building() -> bool:
    """Whether it is this thread's turn; tests require it wherever the suite makes a symbol."""
    return _builder == get_ident()


def one_at_a_time[**P, T](build: Callable[P, T]) -> Callable[P, T]:
    """Let a function that builds expressions, and code from them, wait for other threads that do.

    A thread may call such functions within each other. They must not wait for other threads that
    build expressions, and looking up what is built already is outside them: a tick may do it.
    """

    @wraps(build)
    def waiting(*args: P.args, **kwargs: P.kwargs) -> T:
        if is_building():
            return build(*args, **kwargs)
        _take_turn()
        try:
            return build(*args, **kwargs)
        finally:
            _end_turn()

    return waiting


@contextmanager
def others_may_build() -> Iterator[None]:
    """Within this block, which touches no expression, this thread gives its turn to others."""
    if not is_building():
        yield
        return
    _end_turn()
    try:
        yield
    finally:
        _take_turn()


def _take_turn() -> None:
    global _builder
    _TURN.acquire()
    _builder = get_ident()


def _end_turn() -> None:
    """It may have ended already: an interruption comes while a thread waits to take it again."""
    global _builder
    if is_building():
        _builder = None
        _TURN.release()


class built_once[T](cached_property[T]):  # noqa: N801 - used as cached_property is
    """A cached property that builds expressions: the first use waits for its turn."""

    def __init__(self, build: Callable[[Any], T]) -> None:
        super().__init__(one_at_a_time(build))
