# SPDX-License-Identifier: Apache-2.0
"""Weighted least squares over all joints: estimates, covariances, physically consistent bodies.

Unknowns are x = (θ, armatures, friction): ten inertial parameters of each body, one inertia of
each joint's drive, and each joint's friction coefficients. This module is linear in x; shapes of
friction that are not linear are in ``fit``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_studies.identification.regression import bodies
from arm_studies.identification.regression.regressor import EACH
from arm_studies.identification.regression.rows import Rows

Mask = NDArray[np.bool_]
NOISELESS = 1e-9  # Residual relative to a joint's torque below which it is rounding.


@dataclass(frozen=True)
class Common:
    """QR factors of the columns of one joint that do not depend on its friction law.

    Attributes:
        use: Rows that are used, shape (k,).
        Q: Orthonormal columns of the rows that are used.
        T: Triangle: Q T are the columns.
    """

    use: Mask
    Q: Array
    T: Array

    @classmethod
    def of(cls, columns: Array, use: Mask) -> Common:
        """Of columns of shape (k, m); a joint does not carry the bodies before it."""
        there = columns.any(axis=0)
        Q, R = np.linalg.qr(columns[use][:, there])
        T = np.zeros((len(R), len(there)))
        T[:, there] = R
        return cls(use, Q, T)


@dataclass(frozen=True)
class Columns:
    """A regression: the columns of each joint, and the unknowns they belong to.

    Attributes:
        common: Of each joint: columns of bodies and of its armature, shape (k, m).
        own: Of each joint: columns of its friction, shape (k, m_j).
        places: Of each joint: indices of all its columns in x.
        size: Number of unknowns.
        reduced: Of each joint: factors of ``common`` in the rows that are used.
    """

    common: tuple[Array, ...]
    own: tuple[Array, ...]
    places: tuple[NDArray[np.int_], ...]
    size: int
    reduced: tuple[Common, ...]

    def predicted(self, x: Array) -> Array:
        """A x of shape (k, n)."""
        found = []
        for common, own, place in zip(self.common, self.own, self.places, strict=True):
            m = common.shape[1]
            found.append(common @ x[place[:m]] + own @ x[place[m:]])
        return np.column_stack(found)

    def own_predicted(self, x: Array) -> Array:
        """The part of it that is the joints' own friction, shape (k, n)."""
        pairs = zip(self.own, self.places, strict=True)
        return np.column_stack(
            [own @ x[place[len(place) - own.shape[1] :]] for own, place in pairs]
        )

    def all_of(self, j: int) -> Array:
        """All columns of a joint."""
        return np.hstack([self.common[j], self.own[j]])

    def whitened(self, y: Array, weights: Array, count: float) -> tuple[Array, Array]:
        """A triangle R and a vector z: ‖R x - z‖² is the weighted sum of squares up to a constant.

        Args:
            y: Shape (k, n).
            weights: Of each joint: 1 over its standard deviation, shape (n,).
            count: Independent values per row.
        """
        triangles = []
        for j, (reduced, place) in enumerate(zip(self.reduced, self.places, strict=True)):
            if not reduced.use.any():
                continue
            rest = np.column_stack([self.own[j], y[:, j]])[reduced.use]
            along = reduced.Q.T @ rest
            across = np.linalg.qr(rest - reduced.Q @ along, mode="r")
            m = reduced.T.shape[1]
            wide = np.zeros((len(along) + len(across), self.size + 1))
            wide[: len(along), place[:m]] = reduced.T
            where = np.append(place[m:], self.size)
            wide[: len(along), where], wide[len(along) :, where] = along, across
            triangles.append(weights[j] * np.sqrt(count) * wide)
        both = np.linalg.qr(np.vstack(triangles), mode="r")
        return both[:, :-1], both[:, -1]


def common_columns(rows: Rows, use: Mask) -> tuple[tuple[Array, ...], tuple[Common, ...]]:
    """Columns of bodies and armature of each joint, and their factors in the used rows."""
    columns = tuple(
        np.hstack([rows.rigid[:, j], rows.inertia[:, j : j + 1]]) for j in range(rows.n)
    )
    return columns, tuple(Common.of(part, use[:, j]) for j, part in enumerate(columns))


def columns_of(
    common: tuple[tuple[Array, ...], tuple[Common, ...]], friction: Sequence[Array]
) -> Columns:
    """All columns: bodies, armatures, then friction, joint by joint.

    Args:
        common: See ``common_columns``.
        friction: Low-pass filtered columns of each joint, shape (k, m_j).
    """
    columns, reduced = common
    n, numbers = len(columns), columns[0].shape[1] - 1
    start, places = numbers + n, []
    for j, own in enumerate(friction):
        mine = np.arange(start, start + own.shape[1])
        places.append(np.concatenate([np.arange(numbers), [numbers + j], mine]))
        start += own.shape[1]
    return Columns(columns, tuple(friction), tuple(places), start, reduced)


def deviations(y: Array, predicted: Array, use: Mask) -> Array:
    """Standard deviation of each joint's residual, above rounding, shape (n,)."""
    found = np.ones(y.shape[1])
    for j in range(y.shape[1]):
        rows = use[:, j]
        if rows.any():
            size = float(np.sqrt(np.mean(y[rows, j] ** 2)))
            left = float(np.sqrt(np.mean((y - predicted)[rows, j] ** 2)))
            found[j] = max(left, NOISELESS * size, 1e-300)
    return found


@dataclass(frozen=True)
class Belief:
    """The prior of x: its mean x0, and rows S of its precision SᵀS.

    Attributes:
        x0: Shape (size,).
        rows: Shape (m, size).
    """

    x0: Array
    rows: Array

    def combined(self, R: Array, z: Array) -> tuple[Array, Array]:
        """The triangle and vector of data and prior together."""
        A = np.vstack([R, self.rows])
        b = np.concatenate([z, self.rows @ self.x0])
        both = np.linalg.qr(np.column_stack([A, b]), mode="r")
        size = R.shape[1]
        return both[:size, :-1], both[:size, -1]


def belief_of(nominal: Array, size: int, mass: float, shape: float) -> Belief:
    """The prior that bodies are near the nominal ones; see ``bodies.prior``.

    Bodies that a URDF makes too thin get the smallest possible thickness, since a thin body of
    lower density would not be physically consistent. Bodies without mass are fixed. The other
    unknowns, ``size`` in all, have a weak prior at zero, so that undetermined ones become zero.
    """
    x0 = np.zeros(size)
    x0[: len(nominal)] = nominal
    rows = []
    for i in range(0, len(nominal), EACH):
        part = np.zeros((EACH, size))
        if nominal[i] > 1e-9:
            body = bodies.nearest(nominal[i : i + EACH])
            x0[i : i + EACH] = body
            part[:, i : i + EACH] = bodies.prior(body, mass, shape)
        else:
            part[:, i : i + EACH] = 1e9 * np.eye(EACH)
        rows.append(part)
    return Belief(x0, np.vstack(rows))


def solved(R: Array, z: Array, rcond: float = 1e-14) -> Array:
    """The x that minimizes ‖R x - z‖, of minimum norm where R does not determine it."""
    scale = np.linalg.norm(R, axis=0)
    scale[scale == 0.0] = 1.0
    return np.asarray(np.linalg.lstsq(R / scale, z, rcond=rcond)[0] / scale)


def made_possible(
    R: Array, z: Array, start: Array, nominal: Array, positive: Sequence[int]
) -> Array:
    """The x that minimizes ‖R x - z‖² with consistent bodies and nonnegative coefficients.

    Newton's method on the whitened problem with -log det of each body's pseudo-inertia and -log of
    each coefficient as barriers (Boyd, Vandenberghe, Convex Optimization, 2004, section 11.3): the
    problem is convex, so the result is the global minimum up to the duality gap.

    Args:
        R: Triangle of data and prior, of full rank.
        z: Its right-hand side.
        start: A feasible x.
        nominal: Ten inertial parameters of each body; bodies without mass are fixed.
        positive: Indices of coefficients that must not be negative.
    """
    x = start.copy()
    movable = [i for i in range(0, len(nominal), EACH) if nominal[i] > 1e-9]
    barriers = 4 * len(movable) + len(positive)
    cost = max(float(np.sum((R @ x - z) ** 2)), 1.0)
    sharpness = barriers / cost
    while barriers / sharpness > 1e-6:
        x = _centred(R, z, x, movable, positive, sharpness)
        sharpness *= 20.0
    return x


def _centred(
    R: Array, z: Array, x: Array, movable: list[int], positive: Sequence[int], sharpness: float
) -> Array:  # fmt: skip
    def value(x: Array) -> float:
        if any(x[i] <= 0.0 for i in positive):
            return np.inf
        total = sharpness * float(np.sum((R @ x - z) ** 2))
        total += sum(bodies.log_det(x[i : i + EACH])[0] for i in movable)
        return total - float(np.log(x[list(positive)]).sum())

    def derivatives(x: Array) -> tuple[Array, Array]:
        gradient = 2.0 * sharpness * (R.T @ (R @ x - z))
        hessian = 2.0 * sharpness * (R.T @ R)
        for i in movable:
            _, slope, bend = bodies.log_det(x[i : i + EACH])
            gradient[i : i + EACH] += slope
            hessian[i : i + EACH, i : i + EACH] += bend
        for i in positive:
            gradient[i] -= 1.0 / x[i]
            hessian[i, i] += 1.0 / x[i] ** 2
        return gradient, hessian

    return _newton(value, derivatives, x)


def _newton(
    value: Callable[[Array], float], derivatives: Callable[[Array], tuple[Array, Array]], x: Array
) -> Array:
    """Minimize a convex function by Newton's method with backtracking (Armijo's rule)."""
    now = value(x)
    for _ in range(60):
        gradient, hessian = derivatives(x)
        size = np.sqrt(np.diag(hessian))
        size[size == 0.0] = 1.0  # nothing determines it, and its gradient is zero
        small = hessian / np.outer(size, size) + 1e-14 * np.eye(len(x))
        step = -np.linalg.solve(small, gradient / size) / size
        fall = -float(gradient @ step)
        if fall < 1e-8:
            break
        length, after = 1.0, value(x + step)
        while length > 1e-12 and not after < now - 1e-4 * length * fall:
            length *= 0.5
            after = value(x + length * step)
        if length <= 1e-12:
            break
        x, now = x + length * step, after
    return x
