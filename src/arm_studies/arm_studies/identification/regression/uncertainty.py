# SPDX-License-Identifier: Apache-2.0
"""What the torques alone say of the parameters, and how surely: neither prior nor constraints.

The prior draws a scene's bodies to the nominal ones where the torques hardly determine them, and
bodies have to be physically consistent. Both are right for a scene, but they shift the estimate by
an amount that its noise does not show. Estimates here have neither, so that intervals contain the
truth as often as they claim, wherever the nominal scene is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from arm_dynamics.arrays import Array
from arm_studies.identification.regression.estimation import Mask, solved
from arm_studies.identification.regression.fit import Fit
from arm_studies.identification.regression.rows.rows import Rows
from arm_studies.identification.signals.filtering import FLAT_NOISE

# Singular values relative to the largest below which a direction is not determined.
SINGULAR = 1e-7
# Largest torque, relative to those that are measured, that the standard deviation of a parameter
# may cause: beyond it, the motion does not determine the parameter.
LARGEST_TORQUE = 0.1
WIDEST = 50.0  # Largest half width of an interval of a logarithm, beyond which numbers overflow.
# Ratio of the variance of any residuals to that of white ones that the uncertainty of the former
# explains.
CHANCE_RATIO = 1.5
# Width of an interval over that by white noise of the sensors beyond which it is scatter.
SCATTER_RATIO = 2.0
NORMAL_95 = 1.96  # Standard deviations on either side of a 95 % interval.
UNKNOWN_FRICTION = 10.0  # Size of unknown friction over dry friction of which nothing is assumed.
ZERO = 1e-9  # Standard deviation below which even a zero is identified.


@dataclass(frozen=True)
class Estimate:
    """An estimate with its 95 % interval, which is unbounded if the torques determine nothing.

    Attributes:
        value: The estimate.
        low: Lower end.
        high: Upper end.
        scatter: Whether errors of the model cause most of its width: it is then how much the
            estimate scatters along the recording, and need not contain the truth.
    """

    value: float
    low: float
    high: float
    scatter: bool = False

    @classmethod
    def of(cls, value: float, deviation: float, scatter: bool = False) -> Estimate:
        """With a normal error."""
        half = NORMAL_95 * deviation
        return cls(value, value - half, value + half, scatter)

    @classmethod
    def of_positive(cls, value: float, deviation: float, scatter: bool = False) -> Estimate:
        """With a normal error of its logarithm."""
        factor = math.exp(min(NORMAL_95 * deviation, WIDEST))
        return cls(value, value / factor, value * factor, scatter)

    @property
    def significant(self) -> bool:
        """Whether its sign is known, or that it is zero."""
        return not self.low <= 0.0 <= self.high or self.high - self.low < 2.0 * NORMAL_95 * ZERO


@dataclass(frozen=True)
class Estimates:
    """Least-squares estimates.

    Attributes:
        linear: Base parameters, then coefficients of friction, joint by joint.
        shapes: ``load`` and ``stribeck_velocity`` by joint and name.
        condition: Condition number of the scaled regression.
    """

    linear: tuple[Estimate, ...]
    shapes: Mapping[tuple[int, str], Estimate]
    condition: float


def estimated(fit: Fit) -> Estimates:
    """Estimates of base parameters and friction, with the laws, weights and residuals of a fit.

    Shapes are linearized there. Bodies and armatures act through the leading unknowns of the base
    parameters alone, see ``base_parameters``.
    """
    columns, parameters = fit.with_shapes
    rows, weights = fit.rows, fit.weights * fit.problem.use
    numbers, first = len(fit.theta), len(fit.theta) + rows.samples.n  # of bodies; of friction
    # Bases begin with armatures, unknowns with bodies.
    lead = [(k + numbers) % first for k in rows.samples.regressor.base.independent]
    places = np.array([*lead, *range(first, columns.size)])
    own = np.zeros((rows.samples.n, len(weights), columns.size))
    for j, place in enumerate(columns.places):
        own[j][:, place] = columns.all_of(j) * weights[:, j : j + 1]
    y, ageing = weights * fit.problem.target, weights * rows.ageing(fit.predicted(rows.unwhitened))
    noise = fit.weights * rows.noise(fit.theta, fit.armature)
    solution = unbiased(rows, own[:, :, places], y, ageing, noise, float(np.linalg.norm(y)))
    of_shapes = len(places) - len(parameters)
    triples = list(zip(*(column.tolist() for column in solution[:3]), strict=True))
    shapes = dict[tuple[int, str], Estimate]()
    steps = triples[of_shapes : len(places)]
    for (j, parameter), (by, *error) in zip(parameters, steps, strict=True):
        kind, shape = parameter.kind, fit.friction[j].shape.moved(parameter, by)
        if kind == "load" and shape.load is not None:
            shapes[j, kind] = Estimate.of(shape.load, *error)
        elif kind == "stribeck_velocity" and shape.stribeck_velocity is not None:
            shapes[j, kind] = Estimate.of_positive(shape.stribeck_velocity, *error)
    linear = tuple(Estimate.of(*triple) for triple in triples[:of_shapes])
    return Estimates(linear, shapes, solution.condition)


class Unbiased(NamedTuple):
    """Least-squares estimates without a prior.

    Attributes:
        values: Shape (unknowns,).
        deviations: Standard deviations, likewise; inf where the motion does not determine one.
        scatter: Whether deviations are scatter, likewise.
        condition: Condition number.
    """

    values: Array
    deviations: Array
    scatter: Mask
    condition: float


def unbiased(
    rows: Rows, own: Array, y: Array, ageing: Array, noise: Array, torque: float
) -> Unbiased:
    """Least-squares estimates, without a prior, and their standard deviations.

    Args:
        rows: The regression's rows.
        own: Weighted columns of the unknowns in each joint's rows, zero where not used, shape
            (n, k, unknowns).
        y: Weighted torques that they explain, shape (k, n).
        ageing: Their change with the age of efforts, shape (k, n), which is one more unknown, the
            last, unless it is zero.
        noise: Weighted standard deviation of the sensors' white noise, shape (n,).
        torque: Norm of the weighted torques; an unknown is not determined if its deviation makes
            more than ``LARGEST_TORQUE`` of them.
    """
    if ageing.any():
        own = np.concatenate([own, ageing.T[:, :, None]], axis=2)
    flat, z = own.reshape(-1, own.shape[2]), y.T.ravel()
    R = np.linalg.qr(np.column_stack([flat, z]), mode="r")
    R, z = R[:-1, :-1], R[:-1, -1]
    lengths = np.linalg.norm(R, axis=0)
    present = lengths > SINGULAR * lengths.max()
    _, singular, axes = np.linalg.svd(R[:, present] / lengths[present], full_matrices=False)
    undetermined = (axes[singular < SINGULAR * singular[0]] ** 2).sum(axis=0) > SINGULAR
    residual = y - (own @ solved(R, z)).T
    deviation = np.sqrt(_variances(rows, own[:, :, present], residual))
    deviation[undetermined | (deviation * lengths[present] > LARGEST_TORQUE * torque)] = np.inf
    values, deviations = np.zeros(len(lengths)), np.full(len(lengths), np.inf)
    values[present], deviations[present] = solved(R[:, present], z), deviation
    # By the white noise of sensors alone.
    H, inverse = _information(own)
    white = np.tensordot(noise**2, H, axes=1) / _independent(rows)
    by_noise = np.sqrt(np.maximum(np.diag(inverse @ white @ inverse), 0.0))
    scatter = deviations > SCATTER_RATIO * by_noise
    return Unbiased(values, deviations, scatter, float(singular[0] / max(singular[-1], 1e-300)))


def _independent(rows: Rows) -> float:
    """Independent values of white noise per row."""
    return rows.samples.independent * (FLAT_NOISE if np.isfinite(rows.samples.band) else 1.0)


def _information(own: Array) -> tuple[Array, Array]:
    """Information of each joint's rows on the unknowns, and the inverse of their sum."""
    H = np.array([part.T @ part for part in own])
    scale = 1.0 / np.sqrt(np.maximum(np.diag(H.sum(axis=0)), 1e-300))
    scales = np.outer(scale, scale)
    return H, scales * np.linalg.pinv(H.sum(axis=0) * scales, rcond=1e-14, hermitian=True)


def _variances(rows: Rows, own: Array, residual: Array) -> Array:
    """Variances of unknowns: one of two estimates each, the second if it is clearly larger.

    One is for residuals that are white within the band, as the noise of efforts is. The other is
    for any residuals: H⁻¹ S H⁻¹ with S the long-run covariance of the weighted scores by a
    flat-top window (Politis, Romano, "Bias-corrected nonparametric spectral estimation", J. Time
    Series Analysis 16(1), 1995). It counts what the model leaves of the motion, but is itself
    uncertain. Scores of all joints at a time are summed, so that their correlation counts, too.
    Both account for the unknowns that each joint's residuals have been fitted by.
    """
    H, inverse = _information(own)
    independent = _independent(rows)
    count = own.any(axis=2).sum(axis=1) * independent - rows.lost_freedoms
    whole = count + rows.lost_freedoms
    grown = whole / np.maximum(count - np.sum(H * inverse, axis=(1, 2)), 1.0)
    white = np.tensordot(grown, H, axes=1) / independent
    scores = np.einsum("jkm,kj->km", own, np.sqrt(grown) * residual)
    S = scores.T @ scores
    for back in range(1, rows.samples.lag + 1):
        cross = scores[back:].T @ scores[:-back]
        S += min(1.0, 2.0 * (1.0 - back / (rows.samples.lag + 1.0))) * (cross + cross.T)
    plain, any_residuals = (np.diag(inverse @ each @ inverse) for each in (white, S))
    return np.where(any_residuals > CHANCE_RATIO * plain, any_residuals, plain)


def added_coefficients(fit: Fit, added: Array) -> tuple[Array, Array]:
    """Coefficients of additional columns of a fit, and their standard deviations.

    Args:
        fit: Its unknowns are all free.
        added: The columns, shape (k, n, m).

    Returns:
        Shapes (m,) and (m,); deviations are inf where the data do not determine a column.
    """
    n, count = added.shape[1:]
    wide = fit.columns.extended(list(np.moveaxis(added, 1, 0)), [np.arange(count)] * n, count)
    R, z = fit.problem.combined(wide, fit.weights)
    size = np.linalg.norm(R, axis=0)
    present = size > 1e-12 * size.max()
    inverse = np.linalg.pinv(R[:, present] / size[present], rcond=1e-14)
    deviation = np.full(len(size), np.inf)
    deviation[present] = np.linalg.norm(inverse, axis=1) / size[present]
    return solved(R, z)[fit.columns.size :], deviation[fit.columns.size :]
