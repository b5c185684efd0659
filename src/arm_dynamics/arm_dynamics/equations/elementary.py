# SPDX-License-Identifier: Apache-2.0
"""Elementary functions of NumPy arrays and CasADi expressions alike."""

from typing import Any

import casadi as ca
import numpy as np

# A number, a NumPy array or a CasADi expression
type Quantity = Any


def _of(*values: Quantity) -> Any:
    """The library whose functions apply to these values."""
    return ca if any(isinstance(value, ca.SX | ca.MX) for value in values) else np


def sin(x: Quantity) -> Quantity:
    """Sine of an angle in [rad]."""
    return _of(x).sin(x)


def cos(x: Quantity) -> Quantity:
    """Cosine of an angle in [rad]."""
    return _of(x).cos(x)


def smaller(a: Quantity, b: Quantity) -> Quantity:
    """Elementwise minimum."""
    return _of(a, b).fmin(a, b)


def larger(a: Quantity, b: Quantity) -> Quantity:
    """Elementwise maximum."""
    return _of(a, b).fmax(a, b)


def within(x: Quantity, low: Quantity, high: Quantity) -> Quantity:
    """``x`` clipped to [low, high]."""
    return larger(low, smaller(high, x))


def clipped(x: Quantity, limit: Quantity) -> Quantity:
    """``x`` within ± limit; NaN stays NaN, which ``within`` takes for a limit."""
    return choose(x > limit, limit, choose(x < -limit, -limit, x))


def choose(condition: Quantity, then: Quantity, otherwise: Quantity) -> Quantity:
    """``then`` where the condition holds, else ``otherwise``."""
    library = _of(condition, then, otherwise)
    return (library.if_else if library is ca else np.where)(condition, then, otherwise)


def floor(x: Quantity) -> Quantity:
    """Largest whole number not greater than ``x``."""
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
