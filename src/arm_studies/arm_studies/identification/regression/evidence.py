# SPDX-License-Identifier: Apache-2.0
"""The prior of bodies that is selected by its evidence."""

from collections.abc import Callable

import numpy as np

from arm_studies.identification.regression.estimation import Prior
from arm_studies.identification.regression.fit import Fit
from arm_studies.identification.regression.regressor import PER_BODY

# Prior deviations of bodies from nominal: of density, of all else.
DENSITIES, SHAPES = ((0.03, 0.06, 0.12, 0.3, 1.0), (1e-4, 1e-3, 0.01, 0.05, 0.2, 1.0))


def most_evident_prior(fit: Fit, prior: Callable[[float, float], Prior]) -> Prior:
    """The prior, by deviations of bodies from nominal, for which the evidence is largest.

    The logarithm of the marginal likelihood of a linear model with a normal prior (MacKay,
    "Bayesian interpolation", Neural Computation 4(3), 1992).
    """
    R, z = fit.problem.data(fit.columns, fit.weights)
    least, chosen = np.inf, fit.problem.prior
    for deviations in ((m, s) for m in DENSITIES for s in SHAPES):
        belief = prior(*deviations)
        numbers = len(belief.x0)
        T, t = belief.combined(R, z)
        scale = np.maximum(abs(np.diag(T)), 1e-300)
        x = np.linalg.lstsq(T, t, rcond=1e-14)[0]
        misfit = np.sum((R @ x - z) ** 2)
        misfit += np.sum((belief.rows @ (x[:numbers] - belief.x0)) ** 2)
        bodies = sum(
            2.0 * float(np.linalg.slogdet(belief.rows[i : i + PER_BODY, i : i + PER_BODY])[1])
            for i in range(0, numbers, PER_BODY)
        )
        evidence = float(misfit + 2.0 * np.log(scale).sum() - bodies)
        if evidence < least:
            least, chosen = evidence, belief
    return chosen
