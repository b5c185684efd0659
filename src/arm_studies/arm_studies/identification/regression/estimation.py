# SPDX-License-Identifier: Apache-2.0
"""Weighted least squares over all joints: estimates, covariances, physically consistent bodies.

Unknowns are x = (θ, armatures, friction): ten inertial parameters of each body, one inertia of
each joint's drive, and each joint's friction coefficients. This module is linear in x; shapes of
friction that are not linear are in ``fit``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_studies.identification.regression import bodies
from arm_studies.identification.regression.regressor import MASSLESS_BELOW, PER_BODY
from arm_studies.identification.regression.rows.rows import Rows

Mask = NDArray[np.bool_]
Places = NDArray[np.int_]
NOISELESS = 1e-9  # Residual relative to a joint's torque below which it is rounding.


@dataclass(frozen=True)
class Common:
    """Columns of one joint that do not depend on its friction law: of bodies and its armature.

    Attributes:
        columns: Shape (k, m).
        use: Rows that are used, shape (k,).
        Q: Orthonormal columns of the rows that are used, shape (used rows, r).
        T: Triangle: Q T are the columns in these rows, shape (r, m).
    """

    columns: Array
    use: Mask
    Q: Array
    T: Array

    @classmethod
    def of(cls, rows: Rows, use: Mask, j: int) -> Common:
        """Columns of joint ``j``, which does not carry the bodies before it."""
        columns = np.hstack([rows.rigid[:, j], rows.inertia[:, j : j + 1]])
        carried = columns.any(axis=0)
        Q, R = np.linalg.qr(columns[use[:, j]][:, carried])
        T = np.zeros((len(R), len(carried)))
        T[:, carried] = R
        return cls(columns, use[:, j], Q, T)


@dataclass(frozen=True)
class Columns:
    """A regression: the columns of each joint, and the unknowns they belong to.

    Attributes:
        common: Of each joint: columns of bodies and of its armature.
        friction: Of each joint: low-pass filtered columns of its friction, shape (k, m_j).
        places: Of each joint: indices of all its columns in x.
        size: Number of unknowns.
    """

    common: tuple[Common, ...]
    friction: tuple[Array, ...]
    places: tuple[Places, ...]
    size: int

    @classmethod
    def of(cls, common: Sequence[Common], friction: Sequence[Array]) -> Columns:
        """Columns of bodies, armatures, then friction, joint by joint."""
        numbers = common[0].columns.shape[1] - 1
        start, places = numbers + len(common), []
        for j, columns in enumerate(friction):
            of_friction = np.arange(start, start + columns.shape[1])
            places.append(np.concatenate([np.arange(numbers), [numbers + j], of_friction]))
            start += columns.shape[1]
        return cls(tuple(common), tuple(friction), tuple(places), start)

    def extended(self, added: Sequence[Array], places: Sequence[Places], count: int) -> Columns:
        """With more unknowns.

        Args:
            added: Their columns in each joint's rows.
            places: Of each joint: which of the unknowns its columns belong to.
            count: Their number.
        """
        friction = [np.column_stack(pair) for pair in zip(self.friction, added, strict=True)]
        wide = [np.append(a, self.size + b) for a, b in zip(self.places, places, strict=True)]
        return Columns(self.common, tuple(friction), tuple(wide), self.size + count)

    def predicted(self, x: Array) -> Array:
        """A x of shape (k, n)."""
        torques = []
        for common, own, place in zip(self.common, self.friction, self.places, strict=True):
            m = common.columns.shape[1]
            torques.append(common.columns @ x[place[:m]] + own @ x[place[m:]])
        return np.column_stack(torques)

    def predicted_friction(self, x: Array) -> Array:
        """The part of ``predicted`` that is friction, shape (k, n)."""
        pairs = zip(self.friction, self.places, strict=True)
        return np.column_stack(
            [own @ x[place[len(place) - own.shape[1] :]] for own, place in pairs]
        )

    def all_of(self, j: int) -> Array:
        """All columns of a joint, shape (k, m)."""
        return np.hstack([self.common[j].columns, self.friction[j]])

    def whitened(self, y: Array, weights: Array, count: float) -> tuple[Array, Array]:
        """A triangle R and a vector z: ‖R x - z‖² is the weighted sum of squares up to a constant.

        Args:
            y: Shape (k, n).
            weights: Of each joint: 1 over its standard deviation, shape (n,).
            count: Independent values per row.
        """
        triangles = []
        for j, (common, place) in enumerate(zip(self.common, self.places, strict=True)):
            if not common.use.any():
                continue
            own = np.column_stack([self.friction[j], y[:, j]])[common.use]
            along = common.Q.T @ own
            across = np.linalg.qr(own - common.Q @ along, mode="r")
            m = common.T.shape[1]
            wide = np.zeros((len(along) + len(across), self.size + 1))
            wide[: len(along), place[:m]] = common.T
            rest = np.append(place[m:], self.size)
            wide[: len(along), rest], wide[len(along) :, rest] = along, across
            triangles.append(weights[j] * np.sqrt(count) * wide)
        triangle = np.linalg.qr(np.vstack(triangles), mode="r")
        return triangle[:, :-1], triangle[:, -1]


def deviations(y: Array, predicted: Array, use: Mask) -> Array:
    """Standard deviation of each joint's residual, above rounding, shape (n,)."""
    noise = np.ones(y.shape[1])
    for j in range(y.shape[1]):
        rows = use[:, j]
        if rows.any():
            size = float(np.sqrt(np.mean(y[rows, j] ** 2)))
            residual = float(np.sqrt(np.mean((y - predicted)[rows, j] ** 2)))
            noise[j] = max(residual, NOISELESS * size, 1e-300)
    return noise


@dataclass(frozen=True)
class Prior:
    """What is believed of the bodies before: their mean x0, and rows S of its precision SᵀS.

    Nothing is believed of the other unknowns, which come after them in x.

    Attributes:
        x0: Shape (numbers,).
        rows: Shape (m, numbers).
    """

    x0: Array
    rows: Array

    @classmethod
    def near(
        cls, nominal: Array, mass: float, shape: float,
        known_masses: Sequence[tuple[Sequence[int], float]] = (),
    ) -> Prior:  # fmt: skip
        """Bodies are near the nominal ones; see ``bodies.prior_factor`` for their deviations.

        Bodies that a URDF makes too thin get the smallest possible thickness, since a thin body of
        lower density would not be physically consistent. Bodies without mass are fixed.

        Args:
            nominal: Ten inertial parameters of each body.
            mass: Relative standard deviation of densities.
            shape: Relative standard deviation of all else.
            known_masses: Places of masses in x, and their sum in [kg], which is exact.
        """
        x0, rows = nominal.copy(), np.zeros((len(nominal), len(nominal)))
        for i in range(0, len(nominal), PER_BODY):
            body = slice(i, i + PER_BODY)
            if nominal[i] > MASSLESS_BELOW:
                x0[body] = bodies.nearest(nominal[body])
                rows[body, body] = bodies.prior_factor(x0[body], mass, shape)
            else:
                rows[body, body] = 1e9 * np.eye(PER_BODY)
        for places, total in known_masses:
            row = np.zeros((1, len(x0)))
            row[0, list(places)] = 1e5 / total
            rows = np.vstack([rows, row])
            factor = total / x0[list(places)].sum()
            for place in places:  # the nominal bodies, of another density
                x0[place : place + PER_BODY] *= factor
        return cls(x0, rows)

    def combined(self, R: Array, z: Array) -> tuple[Array, Array]:
        """The triangle and vector of data and prior together."""
        size = R.shape[1]
        A = np.vstack([R, np.pad(self.rows, ((0, 0), (0, size - len(self.x0))))])
        b = np.concatenate([z, self.rows @ self.x0])
        triangle = np.linalg.qr(np.column_stack([A, b]), mode="r")
        return triangle[:size, :-1], triangle[:size, -1]


@dataclass(frozen=True)
class Problem:
    """What is to be fitted.

    Attributes:
        rows: The regression's rows.
        use: Rows that are used, shape (k, n).
        prior: Of the bodies.
        scales: Torque per effort of the rows, shape (n,).
    """

    rows: Rows
    use: Mask
    prior: Prior
    scales: Array | float = 1.0

    @cached_property
    def target(self) -> Array:
        """Efforts without known torques, shape (k, n)."""
        return np.asarray(self.rows.effort * self.scales - self.rows.known_torques)

    @cached_property
    def common(self) -> tuple[Common, ...]:
        """Columns of bodies and armature of each joint."""
        return tuple(Common.of(self.rows, self.use, j) for j in range(self.rows.samples.n))

    def data(self, columns: Columns, weights: Array) -> tuple[Array, Array]:
        """The triangle and vector of all rows that are used; see ``Columns.whitened``."""
        return columns.whitened(self.target, weights, self.rows.samples.independent)

    def combined(self, columns: Columns, weights: Array) -> tuple[Array, Array]:
        """The triangle and vector of the rows and the prior together."""
        return self.prior.combined(*self.data(columns, weights))


def places_of_bodies(nominal: Array) -> list[slice]:
    """Places of the bodies that have a mass."""
    bodies = np.flatnonzero(nominal[::PER_BODY] > MASSLESS_BELOW).tolist()
    return [slice(PER_BODY * body, PER_BODY * (body + 1)) for body in bodies]


def solved(R: Array, z: Array, rcond: float = 1e-14) -> Array:
    """The x that minimizes ‖R x - z‖, of minimum norm where R does not determine it."""
    scale = np.linalg.norm(R, axis=0)
    scale[scale == 0.0] = 1.0
    return np.asarray(np.linalg.lstsq(R / scale, z, rcond=rcond)[0] / scale)


def consistent_solution(
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
    movable = places_of_bodies(nominal)
    barriers = 4 * len(movable) + len(positive)
    cost = max(float(np.sum((R @ x - z) ** 2)), 1.0)
    sharpness = barriers / cost
    while barriers / sharpness > 1e-6:
        x = _centred(R, z, x, movable, positive, sharpness)
        sharpness *= 20.0
    return x


def _centred(
    R: Array, z: Array, x: Array, movable: list[slice], positive: Sequence[int], sharpness: float
) -> Array:  # fmt: skip
    """Minimize the sum with barriers by Newton's method with backtracking (Armijo's rule)."""
    places = np.array(positive, int)

    def value(x: Array) -> float:
        if (x[places] <= 0.0).any():
            return np.inf
        total = sharpness * float(np.sum((R @ x - z) ** 2))
        total += sum(bodies.log_det_barrier(x[body])[0] for body in movable)
        return total - float(np.log(x[places]).sum())

    now = value(x)
    for _ in range(60):
        gradient = 2.0 * sharpness * (R.T @ (R @ x - z))
        hessian = 2.0 * sharpness * (R.T @ R)
        for body in movable:
            _, slope, bend = bodies.log_det_barrier(x[body])
            gradient[body] += slope
            hessian[body, body] += bend
        gradient[places] -= 1.0 / x[places]
        hessian[places, places] += 1.0 / x[places] ** 2
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
