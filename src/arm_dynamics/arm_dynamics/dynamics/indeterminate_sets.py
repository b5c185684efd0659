# SPDX-License-Identifier: Apache-2.0
"""Statically indeterminate sets of joints at rest: statics does not determine what each holds.

Where bilateral constraints connect held joints, their torques are determined up to self-stresses,
combinations that constraint forces balance. The joints hold while any of these distributions is
within all static levels (the static theorem of limit analysis; Moreau, "Application of convex
analysis to the treatment of elastoplastic systems", Springer Lecture Notes in Mathematics 503,
1976): while the least s by which all levels have to be enlarged is not positive. The dual solution
of that linear program is the motion in which the set gives way. The simulator does the same in C
(``indeterminate.h``), with contacts and stops.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.dynamics.interior_point import quadratic_program

# Singular values, and entries of a projection, that are rounding, relative to the largest.
ROUNDING = 1e-9
# s up to which a set holds: that of the solution is accurate to less.
HOLD_TOLERANCE = 1e-10
# Smallest unit of a torque, relative to the largest in the set.
SMALLEST_UNIT = 1e-3
# Share of a joint in the motion in which its set gives way that is rounding.
LEAST_SHARE = 1e-6


@dataclass(frozen=True)
class IndeterminateSet:
    """Joints that hold, or give way, together.

    Attributes:
        joints: Their indices, shape (k,).
        holds: Whether some distribution of their torques is within all levels.
        direction: Where they do not hold, that in which each begins to move: -1, 0 or 1, (k,).
        multipliers: Where they hold, the change of the multipliers λ that brings their torques
            within the levels, those nearest in units of the levels, shape (m,).
    """

    joints: NDArray[np.intp]
    holds: bool
    direction: Array
    multipliers: Array


def indeterminate_sets(
    A: Array, held: NDArray[np.bool_], reaction: Array, bearing: Array
) -> Iterator[IndeterminateSet]:
    """Statically indeterminate sets of joints, one of which is beyond its level.

    Args:
        A: Rows of the constraints, shape (m, n).
        held: Which joints are held, shape (n,).
        reaction: Their holding torques, one distribution of them, shape (n,).
        bearing: Largest holding torques of friction, forwards and backwards, shape (2, n).
    """
    places = np.flatnonzero(held)
    stress, forces = _self_stresses(A, held)
    for members in _connected_groups(abs(stress @ stress.T) > ROUNDING):
        joints = places[members]
        r, limits = reaction[joints], bearing[:, joints]
        if not ((r > limits[0]) | (-r > limits[1])).any():
            continue
        own, _, combinations = np.linalg.svd(stress[members])
        rank = round(float(np.sum(stress[members] ** 2)))
        change, direction = _distribution(own[:, :rank], r, limits)
        balance = forces @ (combinations[:rank].T @ change)
        yield IndeterminateSet(joints, not direction.any(), direction, -balance)


def _self_stresses(A: Array, held: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Orthonormal self-stresses in columns, and the constraint forces that balance them."""
    U, s, Vt = np.linalg.svd(A[:, ~held].T)
    rank = int(np.sum(s > ROUNDING * s.max(initial=0.0)))
    free = Vt[rank:].T
    U, s, Vt = np.linalg.svd(A[:, held].T @ free, full_matrices=False)
    rank = int(np.sum(s > ROUNDING * abs(A).max(initial=0.0)))
    return U[:, :rank], free @ Vt[:rank].T / s[:rank]


def _connected_groups(is_linked: NDArray[np.bool_]) -> Iterator[NDArray[np.intp]]:
    """Groups of indices that a symmetric relation connects; without those not linked at all."""
    remaining = is_linked.diagonal().copy()
    while remaining.any():
        group = np.zeros_like(remaining)
        group[np.argmax(remaining)] = True
        while (neighbours := is_linked[group].any(axis=0) & ~group).any():
            group |= neighbours
        remaining &= ~group
        yield np.flatnonzero(group)


def _distribution(stress: Array, reaction: Array, limits: Array) -> tuple[Array, Array]:
    """Amounts of self-stresses that bring torques within limits, and the way they give otherwise.

    Args:
        stress: Self-stresses in columns, shape (k, d).
        reaction: Torques without them, shape (k,).
        limits: Largest torques forwards and backwards, shape (2, k).

    Returns:
        Amounts, shape (d,), and directions, all zero where there are such amounts, shape (k,).
    """
    (k, d), sides = stress.shape, np.array([[1.0], [-1.0]])
    unit = np.maximum(limits.max(axis=0), abs(reaction))
    unit = np.maximum(unit, SMALLEST_UNIT * unit.max())
    h = ((limits - sides * reaction) / unit).ravel()
    G = np.vstack([-stress / unit[:, None], stress / unit[:, None]])
    cost, begin = np.eye(d + 1)[-1], np.append(np.zeros(d), 1.0 - h.min())
    P, widened = np.zeros((d + 1, d + 1)), np.hstack([G, np.ones((2 * k, 1))])
    y, z = quadratic_program(P, cost, widened, h, begin)
    excess = float(np.max(-h - G @ y[:d]))
    if excess > HOLD_TOLERANCE:
        share = z.reshape(2, k)
        return np.zeros(d), np.sign(share[0] - share[1]) * (share.max(axis=0) > LEAST_SHARE)
    nearest, _ = quadratic_program(G.T @ G, np.zeros(d), G, h + 2.0 * HOLD_TOLERANCE, y[:d])
    return nearest, np.zeros(k)
