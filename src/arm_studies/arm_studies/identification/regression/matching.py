# SPDX-License-Identifier: Apache-2.0
"""Which joint's motion explains which efforts: columns that are reversed or swapped."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_studies.identification.regression.estimation import Belief, Mask
from arm_studies.identification.regression.friction_columns import (
    COULOMB,
    COULOMB_SKEW,
    VISCOUS,
    JointFit,
)
from arm_studies.identification.regression.rows import Rows

SIMPLE = JointFit((VISCOUS, COULOMB, COULOMB_SKEW))
EXACT = 0.1
"""Relative residual that is as unlikely as one standard deviation of the bodies."""
POOR, FAIR = 0.2, 0.5
"""Relative residual above which a joint's own motion does not explain its efforts, and below which
another does."""
BETTER = 0.3
"""Smallest improvement by which another is believed: the ratio of the two residuals."""


@dataclass(frozen=True)
class Match:
    """The motion that explains a column of efforts.

    Attributes:
        column: Joint whose column of efforts it is.
        joint: Joint whose motion explains it.
        sign: 1 or -1, by which its torque has to be multiplied.
    """

    column: int
    joint: int
    sign: int


def mismatched(rows: Rows, use: Mask, belief: Belief) -> list[Match]:
    """Columns of efforts that another sign, or the motion of another joint, explains far better.

    Bodies stay near the nominal ones, up to a common positive factor, and friction opposes the
    motion: without these two conditions, bodies of negative mass would explain a reversed column.

    Args:
        rows: The regression's rows.
        use: Rows that are used, shape (k, n).
        belief: Prior of the bodies alone.
    """
    left = np.stack([_residuals(rows, use[:, j], belief, j) for j in range(rows.n)], axis=-1)
    found = []
    for i in np.flatnonzero(use.any(axis=0)):  # nothing is known of a joint that does not move
        of_column = left[:, i]
        turned, j = np.unravel_index(np.argmin(of_column), of_column.shape)
        own, best = of_column[0, i], of_column[turned, j]
        if own > POOR and best < min(FAIR, BETTER * own):
            found.append(Match(int(i), int(j), -1 if turned else 1))
    return found


def _residuals(rows: Rows, use: NDArray[np.bool_], belief: Belief, j: int) -> Array:
    """Relative residuals of all columns, as they are and reversed, by the motion of joint j.

    Returns:
        Shape (2, n).
    """
    found = np.full((2, rows.n), np.inf)
    masks = use[:, None] & rows.valid
    for mask in np.unique(masks, axis=1).T:
        columns = np.flatnonzero((masks == mask[:, None]).all(axis=0))
        own = rows.friction(SIMPLE, j, np.zeros(len(use)))[:, ::-1]  # the first may be negative
        parts = (rows.rigid[:, j], own[:, :1], rows.inertia[:, j : j + 1], own[:, 1:])
        motion = np.column_stack([*parts, rows.known[:, j], rows.effort[:, columns]])[mask]
        R = np.linalg.qr(motion, mode="r")
        for k, i in enumerate(columns, R.shape[1] - len(columns)):
            for turned, sign in enumerate((1.0, -1.0)):
                y = sign * R[:, k]
                found[turned, i] = _residual(R[:, : -len(columns) - 1], R[:, -len(columns) - 1],
                                             y, belief)  # fmt: skip
    return found


def _residual(A: Array, known: Array, y: Array, belief: Belief) -> float:
    """Relative residual of efforts y, whose factor g is an unknown: A x + known = g y.

    Args:
        A: Columns of the bodies, of a constant torque, of the armature and of friction.
        known: Torques of payloads and springs.
        y: Efforts in the same rows.
        belief: Prior of the bodies.
    """
    bodies = len(belief.x0)
    size = EXACT * float(np.linalg.norm(A[:, :bodies] @ belief.x0 + known))
    length = float(np.linalg.norm(y))
    if size == 0.0 or length == 0.0:
        return np.inf
    A = np.insert(A, bodies + 1, -y / length, axis=1)
    prior = np.hstack([belief.rows, np.zeros((len(belief.rows), A.shape[1] - bodies))])
    x = _partly_positive(
        np.vstack([A / size, prior]),
        np.concatenate([-known / size, belief.rows @ belief.x0]), bodies + 1,
    )  # fmt: skip
    gain = x[bodies + 1]
    return float(np.linalg.norm(A @ x + known) / gain) if gain > 0.0 else np.inf


def _partly_positive(R: Array, z: Array, first: int) -> Array:
    """The x that minimizes ‖R x - z‖ without negative unknowns from ``first`` on.

    Those that come out negative are set to zero, the most negative first.
    """
    kept = np.ones(R.shape[1], bool)
    while True:
        x = np.zeros(R.shape[1])
        size = np.linalg.norm(R[:, kept], axis=0)
        size[size == 0.0] = 1.0
        x[kept] = np.linalg.lstsq(R[:, kept] / size, z, rcond=1e-12)[0] / size
        negative = np.where(x[first:] < 0.0, x[first:] * np.linalg.norm(R[:, first:], axis=0), 0.0)
        if not negative.any():
            return x
        kept[first + int(np.argmin(negative))] = False
