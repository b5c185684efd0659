# SPDX-License-Identifier: Apache-2.0
"""Constrained dynamics as numbers: τ = M a + h + Aᵀλ under A v = 0.

Gauss' principle: the acceleration is the one nearest to the free one, in the metric of M, that
obeys A a + γ = 0; λ is of least norm where rows depend on one another (Udwadia, Kalaba, Analytical
Dynamics, 1996, chapter 3). λ is what the robot exerts against the constraints: force and moment of
the first frame upon the second, in axes of the second.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.arrays import Array, each, real_array
from arm_dynamics.dynamics.rigid import RigidDynamics
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.loop_closure import RANK, Closure, cholesky
from arm_dynamics.model.pinocchio_terms import FrameMotion
from arm_dynamics.scene.constraint import ORIGIN, Touching

AT_ONCE = 4096  # points: what is in memory at once


class Constrained:
    """Forward and inverse dynamics of a scene under its bilateral constraints.

    Args:
        model: The arm; used from one thread only.
        rigid: Its dynamics without friction and constraints.

    Attributes:
        closure: States that obey the constraints.

    Raises:
        SceneError: If the scene has no bilateral constraint, or one that leaves nothing to move.
    """

    def __init__(self, model: ArmModel, rigid: RigidDynamics) -> None:
        self.model, self._rigid, self._friction = model, rigid, SteadyFriction.of(model)
        self.closure = Closure(self.model, self.model.stops)

    @property
    def m(self) -> int:
        """Number of multipliers."""
        return sum(self.closure.rows.counts)

    @property
    def names(self) -> tuple[str, ...]:
        """Name of the constraint that each multiplier belongs to."""
        rows = self.closure.rows
        return tuple(np.repeat(rows.names, rows.counts).tolist())

    def forward(
        self, q: Array, v: Array, tau: Array, active: Collection[str] | None = None
    ) -> tuple[Array, Array]:
        """Accelerations and multipliers of τ = M a + C v + G + S + F + Aᵀλ under A a + Ȧ v = 0.

        Args:
            q: Joint positions in [rad] or [m], shape (n,) or (k, n); the constraints should hold.
            v: Joint velocities in [rad/s] or [m/s], likewise.
            tau: Joint torques in [N m] or [N], likewise.
            active: Names of the constraints that hold; None for those that do at the start.

        Returns:
            Accelerations, shape of the arguments, and λ in [N] and [N m], shape (m,) or (k, m): of
            least norm where constraints depend on one another, zero where they do not hold.

        Raises:
            InvalidInput: If a shape, value or name is not allowed.
        """
        if q.ndim == 1:
            a, lam = self.forward(q[None], v[None], tau[None], active)
            return a[0], lam[0]
        names = self.closure.chosen(active)
        free = tau - self._friction(v, np.sign(v), q, tau)
        parts = [
            self._solved(q[part], v[part], free[part], names)
            for part in (slice(k, k + AT_ONCE) for k in range(0, len(q), AT_ONCE))
        ]
        accelerations, multipliers = zip(*parts, strict=True)
        return np.concatenate(accelerations), np.concatenate(multipliers)

    def inverse(self, q: Array, v: Array, a: Array, lam: ArrayLike) -> Array:
        """Torques M a + C v + G + S + F + Aᵀλ for a motion and forces λ against the constraints.

        Args:
            q: Joint positions in [rad] or [m], shape (n,) or (k, n).
            v: Joint velocities in [rad/s] or [m/s], likewise.
            a: Joint accelerations in [rad/s²] or [m/s²], likewise.
            lam: Multipliers as ``forward`` gives them, shape (m,) or (k, m).

        Returns:
            Torques in [N m] or [N], shape of ``q``.

        Raises:
            InvalidInput: If a shape or value is not allowed.
        """
        multipliers = self._checked("lam", lam, self.m, q)
        rows = self._rigid.constraint_rows(q, np.zeros_like(q), self.closure.rows.names)
        reaction = _times(_transposed(rows[..., :-1]), multipliers)
        needed = self._rigid.frictionless(q, v, a) + reaction
        tau: Array = self._friction.demanded(needed, v, np.sign(v), q)
        return tau

    def _solved(
        self, q: Array, v: Array, free: Array, active: tuple[str, ...]
    ) -> tuple[Array, Array]:
        """Accelerations and multipliers of a batch; see the singular values of ``Factors``."""
        still, rigid = np.zeros_like(q), self._rigid
        rows, C = rigid.constraint_rows(q, v, active), cholesky(rigid.mass_matrix(q))
        forces = free - rigid.frictionless(q, v, still)
        U, s, Vt = np.linalg.svd(_transposed(np.linalg.solve(C, _transposed(rows[..., :-1]))),
                                 full_matrices=False)  # fmt: skip
        counted = (s > RANK * s[:, :1]) & (np.arange(s.shape[1]) < self._rank(active, q[0]))
        inverted = np.divide(1.0, s, out=np.zeros_like(s), where=counted)
        x = np.linalg.solve(C, forces[..., None])[..., 0]
        required = inverted * _times(_transposed(U), -rows[..., -1])
        lacking = required - counted * _times(Vt, x)
        multipliers = np.zeros((len(q), self.m))
        multipliers[:, np.isin(self.names, active)] = -_times(U, lacking * inverted)
        a = np.linalg.solve(_transposed(C), (x + _times(_transposed(Vt), lacking))[..., None])
        return a[..., 0], multipliers

    def _rank(self, active: tuple[str, ...], near: Array) -> int:
        """Independent rows; those that hold at the start are closed at the initial position."""
        closed = set(active) <= set(self.closure.initially_active)
        return self.closure.rank(active, self.model.q0 if closed else near)

    def _checked(self, name: str, value: ArrayLike, size: int, like: Array) -> Array:
        array = real_array(name, value)
        if array.shape not in ((size,), (*like.shape[:-1], size)):
            required = f"({size},)" if like.ndim == 1 else f"({size},) or ({len(like)}, {size})"
            raise InvalidInput(f"{name} has shape {array.shape}; {required} is expected")
        if not np.isfinite(array).all():
            raise InvalidInput(f"{name} holds numbers that are not finite")
        return np.broadcast_to(array, (*like.shape[:-1], size))


def contact_torque(
    model: ArmModel, q: Array, wrench: ArrayLike, frame: str | None = None
) -> Array:
    """Torques with which an arm pushes: Jᵀ f, which is Aᵀλ where f is what a constraint bears.

    Args:
        model: The arm.
        q: Joint positions in [rad] or [m], shape (n,) or (k, n).
        wrench: Force in [N], shape (3,), or force and moment in [N m], shape (6,), that the arm
            exerts upon the world, in the world's axes; or a row for each of k.
        frame: Frame at whose origin; None for the one place where the scene lets the arm touch
            the world.

    Returns:
        Joint torques in [N m] or [N], shape of ``q``, to be added to those of the motion.

    Raises:
        InvalidInput: If a shape, value or name is not allowed, or ``frame`` is expected.
    """
    name, point, offset = _contact_place(model, frame)
    f = np.asarray(wrench, dtype=float)
    if f.shape[-1:] not in ((3,), (6,)) or f.ndim > q.ndim or not np.isfinite(f).all():
        raise InvalidInput(
            f"wrench = {wrench!r}: 3 finite numbers, a force, or 6, force and moment, are expected"
        )
    motion = FrameMotion(model, name, "local_world_aligned")

    def push(qi: Array, fi: Array) -> Array:
        J = motion.jacobian(qi)
        r = motion.placement(qi)[1] @ point + offset
        J = np.vstack([J[:3] - pin.skew(r) @ J[3:], J[3:]])
        torque: Array = J[: len(fi)].T @ fi
        return torque

    return each(push, q, np.broadcast_to(f, (*q.shape[:-1], f.shape[-1])))


def _contact_place(model: ArmModel, frame: str | None) -> Touching:
    """What of the arm touches."""
    if frame is not None:
        return Touching(frame, ORIGIN)
    touching = [c.at_world for c in model.scene.constraints if c.at_world is not None]
    if len(touching) != 1:
        raise InvalidInput(
            f"frame is expected: the scene has {len(touching)} places that touch the world; "
            f"allowed: {known_names(model.frame_names)}"
        )
    return touching[0]


def _transposed(matrices: Array) -> Array:
    return np.swapaxes(matrices, -1, -2)


def _times(matrices: Array, vectors: Array) -> Array:
    product: Array = (matrices @ vectors[..., None])[..., 0]
    return product
