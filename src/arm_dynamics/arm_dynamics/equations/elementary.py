# SPDX-License-Identifier: Apache-2.0
"""Elementary functions that take numpy arrays and CasADi expressions alike."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

type Quantity = Any
"""A number, a numpy array or a CasADi expression."""


def _of(*values: Quantity) -> Any:
    """The library that knows functions of these values."""
    return ca if any(isinstance(value, ca.SX | ca.MX) for value in values) else np


def sin(x: Quantity) -> Quantity:
    """Sine of an angle in [rad]."""
    return _of(x).sin(x)


def cos(x: Quantity) -> Quantity:
    """Cosine of an angle in [rad]."""
    return _of(x).cos(x)


def smaller(a: Quantity, b: Quantity) -> Quantity:
    """The smaller of two."""
    return _of(a, b).fmin(a, b)


def larger(a: Quantity, b: Quantity) -> Quantity:
    """The larger of two."""
    return _of(a, b).fmax(a, b)


def within(x: Quantity, low: Quantity, high: Quantity) -> Quantity:
    """``x`` cut to [low, high]."""
    return larger(low, smaller(high, x))


def choose(condition: Quantity, then: Quantity, otherwise: Quantity) -> Quantity:
    """``then`` where the condition holds, else ``otherwise``."""
    library = _of(condition, then, otherwise)
    return (library.if_else if library is ca else np.where)(condition, then, otherwise)


def floor(x: Quantity) -> Quantity:
    """The largest whole number that is not larger."""
    return _of(x).floor(x)


def sign(x: Quantity) -> Quantity:
    """-1, 0 or 1, the sign of a number."""
    return _of(x).sign(x)


def hyperbolic_tangent(x: Quantity) -> Quantity:
    """Hyperbolic tangent."""
    return _of(x).tanh(x)


def diagonal(matrix: Quantity) -> Quantity:
    """Diagonal of a square matrix."""
    return _of(matrix).diag(matrix)


def size(x: Quantity) -> Quantity:
    """Absolute value."""
    return _of(x).fabs(x)


def exponential(x: Quantity) -> Quantity:
    """Exponential function."""
    return _of(x).exp(x)


def root(x: Quantity) -> Quantity:
    """Square root."""
    return _of(x).sqrt(x)
