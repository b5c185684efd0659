# SPDX-License-Identifier: Apache-2.0
"""Stability of the methods: steps in which no mode grows that should decay or swing.

In a step h, a Runge-Kutta method multiplies a mode exp(λ t) by R(h λ), with the polynomial
R(z) = 1 + z bᵀ (1 - z A)⁻¹ 1 of its tableau (Hairer, Wanner, Solving Ordinary Differential
Equations II, 1996, section IV.2). The other methods couple modes: theirs is the matrix of a step.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import factorial

import numpy as np

from arm_dynamics.arrays import Array
from arm_sim.integrators.methods import Method
from arm_sim.integrators.response import Response
from arm_sim.integrators.tableaux import Tableau

# Growth per step that is an error of low order and no instability, such as that of Euler's method
# in a slow swing.
GROWTH = 1e-3
# A mode with a growth below this part of its rate is a decay or swing, but for rounding.
ROUNDING = 1e-6
HALVINGS = 40


def polynomial(tableau: Tableau) -> Array:
    """Coefficients of R(z), from the constant on, shape (stages + 1,)."""
    stages = len(tableau.b)
    A = np.array([[*row, *[0.0] * (stages - len(row))] for row in tableau.a])
    powers = [np.ones(stages)]
    for _ in range(stages - 1):
        powers.append(A @ powers[-1])
    return np.array([1.0, *(np.dot(tableau.b, power) for power in powers)])


def grows(method: Method, response: Response, h: float) -> bool:
    """Whether a mode that decays or swings grows with every step of length ``h`` in [s]."""
    return bool(_growth(method, response, h).max(initial=0.0) > GROWTH)


def worst(method: Method, response: Response, h: float) -> int:
    """The mode that grows fastest in steps of length ``h`` in [s]."""
    if _by_mode(method) is None:
        return int(abs(response.modes[0]).argmax())
    return int(_growth(method, response, h).argmax())


def misses(method: Method, rate: float, h: float) -> float:
    """By what a step of length ``h`` in [s] misses the decay and the swing of unit size.

    Args:
        method: The method.
        rate: Of the decay and the swing in [1/s].
        h: Length of the step in [s].
    """
    z, order = h * rate * np.array([-1.0, 1.0j]), method.order + 1
    if tableau := _by_mode(method):
        off = np.polynomial.polynomial.polyval(z, polynomial(tableau)) - np.exp(z)
    else:
        off = z**order / factorial(order)
    return float(abs(off).max())


def longest_step(method: Method, response: Response, h: float) -> float:
    """Longest step in [s] in which no such mode grows, where one grows in steps of ``h``."""
    low, high = 0.0, h
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if grows(method, response, middle) else (middle, high)
    return low


def _growth(method: Method, response: Response, h: float) -> Array:
    """Growth of each mode in a step, 0 of those that grow by themselves; implicit ones: none."""
    rates = response.modes[0]
    if method.name == "implicit":
        return np.zeros(len(rates))
    if tableau := _by_mode(method):
        z = h * rates
        factors = np.polynomial.polynomial.polyval(z, polynomial(tableau))
        return np.where(z.real > ROUNDING * abs(z), 0.0, abs(factors) - 1.0)
    n = next(iter(response.forces.values())).shape[0]
    step = _nystrom if method.tableau else _semi_implicit
    with np.errstate(over="ignore"):  # a mode that grows beyond all numbers is its own
        own = np.exp(h * np.where(rates.real > ROUNDING * abs(rates), rates.real, 0.0))
    matrix = step(method, response.J, h, n)
    return np.asarray(abs(np.linalg.eigvals(matrix)) - own.max(initial=1.0))


def _by_mode(method: Method) -> Tableau | None:
    """The tableau of a method that multiplies each mode by R(h λ); None of others."""
    return None if method.tableau is None or method.tableau.positions else method.tableau


def _semi_implicit(_: Method, J: Array, h: float, n: int) -> Array:
    """Matrix of a step of x' = J x, shape (nx, nx)."""
    step = np.eye(len(J)) + h * J
    step[:n] = np.eye(n, len(J)) + h * step[n : 2 * n]
    return step


def _nystrom(method: Method, J: Array, h: float, n: int) -> Array:
    """The same; see ``nystrom``."""
    assert method.tableau is not None
    a, positions = (*method.tableau.a, method.tableau.b), method.tableau.positions
    x = y = np.eye(len(J))
    slopes = list[Array]()
    for row, pushes in zip(a, positions, strict=True):
        y = x + h * _sum(row, slopes, x)
        pushed = _sum(pushes, slopes, x)[n : 2 * n]
        y[:n] = x[:n] + h * (sum(row) * x[n : 2 * n] + h * pushed)
        slopes.append(J @ y)
    return y


def _sum(weights: Sequence[float], slopes: list[Array], like: Array) -> Array:
    return sum((w * k for w, k in zip(weights, slopes, strict=False)), 0.0 * like)
