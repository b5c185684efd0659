# SPDX-License-Identifier: Apache-2.0
"""Forward dynamics in extended precision, written apart from everything that is measured.

Featherstone, Rigid Body Dynamics Algorithms (2008), table 7.1, in 6-D matrices of
``numpy.longdouble`` (64-bit mantissa on x86). Spatial vectors are [angular; linear].
"""

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from benchmarks.robots.urdf import AXES

REAL = np.longdouble
Vector = np.ndarray
Each = list[Vector]  # one for each link


def torque_free(model: pin.Model) -> Callable[[Vector], Vector]:
    """The right-hand side x' = f(x), x = (q, v) of shape (2n,), with no torque on any joint."""
    n = model.nv
    arm = ExtendedArm(model)
    zero = np.zeros(n, REAL)

    def rhs(x: Vector) -> Vector:
        return np.concatenate([x[n:], arm.forward(x[:n], x[n:], zero)])

    return rhs


class ExtendedArm:
    """A fixed-base tree of revolute joints about coordinate axes."""

    def __init__(self, model: pin.Model) -> None:
        """Read placements, axes and inertias from a Pinocchio model."""
        joints = range(1, model.njoints)
        self.parents = [model.parents[i] - 1 for i in joints]
        self.axes = [AXES[model.joints[i].shortname()[-2:]].index(1) for i in joints]
        self.rotations = [_orthonormal(model.jointPlacements[i].rotation) for i in joints]
        self.shifts = [_shift(model.jointPlacements[i].translation) for i in joints]
        self.inertias = [_spatial_inertia(model.inertias[i]) for i in joints]
        self.base = np.concatenate([np.zeros(3), -model.gravity.linear]).astype(REAL)

    def forward(self, q: Vector, v: Vector, tau: Vector) -> Vector:
        """Joint accelerations [rad/s²]; every argument has shape (n,)."""
        n = len(self.parents)
        x, bias, inertia, force = self._outward(q, v)
        u: dict[int, Vector] = {}
        d: dict[int, REAL] = {}
        rest: dict[int, REAL] = {}
        for i in reversed(range(n)):
            k = self.axes[i]
            u[i] = inertia[i][:, k].copy()
            d[i] = u[i][k]
            rest[i] = tau[i] - force[i][k]
            parent = self.parents[i]
            if parent >= 0:
                articulated = inertia[i] - np.outer(u[i], u[i] / d[i])
                load = force[i] + articulated @ bias[i] + u[i] * (rest[i] / d[i])
                inertia[parent] = inertia[parent] + x[i].T @ articulated @ x[i]
                force[parent] = force[parent] + x[i].T @ load
        return self._accelerations(x, bias, u, d, rest)

    def _outward(self, q: Vector, v: Vector) -> tuple[Each, Each, Each, Each]:
        x: Each = []
        vel: Each = []
        bias: Each = []
        force: Each = []
        for i, parent in enumerate(self.parents):
            k = self.axes[i]
            x.append(_transform(self.rotations[i], self.shifts[i], k, q[i]))
            carried = x[i] @ vel[parent] if parent >= 0 else np.zeros(6, REAL)
            here = carried.copy()
            here[k] += v[i]
            vel.append(here)
            bias.append(_cross_axis(here, k) * v[i])
            force.append(_cross_force(here, self.inertias[i] @ here))
        return x, bias, list(self.inertias), force

    def _accelerations(
        self, x: Each, bias: Each, u: dict[int, Vector], d: dict[int, REAL], rest: dict[int, REAL]
    ) -> Vector:
        acc: Each = []
        out = np.zeros(len(x), REAL)
        for i, parent in enumerate(self.parents):
            a = x[i] @ (acc[parent] if parent >= 0 else self.base) + bias[i]
            out[i] = (rest[i] - u[i] @ a) / d[i]
            a[self.axes[i]] += out[i]
            acc.append(a)
        return out


def _transform(rotation: Vector, shift: Vector, axis: int, angle: REAL) -> Vector:
    turn = np.eye(3, dtype=REAL)
    a, b = (axis + 1) % 3, (axis + 2) % 3
    turn[a, a] = turn[b, b] = np.cos(angle)
    turn[a, b] = np.sin(angle)
    turn[b, a] = -turn[a, b]
    e = turn @ rotation.T
    x = np.zeros((6, 6), REAL)
    x[:3, :3] = x[3:, 3:] = e
    x[3:, :3] = -e @ shift
    return x


def _cross_axis(m: Vector, k: int) -> Vector:
    """The motion vector ``m`` crossed with the unit rotation about axis ``k``."""
    a, b = (k + 1) % 3, (k + 2) % 3
    out = np.zeros(6, REAL)
    out[a], out[b] = m[b], -m[a]
    out[3 + a], out[3 + b] = m[3 + b], -m[3 + a]
    return out


def _cross_force(m: Vector, f: Vector) -> Vector:
    w, s = _skew(m[:3]), _skew(m[3:])
    return np.concatenate([w @ f[:3] + s @ f[3:], w @ f[3:]])


def _skew(p: Vector) -> Vector:
    zero = REAL(0)
    return np.array([[zero, -p[2], p[1]], [p[2], zero, -p[0]], [-p[1], p[0], zero]])


def _shift(translation: Vector) -> Vector:
    return _skew(np.where(np.abs(translation) < 1e-12, 0.0, translation).astype(REAL))


def _orthonormal(rotation: Vector) -> Vector:
    """The rotation without its last-digit dirt: exact zeros and ones, then one polar step."""
    r = rotation.astype(REAL)
    near = np.round(r)
    r = np.where(np.abs(r - near) < 1e-12, near, r)
    return r @ (3 * np.eye(3, dtype=REAL) - r.T @ r) / 2


def _spatial_inertia(inertia: pin.Inertia) -> Vector:
    mass, c = REAL(inertia.mass), _skew(inertia.lever.astype(REAL))
    out = np.zeros((6, 6), REAL)
    out[:3, :3] = inertia.inertia.astype(REAL) + mass * c @ c.T
    out[:3, 3:], out[3:, :3] = mass * c, mass * c.T
    out[3:, 3:] = mass * np.eye(3, dtype=REAL)
    return out
