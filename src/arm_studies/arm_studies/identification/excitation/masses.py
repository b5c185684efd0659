# SPDX-License-Identifier: Apache-2.0
"""Uncertainty of the masses of an arm after a motion, as an expression.

The determinant over all parameters gains as much from reducing a small variance tenfold as from
reducing a large one. To identify masses, the sum of their variances is minimized instead
(A-optimality for some of the parameters: Atkinson, Donev, Optimum Experimental Designs, 1992,
sections 10.3 and 10.4). The link whose weight is the smallest part of its joint's torque dominates
it, since noise and unmodelled effects grow with the torque.
"""

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.equations.tree import regrouped
from arm_dynamics.model import ArmModel
from arm_dynamics.model.tree_builder import tree_of
from arm_studies.identification.excitation.columns import friction_columns, of_bodies

# Noise of torques relative to their root mean square, white at this many samples per second.
NOISE, RATE = 0.05, 1000.0
_FLOOR = 0.01  # fraction of a joint's typical torque below which noise does not fall
_DENSITY = 0.1  # prior standard deviation of a density, relative
_TOTAL = 1e-4  # prior standard deviation of the total mass, relative: it is weighed
_FREE = 1e-3  # prior precision of armature and friction, in SI units


@one_at_a_time
def densities(model: ArmModel, transition: Array) -> ca.Function:
    """Columns of friction, and of the torques of nominal bodies by their densities.

    Args:
        model: The arm.
        transition: Speed over which the column of Coulomb friction changes its sign, shape (n,).

    Returns:
        A function of q, v and a whose result has shape (n, 3 n + bodies): armature, viscous and
        Coulomb friction of each joint, and of each body 1 for its nominal density.
    """
    q, v, a = (ca.SX.sym(name, model.n) for name in "qva")
    links = list(tree_of(model, regroup=False).links)
    density = ca.SX.sym("density", len(links))
    for i, link in enumerate(links):
        link.m, link.h, link.I = density[i] * link.m, density[i] * link.h, density[i] * link.I
    regrouped(links)
    columns = [*friction_columns(v, a, transition), of_bodies(model, links, density, (q, v, a))]
    return ca.Function("densities", [q, v, a], [ca.densify(ca.horzcat(*columns))], {"cse": True})


def spread(
    model: ArmModel, transition: Array, motion: list[ca.MX], period: float, typical: Array
) -> ca.MX:
    """Relative standard deviations of masses after one period; shape (bodies,).

    Torques have ``NOISE``, the total mass is known, bodies have their nominal shapes.

    Args:
        model: The arm.
        transition: See ``densities``.
        motion: q, v and a at even times, each of shape (n, instants).
        period: In [s].
        typical: Typical torques of the joints, shape (n,).
    """
    count, n = motion[0].shape[1], model.n
    W = densities(model, transition)
    size = W.size2_out(0)
    bodies = size - 3 * n
    own = model.armature, model.viscous, model.friction.coulomb.mean, np.ones(bodies)
    nominal = ca.DM(np.concatenate(own))
    table = W.map(count)(*motion)
    H = ca.MX(_prior(model, size - bodies))
    for j in range(n):
        A = ca.reshape(table[j, :], size, count)
        power = ca.sumsqr(A.T @ nominal) / count + (_FLOOR * typical[j]) ** 2
        H += A @ A.T * (RATE * period / count / NOISE**2) / power
    return _deviations(size, bodies)(H)


def _prior(model: ArmModel, of_drives: int) -> Array:
    """Precision of the prior of parameters of drives, and of densities; shape (size, size)."""
    masses = np.array([inertia.mass for inertia in list(model.pin.inertias)[1:]])
    part = masses / masses.sum()
    of_densities = np.eye(len(masses)) / _DENSITY**2 + np.outer(part, part) / _TOTAL**2
    size = of_drives + len(masses)
    information = _FREE * np.eye(size)
    information[of_drives:, of_drives:] = of_densities
    return information


@one_at_a_time
def _deviations(size: int, last: int) -> ca.Function:
    """Standard deviations of the last parameters from the information matrix.

    By its Cholesky factor R: the last block of H⁻¹ is that of R⁻¹ R⁻ᵀ, and R is a triangle.
    """
    H = ca.SX.sym("H", size, size)
    inverse = ca.inv(ca.chol(H)[-last:, -last:])
    return ca.Function("deviations", [H], [ca.sqrt(ca.sum2(inverse**2))])
