# SPDX-License-Identifier: Apache-2.0
"""Expressions are built by one thread at a time.

CasADi (3.8) releases the interpreter lock in every call, but counts references to constants and
sparsity patterns, which all expressions share, without a lock: two threads that build expressions
at the same time end with a segmentation fault.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from threading import RLock

_TURN = RLock()


def one_at_a_time[**P, T](build: Callable[P, T]) -> Callable[P, T]:
    """Let a function that builds expressions, and code from them, wait for other threads that do.

    A thread may call such functions within each other. They must not wait for other threads that
    build expressions, and looking up what is built already is outside them: a tick may do it.
    """

    @wraps(build)
    def waiting(*args: P.args, **kwargs: P.kwargs) -> T:
        with _TURN:
            return build(*args, **kwargs)

    return waiting
