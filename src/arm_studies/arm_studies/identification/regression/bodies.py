# SPDX-License-Identifier: Apache-2.0
"""The ten inertial parameters of a rigid body, their physical consistency and distance.

With the density of the body, the pseudo-inertia J = ∫ [r; 1][r; 1]ᵀ dm is a symmetric 4 by 4
matrix, linear in the ten parameters. They are physically consistent if and only if J is positive
semidefinite (Wensing, Kim, Slotine, "Linear matrix inequalities for physically consistent inertial
parameter identification", IEEE Robotics and Automation Letters 3(1), 2018).
"""

import numpy as np

from arm_dynamics.arrays import Array

# Smallest eigenvalue of Σ = ∫ r rᵀ dm relative to the largest: a plate has a thickness, which
# rounded numbers of a URDF may make negative.
THIN = 1e-3


def _basis() -> Array:
    basis = np.zeros((10, 4, 4))
    for k, theta in enumerate(np.eye(10)):
        inertia = theta[4:][[[0, 1, 3], [1, 2, 4], [3, 4, 5]]]
        basis[k, :3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
        basis[k, :3, 3] = basis[k, 3, :3] = theta[1:4]
        basis[k, 3, 3] = theta[0]
    return basis


BASIS = _basis()  # J = Σ θ_k BASIS_k.


def pseudo_inertia(theta: Array) -> Array:
    """J of shape (…, 4, 4) from inertial parameters of shape (…, 10)."""
    return np.asarray(np.tensordot(theta, BASIS, axes=1))


def inertial_parameters(J: Array) -> Array:
    """The inertial parameters of a pseudo-inertia of shape (4, 4)."""
    inertia = np.trace(J[:3, :3]) * np.eye(3) - J[:3, :3]
    return np.concatenate([[J[3, 3]], J[:3, 3], inertia[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]])


def consistent(theta: Array, least: float = 0.0) -> bool:
    """Whether the parameters are physically consistent: all eigenvalues of J above ``least``."""
    return bool(np.linalg.eigvalsh(pseudo_inertia(theta)).min() > least)


def nearest(theta: Array) -> Array:
    """The body with the same mass and centre of mass, but no direction thinner than ``THIN``.

    Args:
        theta: Ten inertial parameters with a positive mass.
    """
    mass, first = theta[0], theta[1:4]
    J = pseudo_inertia(theta)
    central = J[:3, :3] - np.outer(first, first) / mass
    values, axes = np.linalg.eigh(central)
    least = max(THIN * values[-1], 1e-10 * mass)
    if values[0] >= least:
        return theta
    J[:3, :3] = (axes * np.maximum(values, least)) @ axes.T + np.outer(first, first) / mass
    return inertial_parameters(J)


def _metric_factor(theta: Array) -> Array:
    """F of the distance ‖F δ‖ of bodies near this one, shape (16, 10).

    F δ are the entries of C⁻¹ δJ C⁻ᵀ / √2, with J = C Cᵀ: the affine-invariant metric ½ tr((J⁻¹
    δJ)²), which depends neither on units nor on the frame (Lee, Wensing, Park, "Geometric robot
    dynamic identification: a convex programming approach", IEEE Trans. Robotics 36(2), 2020). A
    body of 1 + ε times the density is at √2 ε.
    """
    C = np.linalg.cholesky(pseudo_inertia(theta))
    half = np.linalg.solve(C, BASIS)
    scaled = np.linalg.solve(C, np.swapaxes(half, 1, 2))
    return np.asarray(scaled.reshape(len(BASIS), -1).T / np.sqrt(2.0))


def prior_factor(theta: Array, mass: float, shape: float) -> Array:
    """The prior that a body is near this one, as R with Rᵀ R its precision, shape (10, 10).

    Built without the precision, in which the digits of a body without thickness would be lost.

    Args:
        theta: Ten inertial parameters of a body.
        mass: Relative standard deviation of its density.
        shape: Relative standard deviation of all else, as a distance; see ``_metric_factor``.
    """
    F = _metric_factor(theta)
    along = F @ theta
    size = float(np.linalg.norm(along))
    denser = along / size @ F
    across = F - np.outer(along / size, denser)
    return np.linalg.qr(np.vstack([across / shape, denser / (size * mass)]), mode="r")


def log_det_barrier(theta: Array) -> tuple[float, Array, Array]:
    """-log det J, its gradient (10,) and Hessian (10, 10); inf unless J is positive definite."""
    J = pseudo_inertia(theta)
    values = np.linalg.eigvalsh(J)
    if values[0] <= 0.0:
        return np.inf, np.zeros(10), np.zeros((10, 10))
    parts = np.linalg.solve(J, BASIS)
    gradient = -np.trace(parts, axis1=1, axis2=2)
    return -float(np.log(values).sum()), gradient, np.einsum("kab,lba->kl", parts, parts)
