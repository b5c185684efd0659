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
    n, arm = model.nv, ExtendedArm(model)
    return lambda x: np.concatenate([x[n:], arm.free(x[:n], x[n:])])


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

    def free(self, q: Vector, v: Vector) -> Vector:
        """Joint accelerations without torque [rad/s²]; every argument has shape (n,)."""
        x, bias, force = self._outward(q, v)
        inertia, joints = list(self.inertias), list(zip(self.parents, self.axes, strict=True))
        for i, (parent, k) in reversed(list(enumerate(joints))):
            if parent >= 0:
                u = inertia[i][:, k]
                articulated = inertia[i] - np.outer(u, u / u[k])
                load = force[i] + articulated @ bias[i] - u * (force[i][k] / u[k])
                inertia[parent] = inertia[parent] + x[i].T @ articulated @ x[i]
                force[parent] = force[parent] + x[i].T @ load
        acceleration: Each = []
        out = np.zeros_like(q)
        for i, (parent, k) in enumerate(joints):
            a = x[i] @ (acceleration[parent] if parent >= 0 else self.base) + bias[i]
            u = inertia[i][:, k]
            out[i] = -(force[i][k] + u @ a) / u[k]
            a[k] += out[i]
            acceleration.append(a)
        return out

    def _outward(self, q: Vector, v: Vector) -> tuple[Each, Each, Each]:
        """Transforms from each parent, velocity-dependent accelerations and forces."""
        x: Each = []
        velocity: Each = []
        bias: Each = []
        force: Each = []
        for i, (parent, k) in enumerate(zip(self.parents, self.axes, strict=True)):
            x.append(_transform(self.rotations[i], self.shifts[i], k, q[i]))
            spin = v[i] * np.eye(6, dtype=REAL)[k]
            velocity.append(spin + (x[i] @ velocity[parent] if parent >= 0 else 0))
            cross = _cross(velocity[i])
            bias.append(cross @ spin)
            force.append(-cross.T @ (self.inertias[i] @ velocity[i]))
        return x, bias, force


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


def _cross(m: Vector) -> Vector:
    """What a motion vector ``m`` crosses others with; of forces, minus its transpose."""
    out = np.zeros((6, 6), REAL)
    out[:3, :3] = out[3:, 3:] = _skew(m[:3])
    out[3:, :3] = _skew(m[3:])
    return out


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
