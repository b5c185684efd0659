# SPDX-License-Identifier: Apache-2.0
"""Irregularities of a recording that a fit shows: outliers, uneven friction, a tilted base."""

import numpy as np

from arm_studies.identification.regression.estimation import Mask
from arm_studies.identification.regression.fit import Fit
from arm_studies.identification.regression.friction import COULOMB
from arm_studies.identification.regression.regressor import RigidRegressor
from arm_studies.identification.regression.rows.samples import Samples
from arm_studies.identification.regression.uncertainty import added_coefficients

# Standard deviations above which a tilt, or a change of friction, is reported.
SIGNIFICANT = 5.0
# Angle in [rad] above which a tilt of the base is reported.
TILT = 0.01
# Blocks of a recording whose friction is compared.
BLOCKS = 10
# Relative change of friction over a recording from which it is reported as a drift.
DRIFT = 0.1
# Change of friction over a turn, relative to its Coulomb friction, from which it is reported.
RIPPLE = 0.1
# Fraction of the rows in which a joint may stick, from which it is reported.
STICKING_FRACTION = 0.5
# Robust standard deviations beyond which a residual is an outlier: contact, or stiction.
OUTLIER = 5.0
# Fraction of a joint's rows from which they are no outliers, but a motion that the fit misses.
MANY = 0.2
# Fraction of a joint's rows from which outliers are reported.
NOTED_FRACTION = 0.002
AT_STOP = 0.01  # Distance in [rad] or [m] from an end stop within which it is the cause of one.


def without_outliers(fit: Fit, use: Mask) -> tuple[Mask, list[str]]:
    """Rows to use without outliers, shape (k, n), and a note of each joint that has many."""
    rows = fit.rows
    kept, notes, reach = use.copy(), list[str](), max(1, rows.samples.lag // 8)
    for j, name in enumerate(rows.samples.names):
        used = use[:, j]
        if not used.any():
            continue
        size = abs(fit.residual[:, j])
        typical = 1.4826 * float(np.median(size[used]))
        floor = 1e-6 * float(np.sqrt(np.mean(rows.effort[used, j] ** 2)))
        far = (size > OUTLIER * max(typical, floor)) & used
        wide = np.convolve(far, np.ones(2 * reach + 1), mode="same") > 0.5
        share = float(wide[used].mean())
        if not 0.0 < share < MANY:
            continue
        kept[:, j] &= ~wide
        if share > NOTED_FRACTION:
            stops = rows.samples.regressor.model.stops.place[:, j]
            stopped = abs(rows.samples.q[wide, j, None] - stops).min() < AT_STOP
            cause = "it hits its end stop" if stopped else "stiction, contact or sensor fault"
            notes.append(
                f"'{name}': {share:.1%} of the rows are outliers ({cause}) and are not used in "
                "the fit"
            )
    return kept, notes


def notes_of(trial: Fit, final: Fit) -> list[str]:
    """Notes of what a fit of the rows that are not held out, and one of all rows, show."""
    band, notes = final.rows.effort_band, list[str]()
    if band is not None:
        notes.append(
            f"efforts do not follow the motion above about {band:.3g} Hz: they were filtered "
            "before, or predictions are only position noise there; predictions are filtered "
            "likewise"
        )
    return [*notes, *sticking(final.rows.samples), *drifts(final), *ripples(trial), *tilts(trial)]


def sticking(samples: Samples) -> list[str]:
    """Notes of joints that rest or reverse so often that most of their rows are not used."""
    still, valid = samples.still & samples.valid, samples.valid
    shares = still.sum(axis=0) / np.maximum(valid.sum(axis=0), 1)
    return [
        f"'{name}': it may stick in {share:.0%} of the rows, where it rests or reverses; they are "
        "not used (a faster motion, or friction compensation, leaves more)"
        for name, share in zip(samples.names, shares.tolist(), strict=True)
        if STICKING_FRACTION < share < 1.0
    ]


def drifts(fit: Fit) -> list[str]:
    """Notes of joints whose friction changes over the recording, as with temperature.

    The residual along the motion, averaged over each of ``BLOCKS`` blocks, then has a slope over
    time that is significant against its scatter.
    """
    rows, friction, notes = fit.rows, fit.columns.predicted_friction(fit.x), []
    for j, name in enumerate(rows.samples.names):
        used = np.flatnonzero(fit.problem.use[:, j] & (rows.samples.v[:, j] != 0.0))
        size = float(np.mean(abs(friction[used, j]))) if used.size else 0.0
        if used.size < 10 * BLOCKS or size == 0.0:
            continue
        along = fit.residual[used, j] * np.sign(rows.samples.v[used, j])
        means = np.array([part.mean() for part in np.array_split(along, BLOCKS)])
        at = np.linspace(-0.5, 0.5, BLOCKS)
        slope = float(at @ means / (at @ at))
        scatter = float(np.std(means - means.mean() - slope * at, ddof=2))
        if abs(slope) > max(SIGNIFICANT * scatter / float(np.sqrt(at @ at)), DRIFT * size):
            notes.append(
                f"'{name}': friction changes by {slope / size:+.0%} over the recording, as with "
                "temperature; the scene has the mean"
            )
    return notes


def ripples(fit: Fit) -> list[str]:
    """Notes of joints whose dry friction changes over a turn, as with gears and misalignment.

    Friction of the form sign(v) (a sin q + b cos q) then explains the torques.
    """
    rows = fit.rows
    waves = np.zeros((*rows.samples.q.shape, 2 * rows.samples.n))
    for j in np.flatnonzero(rows.samples.regressor.model.turning):
        q, sign = rows.samples.q[:, j], np.sign(rows.samples.v[:, j])
        waves[:, j, 2 * j], waves[:, j, 2 * j + 1] = sign * np.sin(q), sign * np.cos(q)
    coefficients, deviation = added_coefficients(fit, rows.of_joints(waves))
    sizes, sds = np.hypot(*coefficients.reshape(-1, 2).T), deviation.reshape(-1, 2).max(axis=1)
    dry = [law.coefficients.get(COULOMB, 0.0) for law in fit.friction]
    return [
        f"'{name}': friction changes by ±{size / level:.0%} with the position over a turn; the "
        "scene has the mean ('friction.position' describes it)"
        for name, size, sd, level in zip(rows.samples.names, sizes, sds, dry, strict=True)
        if size > max(SIGNIFICANT * sd, RIPPLE * level) and level > 0.0
    ]


def tilts(fit: Fit) -> list[str]:
    """A note if the orientation of the base does not agree with the scene's gravity.

    A small rotation of gravity adds components along two perpendicular directions, whose
    torques are additional columns.
    """
    rows, regressor = fit.rows, fit.rows.samples.regressor
    model = regressor.model
    gravity = np.array(model.scene.gravity)
    size = float(np.linalg.norm(gravity))
    if size == 0.0:
        return []
    across = np.linalg.svd(gravity[None])[2][1:] * size
    theta, still = fit.theta + regressor.payload, np.zeros_like(rows.samples.q)
    turned = [RigidRegressor(model.under(g, model.scene.payloads)) for g in across]
    torques = np.stack([each(rows.samples.q, still, still) @ theta for each in turned], axis=2)
    turn, deviation = added_coefficients(fit, rows.of_joints(torques))
    if (abs(turn) < np.maximum(SIGNIFICANT * deviation, TILT)).all():
        return []
    better = gravity + turn @ across
    better *= size / np.linalg.norm(better)
    angle = np.degrees(np.arctan(np.linalg.norm(turn)))
    return [
        f"the base seems to be tilted by about {angle:.1f}°; to check, set gravity to "
        f"[{', '.join(f'{x:.3g}' for x in better)}] in the nominal scene"
    ]
