# SPDX-License-Identifier: Apache-2.0
"""Samples of many cases: a run has some of them, one with ``--nightly`` all."""

from collections.abc import Iterable
from itertools import product
from typing import Any

import numpy as np
import pytest


def sampled(cases: Iterable[Any], count: int) -> list[Any]:
    """Parameters of a test; so many of them, spread over all, are part of every run.

    A tuple is the values of several parameters, here and in ``always``.
    """
    values = list(cases)
    chosen = set(np.linspace(0, len(values) - 1, count).round().astype(int).tolist())
    return [value if k in chosen else _nightly(value) for k, value in enumerate(values)]


def always(cases: Iterable[Any], *chosen: Any) -> list[Any]:
    """Parameters of a test; the chosen ones are part of every run."""
    return [value if value in chosen else _nightly(value) for value in cases]


def covering(*parameters: Iterable[Any]) -> list[Any]:
    """All combinations of values of several parameters; every value of each is part of every run,
    in no more combinations than the longest list has values.
    """
    lists = [list(values) for values in parameters]
    count = max(map(len, lists))
    chosen = {tuple(k % len(values) for values in lists) for k in range(count)}
    places = product(*(range(len(values)) for values in lists))
    return [_of(lists, at) if at in chosen else _nightly(_of(lists, at)) for at in places]


def _of(lists: list[list[Any]], at: tuple[int, ...]) -> tuple[Any, ...]:
    return tuple(values[k] for values, k in zip(lists, at, strict=True))


def _nightly(value: Any) -> Any:
    """A value, several values or parameters with a name, for runs of all cases."""
    if isinstance(value, type(pytest.param())):
        return pytest.param(*value.values, id=value.id, marks=[*value.marks, pytest.mark.nightly])
    values = value if isinstance(value, tuple) else (value,)
    return pytest.param(*values, marks=pytest.mark.nightly)
