# SPDX-License-Identifier: Apache-2.0
"""Irregularities of a recording that a fit shows: outliers, uneven friction, a tilted base."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from arm_dynamics.arrays import Array
from arm_studies.identification.regression.estimation import Belief, Mask
from arm_studies.identification.regression.fit import Fit
from arm_studies.identification.regression.friction_columns import COULOMB
from arm_studies.identification.regression.intervals import besides
from arm_studies.identification.regression.regressor import RigidRegressor
from arm_studies.identification.regression.rows import Rows

# Angle in [rad], and standard deviations, above which a tilt of the base is reported.
TILT, SURELY = 0.01, 5.0
# Blocks of a recording, and relative change of friction, from which a drift is reported.
BLOCKS, DRIFT = 10, 0.1
# Change of friction over a turn, relative to its Coulomb friction, from which it is reported.
RIPPLE = 0.1
MOSTLY = 0.5  # Fraction of the rows in which a joint may stick, from which it is reported.
# Robust standard deviations beyond which a residual is an outlier: contact, or stiction.
FAR_OFF = 5.0


def without_outliers(
    names: Sequence[str], rows: Rows, use: Mask, fit: Fit
) -> tuple[Mask, list[str]]:
    """Rows to use without outliers, shape (k, n), and a note of each joint that has many."""
    kept, notes, reach = use.copy(), list[str](), max(1, rows.lag // 8)
    for j, name in enumerate(names):
        mine = use[:, j]
        if not mine.any():
            continue
        size = abs(fit.residual[:, j])
        typical = 1.4826 * float(np.median(size[mine]))
        floor = 1e-6 * float(np.sqrt(np.mean(rows.effort[mine, j] ** 2)))
        far = (size > FAR_OFF * max(typical, floor)) & mine
        wide = np.convolve(far, np.ones(2 * reach + 1), mode="same") > 0.5
        share = float(wide[mine].mean())
        if 0.0 < share < 0.2:
            kept[:, j] &= ~wide
            if share > 0.002:
                notes.append(
                    f"'{name}': {share:.1%} of the rows are outliers (stiction, contact, or "
                    "a sensor fault) and are not used in the fit"
                )
    return kept, notes


def sticking(names: Sequence[str], rows: Rows) -> list[str]:
    """Notes of joints that rest or reverse so often that most of their rows are not used."""
    shares = (rows.still & rows.valid).sum(axis=0) / np.maximum(rows.valid.sum(axis=0), 1)
    return [
        f"'{name}': it may stick in {share:.0%} of the rows, where it rests or reverses; they are "
        "not used (a faster motion, or friction compensation, leaves more)"
        for name, share in zip(names, shares.tolist(), strict=True)
        if MOSTLY < share < 1.0
    ]


def drifts(names: Sequence[str], rows: Rows, fit: Fit, use: Mask) -> list[str]:
    """Notes of joints whose friction changes over the recording, as with temperature."""
    own = fit.columns.own_predicted(fit.x)
    changes = [
        _drift(rows.v[mine, j], own[mine, j], fit.residual[mine, j])
        for j in range(rows.n)
        for mine in [np.flatnonzero(use[:, j] & (rows.v[:, j] != 0.0))]
    ]
    return [
        f"'{name}': friction changes by {change:+.0%} over the recording, as with temperature; "
        "the scene has the mean"
        for name, change in zip(names, changes, strict=True)
        if change
    ]


def _drift(v: Array, friction: Array, residual: Array) -> float:
    """Relative change of a joint's friction over its rows; 0 if it is not significant.

    It is if the residual along the motion, averaged over each of ``BLOCKS`` blocks, has a slope
    over time that is significant against its scatter.
    """
    size = float(np.mean(abs(friction))) if v.size else 0.0
    if v.size < 10 * BLOCKS or size == 0.0:
        return 0.0
    along = residual * np.sign(v)
    means = np.array([part.mean() for part in np.array_split(along, BLOCKS)])
    at = np.linspace(-0.5, 0.5, BLOCKS)
    slope = float(at @ means / (at @ at))
    scatter = float(np.std(means - means.mean() - slope * at, ddof=2))
    certain = abs(slope) > max(5.0 * scatter / float(np.sqrt(at @ at)), DRIFT * size)
    return slope / size if certain else 0.0


def ripples(
    names: Sequence[str], turning: Sequence[bool], rows: Rows, fit: Fit,
    belief: Callable[[int], Belief],
) -> list[str]:  # fmt: skip
    """Notes of joints whose dry friction changes over a turn, as with gears and misalignment.

    It is if friction of the form sign(v) (a sin q + b cos q) explains the torques.
    """
    waves = np.zeros((*rows.q.shape, 2 * rows.n))
    for j in np.flatnonzero(turning):
        q, way = rows.q[:, j], np.sign(rows.v[:, j])
        waves[:, j, 2 * j], waves[:, j, 2 * j + 1] = way * np.sin(q), way * np.cos(q)
    found, doubt = besides(rows, fit, rows.of_joints(waves), belief)
    sizes, doubts = np.hypot(*found.reshape(-1, 2).T), doubt.reshape(-1, 2).max(axis=1)
    dry = [own.coefficients.get(COULOMB, 0.0) for own in fit.friction]
    return [
        f"'{name}': friction changes by ±{size / level:.0%} with the position over a turn; the "
        "scene has the mean ('friction.position' describes it)"
        for name, size, sd, level in zip(names, sizes, doubts, dry, strict=True)
        if size > max(SURELY * sd, RIPPLE * level) and level > 0.0
    ]


def tilts(
    regressor: RigidRegressor, rows: Rows, fit: Fit, belief: Callable[[int], Belief]
) -> list[str]:
    """A note if the orientation of the base does not agree with the scene's gravity.

    A small rotation of gravity adds components along two perpendicular directions, whose
    torques are additional columns.
    """
    model = regressor.model
    gravity = np.array(model.scene.gravity)
    size = float(np.linalg.norm(gravity))
    if size == 0.0:
        return []
    across = np.linalg.svd(gravity[None])[2][1:] * size
    theta, still = fit.x[: fit.bodies] + regressor.payload, np.zeros_like(rows.q)
    turned = [RigidRegressor(model.under(g, model.scene.payloads)) for g in across]
    torques = np.stack([each(rows.q, still, still) @ theta for each in turned], axis=2)
    turn, doubt = besides(rows, fit, rows.of_joints(torques), belief)
    if (abs(turn) < np.maximum(SURELY * doubt, TILT)).all():
        return []
    better = gravity + turn @ across
    better *= size / np.linalg.norm(better)
    angle = np.degrees(np.arctan(np.linalg.norm(turn)))
    return [
        f"the base seems to be tilted by about {angle:.1f}°; to check, set gravity to "
        f"[{', '.join(f'{x:.3g}' for x in better)}] in the nominal scene"
    ]
