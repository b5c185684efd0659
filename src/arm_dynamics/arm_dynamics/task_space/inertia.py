# SPDX-License-Identifier: Apache-2.0
"""Matrices of the task space, such as Λ = (J M⁻¹ Jᵀ)⁻¹, regularized near singularities."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.equations.elementary import Quantity, diagonal, larger

# Scaled mobility in the least mobile direction below which a task is treated as singular
THRESHOLD = 1e-4


class Inertia(NamedTuple):
    """Inverse of the mobility A = J M⁻¹ Jᵀ.

    Attributes:
        matrix: Λ, shape (…, m, m).
        damped: Whether damping was applied, shape (…).
        least: Scaled mobility in the least mobile direction, dimensionless, shape (…).
    """

    matrix: Array
    damped: NDArray[np.bool_]
    least: Array


def task_inertia(A: Array, linear: int, threshold: float = THRESHOLD) -> Inertia:
    """Invert the mobility of a task: Λ = A⁻¹, or (A + δ S²)⁻¹ near a singularity.

    A has mixed units, so it is scaled first: S is diagonal with one scale for the linear and one
    for the angular axes, the root of their mean mobility. With σ the least eigenvalue of the
    scaled matrix, δ = ε (1 - σ/ε)² where σ < ε and zero elsewhere, which is continuous and leaves
    regular states untouched (Nakamura and Hanafusa, "Inverse kinematic solutions with singularity
    robustness", ASME J. Dyn. Sys. Meas. Control 108, 1986, equation (21), applied to the inertia).

    Args:
        A: Mobility J M⁻¹ Jᵀ, symmetric and not negative, shape (…, m, m).
        linear: Number of linear axes; they come first.
        threshold: ε, dimensionless.

    Returns:
        The inertia.
    """
    scale = scales(A, linear)
    values, vectors = np.linalg.eigh(A / (scale[..., :, None] * scale[..., None, :]))
    least = np.maximum(values[..., 0], 0.0)
    lack = np.maximum(1.0 - least / threshold, 0.0)
    regular = np.maximum(values, 0.0) + (threshold * lack * lack)[..., None]
    axes = vectors / scale[..., :, None]
    matrix = (axes / regular[..., None, :]) @ np.swapaxes(axes, -1, -2)
    return Inertia(matrix, least < threshold, least)


def axis_masses(A: Quantity, inertia: Quantity) -> Quantity:
    """Mass of every axis for tuning gains, bounded at singularities, shape (m,).

    The mass with the other axes held, Λ_ii, is infinite at a singularity that is not along an
    axis; it is therefore limited to ten times the mass with the others free, 1 / A_ii, and to the
    damped inertia.

    Args:
        A: Mobility J M⁻¹ Jᵀ, an array or expression of shape (m, m).
        inertia: Λ of shape (m, m).
    """
    mass = diagonal(inertia)
    return mass / larger(0.1 * mass * diagonal(A), 1.0)


def scales(A: Array, linear: int) -> Array:
    """The diagonal of S in ``task_inertia``, shape (…, m)."""
    diagonal = np.maximum(A.diagonal(0, -2, -1), 0.0)
    scale = np.empty_like(diagonal)
    for rows in (slice(0, linear), slice(linear, None)):
        part = diagonal[..., rows]
        scale[..., rows] = np.sqrt(part.sum(-1, keepdims=True) / max(part.shape[-1], 1))
    scale[scale < 1e-9] = 1.0  # no motion along these axes, at any scale
    return scale


def manipulability(J: Array) -> Array:
    """Volume of the velocity ellipsoid √det(J Jᵀ), zero at a singularity, shape (…).

    Source: Yoshikawa, "Manipulability of robotic mechanisms", IJRR 4(2), 1985.
    """
    m, n = J.shape[-2:]
    if m > n:
        return np.zeros(J.shape[:-2])
    return np.asarray(np.prod(np.linalg.svd(J, compute_uv=False), axis=-1))


def condition_number(J: Array) -> Array:
    """Ratio of the largest to the smallest singular value, inf at a singularity, shape (…).

    Args:
        J: Jacobian of shape (…, m, n); with linear and angular axes the number has mixed units.
    """
    values = np.linalg.svd(J, compute_uv=False)
    least = values[..., -1] if J.shape[-2] <= J.shape[-1] else np.zeros(J.shape[:-2])
    floor = 1e-15 * np.maximum(values[..., 0], 1e-300)
    ratio = values[..., 0] / np.maximum(least, floor)
    return np.where(least <= floor, np.inf, ratio)


def quaternions(rotation: Array) -> Array:
    """Unit quaternions x, y, z, w with w not negative, shape (…, 4).

    Args:
        rotation: Rotation matrices, shape (…, 3, 3).
    """
    rows = [pin.Quaternion(R).coeffs() for R in rotation.reshape(-1, 3, 3)]
    coefficients = np.reshape(rows, (*rotation.shape[:-2], 4))
    return np.where(coefficients[..., 3:] < 0.0, -coefficients, coefficients)


def pseudo_inverse(J: Array) -> Array:
    """J⁺ = Jᵀ (J Jᵀ)⁻¹ of a Jacobian of full row rank, shape (n, m)."""
    return np.asarray(np.linalg.solve(J @ J.T, J).T)
