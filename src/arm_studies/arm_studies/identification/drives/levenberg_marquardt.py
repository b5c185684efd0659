# SPDX-License-Identifier: Apache-2.0
"""Nonlinear least squares by the Levenberg-Marquardt method.

Moré, "The Levenberg-Marquardt algorithm: implementation and theory", 1978.
"""

from collections.abc import Callable

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput

_ITERATIONS, _ATTEMPTS = 60, 12  # largest number of them, and of steps tried in each
# Reduction of the cost, relative, and change of log p that end the search together.
_COST_REDUCTION, _CHANGE = 1e-12, 1e-9
_LARGEST_STEP = 1.0  # of log p: a factor of e
# Damping relative to the squares of the columns' lengths: the first, and its bounds.
_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-3, 1e-14, 1e12
_INCREASE, _DECREASE = 6.0, 8.0  # factor after a refused step, divisor after an accepted one


def least_squares(
    evaluate: Callable[[Array, list[Array]], tuple[Array, Array]], log_p: Array, x0: list[Array]
) -> tuple[Array, list[Array]]:
    """Minimize the sum of squared residuals from a guess.

    Args:
        evaluate: Residuals of parameters and initial states, shape (k,), and their derivatives by
            log p and by each state, shape (k, unknowns).
        log_p: Logarithms of the parameters.
        x0: Initial state of each trial.

    Returns:
        The logarithms and the initial states at the minimum.

    Raises:
        InvalidInput: If the residuals of the guess are not finite.
    """
    damping, count = _DAMPING, len(log_p)
    r, J = evaluate(log_p, x0)
    if not np.all(np.isfinite(r)):
        raise InvalidInput(
            "the trajectory of the first guess is not finite; another guess is expected"
        )
    ends = np.cumsum([count, *map(len, x0)])[:-1]
    for _ in range(_ITERATIONS):
        before = float(r @ r)
        scale = np.linalg.norm(J, axis=0)
        scale = np.where(scale > 0.0, scale, 1.0)
        A, b = (J / scale).T @ (J / scale), (J / scale).T @ r
        for _ in range(_ATTEMPTS):
            step = -np.linalg.solve(A + damping * np.eye(len(A)), b) / scale
            step[:count] = np.clip(step[:count], -_LARGEST_STEP, _LARGEST_STEP)
            dp, *dx = np.split(step, ends)
            new_p, new_x = log_p + dp, [x + change for x, change in zip(x0, dx, strict=True)]
            new_r, new_J = evaluate(new_p, new_x)
            with np.errstate(over="ignore"):  # a step that went too far
                after = float(new_r @ new_r)
            if np.isfinite(after) and after <= before:
                break
            damping = min(damping * _INCREASE, _MOST_DAMPING)
        else:
            break
        log_p, x0, r, J = new_p, new_x, new_r, new_J
        damping = max(damping / _DECREASE, _LEAST_DAMPING)
        if before - after <= _COST_REDUCTION * before and np.abs(dp).max() < _CHANGE:
            break
    return log_p, x0
