# SPDX-License-Identifier: Apache-2.0
"""Faults of columns of efforts: another sign, joint, time or scale explains them better."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_studies.identification.regression.estimation import Prior, Problem, solved
from arm_studies.identification.regression.friction import SIMPLE_LAW
from arm_studies.identification.regression.rows.rows import Rows
from arm_studies.identification.regression.uncertainty import NORMAL_95

# Relative residual that is as unlikely as one standard deviation of the bodies.
BODY_RESIDUAL = 0.1
# Relative residual above which a joint's own motion does not explain its efforts, and below which
# another does.
UNEXPLAINED, EXPLAINED = 0.2, 0.5
# Smallest improvement by which another is believed: the ratio of the two residuals.
IMPROVEMENT = 0.3
# Largest delay that is looked for in [s], and number of delays that are tried up to it; delays
# beyond ``BEYOND_GRID`` may be longer.
LONGEST_DELAY, SHIFTS = 0.5, 50
BEYOND_GRID = 0.99 * LONGEST_DELAY
# Fraction of the power of a residual that a delay must cause, and smallest relative residual, for
# it to be noted as possible: friction of another shape, such as a Stribeck peak, can look like it.
POSSIBLE_FRACTION, POSSIBLE_RESIDUAL = 0.5, 0.003
# Fraction that it must cause to be certain, and relative residual that it causes from which it
# spoils friction and bodies.
CERTAIN_FRACTION, GROSS_RESIDUAL = 0.9, 0.05
SINGULAR = 1e-7  # Singular values relative to the largest below which columns are dependent.
# Factor, and standard deviations of its logarithm, from which a scale is noted: rather too often
# than too seldom, since bodies may be the cause as well.
SCALE_FACTOR, SCALE_DEVIATIONS = 1.4, 1.5
LARGEST_DEVIATION = 0.7  # Largest standard deviation of the logarithm of a scale that is noted.


@dataclass(frozen=True)
class ColumnMatch:
    """The motion that explains a column of efforts.

    Attributes:
        column: Joint whose column of efforts it is.
        joint: Joint whose motion explains it.
        sign: 1 or -1, by which its torque has to be multiplied.
    """

    column: int
    joint: int
    sign: int


@dataclass(frozen=True)
class Delay:
    """Efforts that fit the motion of another time.

    Attributes:
        joint: Joint whose column of efforts it is.
        lag: By how much in [s]; negative if efforts are ahead of the motion.
        residual: Relative residual of the efforts as they are.
        remainder: Relative residual of efforts without the delay.
    """

    joint: int
    lag: float
    residual: float
    remainder: float

    @property
    def is_gross(self) -> bool:
        """Whether the delay is certain and spoils what is identified."""
        power = self.residual**2 - self.remainder**2  # of the residual, that the delay causes
        is_most = power > CERTAIN_FRACTION * self.residual**2
        return (is_most or abs(self.lag) > BEYOND_GRID) and power > GROSS_RESIDUAL**2


@dataclass(frozen=True)
class Scale:
    """Efforts over the torques that a joint's nominal bodies need.

    Attributes:
        joint: The joint.
        factor: Efforts over torques.
        low: Lower end of its 95 % interval, given the doubt in the bodies.
        high: Upper end.
    """

    joint: int
    factor: float
    low: float
    high: float


def swaps(problem: Problem) -> list[ColumnMatch]:
    """Columns of efforts that another sign, or the motion of another joint, explains far better.

    Bodies stay near the nominal ones, up to a common positive factor, and friction opposes the
    motion: without these two conditions, bodies of negative mass would explain a reversed column.
    """
    rows = problem.rows
    residuals = np.stack([_residuals(problem, j) for j in range(rows.samples.n)], axis=-1)
    matches = []
    for i in np.flatnonzero(rows.samples.use.any(axis=0)):  # of others, nothing is known
        of_column = residuals[:, i]
        turned, j = np.unravel_index(np.argmin(of_column), of_column.shape)
        own, best = of_column[0, i], of_column[turned, j]
        if own > UNEXPLAINED and best < min(EXPLAINED, IMPROVEMENT * own):
            matches.append(ColumnMatch(int(i), int(j), -1 if turned else 1))
    return matches


def delays(problem: Problem) -> list[Delay]:
    """Columns of efforts whose residual a constant delay causes for the most part.

    Each column is fitted by its joint's own motion with bodies that are free, at each of a grid of
    delays, and the square of the residual is interpolated around its minimum. Nothing is assumed
    of the bodies: none of them makes a torque late.
    """
    rows, dt = problem.rows, problem.rows.samples.motions[0].dt
    step = max(1, round(LONGEST_DELAY / (SHIFTS * dt)))
    shifts = step * np.arange(-SHIFTS, SHIFTS + 1)
    shifts = shifts[abs(shifts) * dt < LONGEST_DELAY + 0.5 * step * dt]
    faults = []
    for j in range(rows.samples.n):
        shifted = [_shifted(rows, j, int(by)) for by in shifts]
        use = problem.use[:, j] & np.all([valid for _, valid in shifted], axis=0)
        if not use.any() or not rows.samples.use[:, j].any():
            continue
        friction = rows.friction(SIMPLE_LAW, j, np.zeros(len(rows.effort)))
        parts = (rows.rigid[:, j], rows.inertia[:, [j]], friction, rows.known_torques[:, [j]])
        own = np.hstack(parts)
        unexplained = _unexplained(own[use], np.column_stack([y[use] for y, _ in shifted]))
        before, at = unexplained[len(shifts) // 2], int(np.argmin(unexplained))
        after = unexplained[at]
        if before > POSSIBLE_RESIDUAL**2 and after < (1.0 - POSSIBLE_FRACTION) * before:
            vertex = 0.0  # of the parabola through the smallest and its neighbours, from it
            if 0 < at < len(shifts) - 1:
                a, b, c = unexplained[at - 1 : at + 2]
                vertex = 0.5 * (a - c) / (a - 2.0 * b + c)
            lag = float(step * dt * (at - len(shifts) // 2 + vertex))
            faults.append(Delay(j, lag, float(np.sqrt(before)), float(np.sqrt(after))))
    return faults


def _shifted(rows: Rows, joint: int, by: int) -> tuple[Array, NDArray[np.bool_]]:
    """A joint's efforts some rows later, and which are valid and of the same stretch, (k,)."""
    lengths = [s.stop - s.start for _, s in rows.samples.stretches]
    stretch, row = np.repeat(range(len(lengths)), lengths), np.arange(sum(lengths))
    later = np.clip(row + by, 0, len(row) - 1)
    same = (later == row + by) & (stretch[later] == stretch)
    return rows.effort[later, joint], rows.samples.valid[later, joint] & same


def _unexplained(columns: Array, y: Array) -> Array:
    """Fractions of the power of each y of shape (k, m) that columns do not explain, shape (m,)."""
    size = np.linalg.norm(columns, axis=0)
    U, singular, _ = np.linalg.svd(columns[:, size > 0.0] / size[size > 0.0], full_matrices=False)
    U = U[:, singular > SINGULAR * singular[0]]
    power = np.maximum((y**2).sum(axis=0), 1e-300)
    return np.asarray(((y - U @ (U.T @ y)) ** 2).sum(axis=0) / power)


def scales(problem: Problem) -> list[Scale]:
    """Columns of efforts that are many times the torques of bodies near the nominal ones, or few.

    Where friction makes most of an effort, its scale is uncertain, and nothing is said.
    """
    rows, use, faults = problem.rows, problem.use, []
    for j in np.flatnonzero(use.any(axis=0)):
        R = _triangle(rows, use[:, j] & rows.samples.valid[:, j], int(j), np.array([j]))
        gain, deviation, _ = _fitted(R[:, :-2], R[:, -2], R[:, -1], problem.prior)
        if gain <= 0.0 or deviation > LARGEST_DEVIATION:
            continue
        if abs(np.log(gain)) > max(SCALE_DEVIATIONS * deviation, np.log(SCALE_FACTOR)):
            wide = np.exp(NORMAL_95 * deviation)
            faults.append(Scale(int(j), 1.0 / gain, 1.0 / gain / wide, wide / gain))
    return faults


def _residuals(problem: Problem, j: int) -> Array:
    """Relative residuals of all columns, as they are and reversed, by the motion of joint j.

    Returns:
        Shape (2, n).
    """
    rows = problem.rows
    residuals = np.full((2, rows.samples.n), np.inf)
    masks = problem.use[:, j : j + 1] & rows.samples.valid
    for mask in np.unique(masks, axis=1).T:
        columns = np.flatnonzero((masks == mask[:, None]).all(axis=0))
        R = _triangle(rows, mask, j, columns)
        A, known_torques, efforts = np.split(R, [-len(columns) - 1, -len(columns)], axis=1)
        for i, y in zip(columns, efforts.T, strict=True):
            for turned, sign in enumerate((1.0, -1.0)):
                gain = _fitted(A, known_torques[:, 0], sign * y, problem.prior)
                residuals[turned, i] = gain.residual
    return residuals


def _triangle(rows: Rows, mask: NDArray[np.bool_], j: int, columns: NDArray[np.int_]) -> Array:
    """Triangle of the motion of joint j, of its known torques, and of columns of efforts."""
    own = rows.friction(SIMPLE_LAW, j, np.zeros(len(mask)))[:, ::-1]  # the first may be negative
    parts = (rows.rigid[:, j], own[:, :1], rows.inertia[:, j : j + 1], own[:, 1:])
    motion = np.column_stack([*parts, rows.known_torques[:, j], rows.effort[:, columns]])[mask]
    return np.asarray(np.linalg.qr(motion, mode="r"))


class _Gain(NamedTuple):
    """Factor of efforts, the standard deviation of its logarithm, and the relative residual."""

    factor: float
    deviation: float
    residual: float


def _fitted(A: Array, known_torques: Array, y: Array, prior: Prior) -> _Gain:
    """Factor g of efforts y, an unknown as well: A x + known torques = g y.

    Args:
        A: Columns of the bodies, of a constant torque, of the armature and of friction.
        known_torques: Of payloads and springs.
        y: Efforts in the same rows.
        prior: Prior of the bodies.
    """
    bodies = len(prior.x0)
    size = BODY_RESIDUAL * float(np.linalg.norm(A[:, :bodies] @ prior.x0 + known_torques))
    length = float(np.linalg.norm(y))
    if size == 0.0 or length == 0.0:
        return _Gain(0.0, np.inf, np.inf)
    A = np.insert(A, bodies + 1, -y / length, axis=1)
    before = np.pad(prior.rows, ((0, 0), (0, A.shape[1] - bodies)))
    R = np.vstack([A / size, before])
    z = np.concatenate([-known_torques / size, prior.rows @ prior.x0])
    x, kept = _partly_positive(R, z, bodies + 1)
    gain = float(x[bodies + 1])
    if gain <= 0.0:
        return _Gain(0.0, np.inf, np.inf)
    rest = np.delete(R[:, kept], kept[: bodies + 1].sum(), axis=1)
    alone = np.sqrt(_unexplained(rest, R[:, bodies + 1 : bodies + 2])[0])
    sure = alone * float(np.linalg.norm(R[:, bodies + 1]))
    deviation = max(1.0, float(np.linalg.norm(R @ x - z))) / max(sure, 1e-300) / gain
    return _Gain(gain / length, deviation, float(np.linalg.norm(A @ x + known_torques)) / gain)


def _partly_positive(R: Array, z: Array, first: int) -> tuple[Array, NDArray[np.bool_]]:
    """The x that minimizes ‖R x - z‖ without negative unknowns from ``first`` on.

    Those that come out negative are set to zero, the most negative first.

    Returns:
        x, and which unknowns were not set to zero.
    """
    kept = np.ones(R.shape[1], bool)
    while True:
        x = np.zeros(R.shape[1])
        x[kept] = solved(R[:, kept], z, 1e-12)
        negative = np.where(x[first:] < 0.0, x[first:] * np.linalg.norm(R[:, first:], axis=0), 0.0)
        if not negative.any():
            return x, kept
        kept[first + int(np.argmin(negative))] = False
