# SPDX-License-Identifier: Apache-2.0
"""Arms whose torques follow from Lagrange's equations, written here without the suite's models.

τ = d/dt ∂T/∂q̇ - ∂T/∂q + ∂U/∂q with T = ½ q̇ᵀ M(q) q̇, and derivatives by complex steps, which are
exact to rounding.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from benchmarks.robots import urdf

STEP = 1e-30
GRAVITY = 9.81
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Link:
    """A link and the joint that moves it; vectors in the frame of the joint."""

    name: str  # of the joint
    origin: Vector  # of the joint's frame in that of the link before, in [m]
    turned: float  # angle in [rad] about x of that frame
    axis: int  # 0, 1 or 2: the joint turns about x, y or z, or slides along it
    slides: bool  # whether it is prismatic
    mass: float  # in [kg]
    com: Vector  # centre of mass in [m]
    # About the centre of mass: xx, xy, xz, yy, yz, zz in [kg m²]
    inertia: tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class LagrangeArm:
    """A chain of links with friction and rotors."""

    links: tuple[Link, ...]  # from the base to the tip
    armature: Array  # in [kg m²] or [kg], shape (n,)
    viscous: Array  # friction in [N m s/rad] or [N s/m], shape (n,)
    coulomb: Array  # in [N m] or [N], shape (n,)

    def torque(self, q: Array, v: Array, a: Array) -> Array:
        """Torques of the drives along a motion, in [N m] or [N], shapes (k, n)."""
        M = self._mass_matrix(q)
        along = self._mass_matrix(q + 1j * STEP * v).imag / STEP
        rigid = _times(M.real, a) + _times(along, v)
        for j in range(len(self.links)):
            aside = q.astype(complex)
            aside[:, j] += 1j * STEP
            bent = self._mass_matrix(aside).imag / STEP
            kinetic = 0.5 * np.einsum("ki,kij,kj->k", v, bent, v)
            rigid[:, j] += self._potential(aside).imag / STEP - kinetic
        own = self.armature * a + self.viscous * v + self.coulomb * np.sign(v)
        return np.asarray(rigid + own)

    def _frames(self, q: NDArray) -> list[tuple[NDArray, NDArray]]:
        """Rotation and origin of each joint's frame in the world, shapes (k, 3, 3), (k, 3)."""
        R, p, frames = np.broadcast_to(np.eye(3), (len(q), 3, 3)), np.zeros((len(q), 3)), []
        for link, x in zip(self.links, q.T, strict=True):
            p = p + R @ np.array(link.origin)
            R = R @ _turn(0, np.array([link.turned]))
            if link.slides:
                p = p + R[:, :, link.axis] * x[:, None]
            else:
                R = R @ _turn(link.axis, x)
            frames.append((R, p))
        return frames

    def _mass_matrix(self, q: NDArray) -> NDArray:
        """M of the links, shape (k, n, n)."""
        n, frames = len(self.links), self._frames(q)
        M = np.zeros((len(q), n, n), q.dtype)
        for i, link in enumerate(self.links):
            R, p = frames[i]
            centre = p + R @ np.array(link.com)
            linear, angular = np.zeros((2, len(q), 3, n), q.dtype)
            for j, before in enumerate(self.links[: i + 1]):
                axis, origin = frames[j][0][:, :, before.axis], frames[j][1]
                if before.slides:
                    linear[:, :, j] = axis
                else:
                    linear[:, :, j], angular[:, :, j] = np.cross(axis, centre - origin), axis
            local = R.transpose(0, 2, 1) @ angular
            M += link.mass * linear.transpose(0, 2, 1) @ linear
            M += local.transpose(0, 2, 1) @ _symmetric(link.inertia) @ local
        return M

    def _potential(self, q: NDArray) -> NDArray:
        """Potential energy in [J], shape (k,)."""
        return sum(
            GRAVITY * link.mass * (p + R @ np.array(link.com))[:, 2]
            for link, (R, p) in zip(self.links, self._frames(q), strict=True)
        )

    @property
    def names(self) -> list[str]:
        return [link.name for link in self.links]

    @property
    def scene(self) -> dict[str, Any]:
        """The scene of the arm with its rotors and friction."""
        columns = (x.tolist() for x in (self.armature, self.viscous, self.coulomb))
        numbers = zip(self.names, *columns, strict=True)
        joints = {
            name: {"armature": armature, "friction": {"viscous": viscous, "coulomb": coulomb}}
            for name, armature, viscous, coulomb in numbers
        }
        return {"robot": {"urdf": self.urdf}, "joints": joints}

    @property
    def urdf(self) -> str:
        """Its description: links, and neither friction nor rotors."""
        parts, before = ['<robot name="arm"><link name="base"/>'], "base"
        for one in self.links:
            name, kind = f"{one.name}_link", "prismatic" if one.slides else "revolute"
            axis, turn = np.eye(3)[one.axis], (one.turned, 0.0, 0.0)
            parts.append(urdf.link(name, one.mass, one.inertia, one.com))
            parts.append(urdf.joint(one.name, kind, before, name, axis, one.origin, turn))
            before = name
        return "".join([*parts, "</robot>"])


def _turn(axis: int, angle: NDArray) -> NDArray:
    """Rotations about an axis of the frame, shape (k, 3, 3)."""
    c, s, (i, j) = np.cos(angle), np.sin(angle), [k for k in range(3) if k != axis]
    R = np.zeros((len(angle), 3, 3), angle.dtype)
    way = -1.0 if axis == 1 else 1.0
    R[:, axis, axis], R[:, i, i], R[:, j, j] = 1.0, c, c
    R[:, i, j], R[:, j, i] = -way * s, way * s
    return R


def _symmetric(six: tuple[float, ...]) -> Array:
    return np.array(six)[[[0, 1, 2], [1, 3, 4], [2, 4, 5]]]


def _times(M: NDArray, x: NDArray) -> NDArray:
    return np.einsum("kij,kj->ki", M, x)
