# SPDX-License-Identifier: Apache-2.0
"""Stability of the methods: steps in which no mode grows that should decay or swing.

In a step h, a Runge-Kutta method multiplies a mode exp(λ t) by R(h λ), with the polynomial
R(z) = 1 + z bᵀ (1 - z A)⁻¹ 1 of its tableau (Hairer, Wanner, Solving Ordinary Differential
Equations II, 1996, section IV.2). The other methods couple modes: theirs is the matrix of a step.
"""

from functools import cache
from math import factorial

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_sim.integrators.linear_response import LinearResponse
from arm_sim.integrators.methods import Method
from arm_sim.integrators.steps import build_step
from arm_sim.integrators.tableaux import Tableau

# Growth per step that is an error of low order and no instability, such as that of Euler's method
# in a slow swing.
GROWTH_TOLERANCE = 1e-3
# A mode with a growth below this part of its rate is a decay or swing, but for rounding.
ROUNDING = 1e-6
HALVINGS = 40  # bisections for the longest stable step


def polynomial(tableau: Tableau) -> Array:
    """Coefficients of R(z), from the constant on, shape (stages + 1,)."""
    stages = len(tableau.b)
    A = np.array([[*row, *[0.0] * (stages - len(row))] for row in tableau.a])
    powers = [np.ones(stages)]
    for _ in range(stages - 1):
        powers.append(A @ powers[-1])
    return np.array([1.0, *(np.dot(tableau.b, power) for power in powers)])


def is_unstable(method: Method, response: LinearResponse, h: float) -> bool:
    """Whether a mode that decays or swings grows with every step of length ``h`` in [s]."""
    return bool(_growth(method, response, h).max(initial=0.0) > GROWTH_TOLERANCE)


def fastest_growing_mode(method: Method, response: LinearResponse, h: float) -> int:
    """The mode that grows fastest in steps of length ``h`` in [s].

    Of methods that couple modes, it is the fastest one: what grows is a mixture.
    """
    if _by_mode(method) is None:
        return response.fastest_mode
    return int(_growth(method, response, h).argmax())


def local_error(method: Method, rate: float, h: float) -> float:
    """By what a step of length ``h`` in [s] misses the decay and the swing of unit size.

    Args:
        method: The method.
        rate: Rate of the decay and the swing in [1/s].
        h: Length of the step in [s].
    """
    z, order = h * rate * np.array([-1.0, 1.0j]), method.order + 1
    if tableau := _by_mode(method):
        error = np.polynomial.polynomial.polyval(z, polynomial(tableau)) - np.exp(z)
    else:
        error = z**order / factorial(order)
    return float(abs(error).max())


def longest_step(method: Method, response: LinearResponse, h: float) -> float:
    """Longest step in [s] in which no such mode grows, where one grows in steps of ``h``."""
    low, high = 0.0, h
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if is_unstable(method, response, middle) else (middle, high)
    return low


def _growth(method: Method, response: LinearResponse, h: float) -> Array:
    """Growth of each mode in a step, 0 of those that grow by themselves; implicit ones: none."""
    rates = response.modes[0]
    if method.name == "implicit":
        return np.zeros(len(rates))
    grows_itself = rates.real > ROUNDING * abs(rates)
    if tableau := _by_mode(method):
        factors = np.polynomial.polynomial.polyval(h * rates, polynomial(tableau))
        return np.where(grows_itself, 0.0, abs(factors) - 1.0)
    with np.errstate(over="ignore"):  # a mode that grows beyond all numbers is its own
        natural_growth = np.exp(h * np.where(grows_itself, rates.real, 0.0))
    J = response.J
    step = _linear_step(method, len(J), response.n)
    matrix = np.array(step(np.eye(len(J)), 0.0, J.T.ravel(), h))
    return np.asarray(abs(np.linalg.eigvals(matrix)) - natural_growth.max(initial=1.0))


@cache
@one_at_a_time
def _linear_step(method: Method, nx: int, n: int) -> ca.Function:
    """A step of x' = J x: (x, u, J column by column, h) -> x at its end."""
    x, u, J = ca.SX.sym("x", nx), ca.SX.sym("u"), ca.SX.sym("J", nx * nx)
    return build_step(method, ca.Function("rhs", [x, u, J], [ca.reshape(J, nx, nx) @ x]), n)


def _by_mode(method: Method) -> Tableau | None:
    """The tableau of a method that multiplies each mode by R(h λ); None of others."""
    return None if method.tableau is None or method.tableau.positions else method.tableau
