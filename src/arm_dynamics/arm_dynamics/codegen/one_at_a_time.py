# SPDX-License-Identifier: Apache-2.0
"""Expressions are built by one thread at a time.

CasADi (3.8) releases the interpreter lock in every call, but counts references to constants and
sparsity patterns, which all expressions share, without a lock: two threads that build expressions
at the same time end with a segmentation fault.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, wraps
from threading import RLock, get_ident
from typing import Any

_TURN = RLock()
_builders: list[int] = []  # the thread whose turn it is, once for each function it is within


def is_building() -> bool:
    """Whether it is this thread's turn; tests require it wherever the suite makes a symbol."""
    return get_ident() in _builders


def one_at_a_time[**P, T](build: Callable[P, T]) -> Callable[P, T]:
    """Let a function that builds expressions, and code from them, wait for other threads that do.

    A thread may call such functions within each other. They must not wait for other threads that
    build expressions, and looking up what is built already is outside them: a tick may do it.
    """

    @wraps(build)
    def waiting(*args: P.args, **kwargs: P.kwargs) -> T:
        with _TURN:
            _builders.append(get_ident())
            try:
                return build(*args, **kwargs)
            finally:
                _builders.pop()

    return waiting


class built_once[T](cached_property[T]):  # noqa: N801 - used as cached_property is
    """A cached property that builds expressions: the first use waits for its turn."""

    def __init__(self, build: Callable[[Any], T]) -> None:
        super().__init__(one_at_a_time(build))
