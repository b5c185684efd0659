# SPDX-License-Identifier: Apache-2.0
"""Efforts as a robot reports them: how old they are, and their torque per unit, if unknown."""

from collections.abc import Callable, Sequence

import numpy as np

from arm_dynamics.arrays import Array
from arm_studies.identification.regression.estimation import Mask, Prior, Problem
from arm_studies.identification.regression.fit import Fit, fitted
from arm_studies.identification.regression.friction import JointFit
from arm_studies.identification.regression.rows.rows import Rows
from arm_studies.identification.regression.uncertainty import NORMAL_95, added_coefficients

# Largest number of corrections of the age; standard errors below which one is left out; largest
# age in periods of the band.
CORRECTIONS, AGE_TOLERANCE, LARGEST_AGE = 4, 0.2, 0.15
# Fraction of a joint's frictionless efforts that bodies must explain to identify its scale.
EXPLAINED = 0.7
# Fraction of the deviation of a joint's efforts that bodies must cause to identify its scale: if
# friction dominates, an error of its law or of the nominal bodies would be taken for the scale.
BODIES = 0.5
# Prior deviations of bodies while scales are identified: of density, of all else. If bodies were
# fixed, an error of the last bodies would be taken for a scale of their joints.
SCALE_PRIOR = 0.03, 0.05
# Assumed errors of the nominal bodies, of density and of all else, which limit the accuracy of
# scales, and by which columns of efforts are matched with joints.
NOMINAL_ERRORS = 0.12, 0.2


def with_age[T](
    fit_at: Callable[[float], tuple[T, float, float]], band: float
) -> tuple[T, list[str]]:
    """What fits efforts of the most likely age, and a note if that is significant.

    Args:
        fit_at: Compares efforts of an age in [s] with the motion: returns a fit, the correction of
            the age, and its standard deviation.
        band: Of the low-pass filter in [Hz].
    """
    age, farthest = 0.0, LARGEST_AGE / band
    fit, step, deviation = fit_at(age)
    for _ in range(CORRECTIONS):
        if not abs(step) > AGE_TOLERANCE * deviation:
            break
        age = float(np.clip(age + step, -farthest, farthest))
        fit, step, deviation = fit_at(age)
    if not abs(age) > NORMAL_95 * deviation:
        return fit, []
    return fit, [
        f"efforts are {1e3 * abs(age):.2g} ± {1e3 * NORMAL_95 * deviation:.1g} ms "
        f"{'older' if age > 0.0 else 'newer'} than the positions beside them; they are compared "
        "with the motion at that time"
    ]


def scales_of(
    rows: Rows, laws: Sequence[JointFit], prior: Callable[[float, float], Prior]
) -> tuple[Array, list[str]]:
    """Identify the torque per unit of effort, alternating with friction, until it converges.

    Bodies stay near nominal meanwhile: otherwise scales and bodies would shrink together, which
    reduces the residual of friction and noise.

    Args:
        rows: With efforts in unknown units.
        laws: Friction of each joint.
        prior: Of bodies, by the deviations of their density and of all else.

    Returns:
        Of each joint, 1 where it cannot be identified, shape (n,); and notes of their intervals.
    """
    train = rows.samples.use & rows.samples.train[:, None]
    identifiable, scales, notes = _guess(rows, train, laws)

    def at(scales: Array, prior: Prior) -> Fit:
        return fitted(Problem(rows, train, prior, scales), laws)

    for _ in range(30):
        change = np.where(identifiable, _rescaled(at(scales, prior(*SCALE_PRIOR)))[0], 0.0)
        scales = scales * np.exp(np.clip(change, -0.5, 0.5))
        if abs(change).max() < 1e-5:
            break
    _, sds = _rescaled(at(scales, prior(*NOMINAL_ERRORS)))
    lines = [
        f"{name} {k:.3g} ({k * np.exp(-NORMAL_95 * sd):.3g} to {k * np.exp(NORMAL_95 * sd):.3g})"
        for name, k, sd, known in zip(rows.samples.names, scales, sds, identifiable, strict=True)
        if known
    ]
    if lines:
        notes.append(
            f"scales of efforts assume that densities of the nominal bodies are accurate to "
            f"{NOMINAL_ERRORS[0]:.0%} and their shapes to {NOMINAL_ERRORS[1]:.0%}: "
            + ", ".join(lines)
        )
    return scales, notes


def _guess(rows: Rows, train: Mask, laws: Sequence[JointFit]) -> tuple[Array, Array, list[str]]:
    """Which scales can be identified, (n,), these by the nominal bodies, and notes of others."""
    nominal = rows.rigid @ rows.samples.regressor.nominal + rows.known_torques
    identifiable, scales, notes = np.zeros(rows.samples.n, bool), np.ones(rows.samples.n), []
    for j, name in enumerate(rows.samples.names):
        use = train[:, j]
        y, of_bodies = rows.effort[use, j], nominal[use, j]
        columns = rows.inertia[:, j : j + 1], rows.friction(laws[j], j, nominal[:, j])
        own = np.hstack(columns)[use]
        whole = np.column_stack([own, of_bodies])
        without, with_bodies = (
            float(np.sum((y - A @ np.linalg.lstsq(A, y, rcond=1e-10)[0]) ** 2))
            for A in (own, whole)
        )
        slope = float(np.linalg.lstsq(whole, y, rcond=1e-10)[0][-1])
        heavy = slope * of_bodies.std() / y.std()
        identifiable[j] = 1.0 - with_bodies / max(without, 1e-300) > EXPLAINED and heavy > BODIES
        if identifiable[j]:
            scales[j] = 1.0 / slope
        else:
            notes.append(
                f"'{name}': the scale of its efforts cannot be identified, because friction "
                "dominates them; they are taken as torques"
            )
    return identifiable, scales, notes


def _rescaled(fit: Fit) -> tuple[Array, Array]:
    """Relative corrections of scales, with all unknowns free, and their deviations.

    The residual is that of the measured efforts, so that small scales do not reduce it:
    e - A x / k is linear in x and in the change of k.
    """
    return added_coefficients(fit, -fit.drives[:, :, None] * np.eye(fit.rows.samples.n))
