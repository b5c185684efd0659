# SPDX-License-Identifier: Apache-2.0
"""Tables of friction over load, with the number and position of points that predict best."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from arm_studies.identification.regression import friction
from arm_studies.identification.regression.bandwidth import mean_residual
from arm_studies.identification.regression.fit import Fit, fitted
from arm_studies.identification.regression.friction import COULOMB, VISCOUS, JointFit
from arm_studies.identification.regression.rows.samples import FOLDS

# Numbers of points that are tried; their loads, and all values but one, are fitted.
COUNTS = (2, 3, 4)
ENDS = np.geomspace(0.1, 1.1, 10)  # First guesses of the last point, relative to the largest load.
# Relative prediction error of each of ``TEST_FOLDS`` that a table must reach to be accepted.
IMPROVEMENT = 0.95
ROUGH_TOLERANCE = 1e-3  # ``tolerance`` of fits that are only compared, to a few percent.
# Folds that tables predict from the others; one alone may favor a table by chance.
TEST_FOLDS = (FOLDS - 1, FOLDS // 2)


def with_tables(fit: Fit) -> Fit:
    """The fit with other tables of friction over load, if they predict better.

    They are fitted without one fold, and compared by their prediction of it, for two folds. Tables
    with points beyond the loads that occur, other than the last, are not used: nothing determines
    them.

    Args:
        fit: With friction that grows in proportion to the load.
    """
    if all(law.shape.load is None for law in fit.friction):
        return fit
    problem, use = fit.problem, fit.problem.use

    def trial(laws: Sequence[JointFit], fold: int) -> tuple[float, tuple[JointFit, ...]]:
        test = (fit.rows.samples.fold == fold)[:, None]
        refit = fitted(replace(problem, use=use & ~test), laws, tolerance=ROUGH_TOLERANCE)
        return mean_residual(refit.residual, use & test), refit.friction

    least = [trial(fit.friction, fold)[0] for fold in TEST_FOLDS]
    chosen: Sequence[JointFit] = ()
    for count in COUNTS:
        laws = [
            law if law.shape.load is None else _first_table(fit, j, count)
            for j, law in enumerate(fit.friction)
        ]
        trials = []
        for fold, before in zip(TEST_FOLDS, least, strict=True):
            trials.append(trial(laws, fold))
            if trials[-1][0] >= IMPROVEMENT * before:
                break
        else:
            least, chosen = [now for now, _ in trials], trials[0][1]
    if not chosen:
        return fit
    refit = fitted(problem, chosen)
    determined = all(
        law.shape.load is not None
        and law.shape.points[-2][0] < abs(fit.drives[use[:, j], j]).max()
        for j, law in enumerate(refit.friction)
        if law.shape.points
    )
    return refit if determined else fit


def _first_table(fit: Fit, j: int, count: int) -> JointFit:
    """A table at even loads whose last point explains a joint's friction best."""
    law, use, load = fit.friction[j], fit.problem.use[:, j], fit.drives[:, j]
    part = np.linspace(0.0, 1.0, count)
    largest = float(abs(load[use]).max())
    tables = [tuple(zip((e * largest * part).tolist(), part.tolist(), strict=True)) for e in ENDS]
    shapes = [replace(law.shape, load=1.0, points=points) for points in tables]
    laws = [JointFit((VISCOUS, COULOMB)), *(JointFit((COULOMB,), shape) for shape in shapes)]
    table = np.hstack([fit.rows.friction(law, j, load) for law in laws])[use]
    y = (fit.residual + fit.columns.predicted_friction(fit.x))[use, j]
    least, best = np.inf, law
    for k, shape in enumerate(shapes):
        A = table[:, [0, 1, 2 + k]]
        x = np.linalg.lstsq(A, y, rcond=1e-10)[0]
        squares = float(np.sum((y - A @ x) ** 2))
        if x[2] > 0.0 and squares < least:
            share = float(np.clip(x[2] / max(x[1] + x[2], 1e-300), 0.02, friction.LARGEST_SHARE))
            least, best = squares, replace(law, shape=replace(shape, load=share))
    return best
