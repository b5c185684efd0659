# SPDX-License-Identifier: Apache-2.0
"""Norms of the error of a step."""

import casadi as ca

from arm_dynamics.arrays import Array

# Of DOP853, Hairer's blend is near the estimate of order 5 and damped where that of order 3 is far
# larger: the weight of its square, and a number that keeps the root from zero.
ORDER3_WEIGHT, SMALLEST = 0.01, 1e-300


def error_norms(scale: Array, estimates: int, n: int) -> ca.Function:
    """Function (x before, x after, error estimates) -> scaled error, largest error of q."""
    nx = len(scale)
    before, after = ca.SX.sym("x", nx), ca.SX.sym("y", nx)
    errors = [ca.SX.sym(f"e{i}", nx) for i in range(estimates)]
    size = ca.SX(ca.DM(scale)) + ca.fmax(ca.fabs(before), ca.fabs(after))
    norms = [_largest(ca.fabs(error) / size) for error in errors]
    worst = norms[0]
    if estimates == 2:
        order3 = ORDER3_WEIGHT * norms[1] * norms[1]
        worst = worst * worst / ca.sqrt(worst * worst + order3 + SMALLEST)
    results = [worst, _largest(ca.fabs(errors[0][:n]))]
    return ca.Function("measure", [before, after, *errors], results)


def _largest(values: ca.SX) -> ca.SX:
    # NaN must propagate, or a diverged step would look perfect: fmax drops NaN, the sum does not.
    return ca.mmax(values) + 0 * ca.sum1(values)
