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

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array

# Singular values, and entries of a projection, that are rounding, relative to the largest.
NOTHING = 1e-9
# s up to which a set holds: that of the solution is accurate to less.
HOLDS = 1e-10
# Smallest unit of a torque, relative to the largest in the set.
SMALL_PART = 1e-3
# Share of a joint in the motion in which its set gives way that is rounding.
LEAST_SHARE = 1e-6
# Interior points: most steps, distance from the solution, part of the way to the edge.
STEPS, GAP, TO_THE_EDGE = 80, 1e-13, 0.99
# Pivot of the normal equations that is kept from being rounding, relative to the diagonal.
REGULAR = 1e-14


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
    A: Array, held: NDArray[np.bool_], reaction: Array, bears: Array
) -> Iterator[IndeterminateSet]:
    """Statically indeterminate sets of joints, one of which is beyond its level.

    Args:
        A: Rows of the constraints, shape (m, n).
        held: Which joints are held, shape (n,).
        reaction: Their holding torques, one distribution of them, shape (n,).
        bears: Largest holding torques of friction, forwards and backwards, shape (2, n).
    """
    places = np.flatnonzero(held)
    stress, forces = _self_stresses(A, held)
    for members in _connected(abs(stress @ stress.T) > NOTHING):
        joints = places[members]
        r, limits = reaction[joints], bears[:, joints]
        if not ((r > limits[0]) | (-r > limits[1])).any():
            continue
        own, _, amounts = np.linalg.svd(stress[members])
        rank = round(float(np.sum(stress[members] ** 2)))
        change, direction = _settled(own[:, :rank], r, limits)
        balance = forces @ (amounts[:rank].T @ change)
        yield IndeterminateSet(joints, not direction.any(), direction, -balance)


def _self_stresses(A: Array, held: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Orthonormal self-stresses in columns, and the constraint forces that balance them."""
    U, s, Vt = np.linalg.svd(A[:, ~held].T)
    rank = int(np.sum(s > NOTHING * s.max(initial=0.0)))
    free = Vt[rank:].T
    U, s, Vt = np.linalg.svd(A[:, held].T @ free, full_matrices=False)
    rank = int(np.sum(s > NOTHING * abs(A).max(initial=0.0)))
    return U[:, :rank], free @ Vt[:rank].T / s[:rank]


def _connected(linked: NDArray[np.bool_]) -> Iterator[NDArray[np.intp]]:
    """Groups of indices that a symmetric relation connects; without those not linked at all."""
    left = linked.diagonal().copy()
    while left.any():
        group = np.zeros_like(left)
        group[np.argmax(left)] = True
        while (more := linked[group].any(axis=0) & ~group).any():
            group |= more
        left &= ~group
        yield np.flatnonzero(group)


def _settled(stress: Array, reaction: Array, limits: Array) -> tuple[Array, Array]:
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
    unit = np.maximum(unit, SMALL_PART * unit.max())
    h = ((limits - sides * reaction) / unit).ravel()
    G = np.vstack([-stress / unit[:, None], stress / unit[:, None]])
    cost, begin = np.eye(d + 1)[-1], np.append(np.zeros(d), 1.0 - h.min())
    y, z = _least(np.zeros((d + 1, d + 1)), cost, np.hstack([G, np.ones((2 * k, 1))]), h, begin)
    excess = float(np.max(-h - G @ y[:d]))
    if excess > HOLDS:
        share = z.reshape(2, k)
        return np.zeros(d), np.sign(share[0] - share[1]) * (share.max(axis=0) > LEAST_SHARE)
    nearest, _ = _least(G.T @ G, np.zeros(d), G, h + 2.0 * HOLDS, y[:d])
    return nearest, np.zeros(k)


def _least(P: Array, c: Array, G: Array, h: Array, y: Array) -> tuple[Array, Array]:
    """Least ½ yᵀP y + cᵀy with h + G y ≥ 0, from a y inside, and the multipliers.

    Mehrotra, "On the implementation of a primal-dual interior point method", SIAM J. Optim. 2,
    1992; all iterates are inside.
    """
    z, count = np.full(len(h), 1.0 / len(h)), len(h)
    for _ in range(STEPS):
        s, left = h + G @ y, G.T @ z - P @ y - c
        gap = float(s @ z)
        if not (s > 0.0).all() or (gap <= GAP and abs(left).max() <= NOTHING):
            break
        K = P + G.T @ (G * (z / s)[:, None])
        K = K + REGULAR * np.diag(np.diag(K))
        change = -s * z
        for target in (0.0, None):
            dy = np.linalg.solve(K, left + G.T @ (change / s))
            ds = G @ dy
            dz = (change - z * ds) / s
            room = np.concatenate([-s[ds < 0.0] / ds[ds < 0.0], -z[dz < 0.0] / dz[dz < 0.0]])
            length = float(room.min(initial=np.inf))
            if target is not None:
                centre = (1.0 - min(1.0, length)) ** 3 * gap / count
                change = centre - s * z - ds * dz
        step = min(1.0, TO_THE_EDGE * length)
        y, z = y + step * dy, z + step * dz
    return y, z
