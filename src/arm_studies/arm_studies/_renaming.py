# SPDX-License-Identifier: Apache-2.0
"""Former names of arguments and attributes: they work for one more release, with a warning."""

import warnings
from collections.abc import Callable
from functools import wraps
from typing import Any


def renamed_argument[**P, R](old: str, new: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorator: the keyword ``old`` is passed on as ``new``."""

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        @wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            if old in kwargs:
                _warn(f"{function.__name__}({old}=…)", f"{new}=")
                kwargs[new] = kwargs.pop(old)
            return function(*args, **kwargs)

        return call

    return decorate


def renamed_attribute(old: str, new: str) -> Any:
    """A property that returns the attribute ``new``."""

    def get(self: Any) -> Any:
        _warn(f"{type(self).__name__}.{old}", new)
        return getattr(self, new)

    return property(get)


def _warn(old: str, new: str) -> None:
    warnings.warn(f"{old} is deprecated; it is now {new}", DeprecationWarning, stacklevel=3)
