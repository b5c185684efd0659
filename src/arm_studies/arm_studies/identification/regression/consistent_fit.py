# SPDX-License-Identifier: Apache-2.0
"""The fit with physically consistent bodies and friction that opposes the motion."""

from dataclasses import replace

import numpy as np

from arm_dynamics.arrays import Array
from arm_studies.identification.regression import bodies, estimation
from arm_studies.identification.regression.fit import SIGNED, Fit, with_coefficients

LEAST_EIGENVALUE = 1e-12  # Of a pseudo-inertia that is positive definite.
# Smallest coefficient at the start of the search, relative to the largest, and absolute.
LEAST_SHARE, LEAST_COEFFICIENT = 1e-3, 1e-9
# Factor by which the start is moved inwards until it is feasible, and margin that it then keeps.
INWARDS, MARGIN = 0.7, 0.9


def consistent_fit(fit: Fit) -> Fit:
    """The fit if it is physically consistent, else the best consistent one of the same laws."""
    problem, x = fit.problem, fit.x
    R, z = problem.data(fit.columns, fit.weights)
    nominal, n = problem.prior.x0, fit.rows.samples.n
    armatures = range(len(nominal), len(nominal) + n)
    moving = [i for i in armatures if np.linalg.norm(R[:, i]) > 0.0]
    movable = estimation.places_of_bodies(nominal)
    has_bodies = all(bodies.consistent(x[body], LEAST_EIGENVALUE) for body in movable)
    if has_bodies and (x[moving] >= 0.0).all():
        return fit
    kinds = [kind for law in fit.friction for kind in law.kinds]
    of_friction = [i for i, kind in enumerate(kinds, armatures.stop) if kind not in SIGNED]
    start, positive = x.copy(), [*moving, *of_friction]
    for body in movable:
        start[body] = bodies.nearest(nominal[body])
    least = LEAST_SHARE * abs(x[positive]).max() + LEAST_COEFFICIENT
    start[positive] = np.maximum(x[positive], least)

    def is_feasible(x: Array) -> bool:
        return bool((x[positive] > 0.0).all()) and all(bodies.consistent(x[b]) for b in movable)

    share = 1.0
    while not is_feasible(start + share * (x - start)):
        share *= INWARDS
    start += MARGIN * share * (x - start)
    x = estimation.consistent_solution(*problem.prior.combined(R, z), start, nominal, positive)
    laws = with_coefficients(fit.friction, x, fit.columns.size)
    return replace(fit, x=x, friction=laws, is_corrected=True)
