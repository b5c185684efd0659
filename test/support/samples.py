# SPDX-License-Identifier: Apache-2.0
"""Samples of many cases: a run has some of them, one with ``--nightly`` all."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest


def sampled(cases: Iterable[Any], count: int) -> list[Any]:
    """Parameters of a test; so many of them, spread over all, are part of every run."""
    values = list(cases)
    chosen = set(np.linspace(0, len(values) - 1, count).round().astype(int).tolist())
    return [
        value if k in chosen else pytest.param(*_several(value), marks=pytest.mark.nightly)
        for k, value in enumerate(values)
    ]


def _several(value: Any) -> tuple[Any, ...]:
    """Values of several parameters, or of one."""
    return value if isinstance(value, tuple) else (value,)
