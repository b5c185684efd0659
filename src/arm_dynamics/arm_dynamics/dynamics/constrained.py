# SPDX-License-Identifier: Apache-2.0
"""Numerical constrained dynamics: τ = M a + h + Aᵀλ under A v = 0.

See ``gauss``; λ is what the robot exerts on the constraints: force and moment of the first frame
on the second, in axes of the second.
"""

from collections.abc import Collection

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.arrays import Array, real_array
from arm_dynamics.attributes import sealed
from arm_dynamics.dynamics.gauss import constrained_motion, times, transposed
from arm_dynamics.dynamics.stiction import States, Stiction
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.loops.loop_closure import Closure
from arm_dynamics.terms.evaluator import TermEvaluator
from arm_dynamics.terms.table import CONSTRAINT_ROWS, INVERSE, MASS_MATRIX, WITHOUT_FRICTION

CHUNK = 4096  # points in memory at once


@sealed
class Constrained:
    """Forward and inverse dynamics of a scene under its bilateral constraints.

    Args:
        model: The arm; used from one thread only.
        terms: Its terms.

    Attributes:
        closure: States that obey the constraints.

    Raises:
        SceneError: If the scene has no bilateral constraint, or one that leaves no degree of
            freedom.
    """

    def __init__(self, model: ArmModel, terms: TermEvaluator) -> None:
        self.model, self._terms, self.closure = model, terms, Closure(model, model.stops)
        self._friction = SteadyFriction.of(model)
        self._stiction = Stiction(self._friction)

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
        self,
        q: Array,
        v: Array,
        tau: Array,
        active: Collection[str] | None = None,
        external: Array | float = 0.0,
    ) -> tuple[Array, Array]:
        """Accelerations and multipliers of τ = M a + C v + G + S + F + Aᵀλ under A a + Ȧ v = 0.

        Joints at rest that dry friction holds remain at rest: see ``stiction``.

        Args:
            q: Joint positions in [rad] or [m], shape (n,) or (k, n); the constraints should be
                satisfied.
            v: Joint velocities in [rad/s] or [m/s], likewise.
            tau: Joint torques in [N m] or [N], likewise.
            active: Names of the active constraints; None for the initially active ones.
            external: Torques that act on the links, beside the drives', shape (n,).

        Returns:
            Accelerations, shape of the arguments, and λ in [N] and [N m], shape (m,) or (k, m): of
            least norm where constraints are redundant, zero where they are inactive.

        Raises:
            InvalidInput: If a shape, value or name is not allowed.
        """
        shape, names = q.shape, self.closure.active_names(active)
        q, v, tau = np.atleast_2d(q, v, tau)
        a, lam = self._sliding(q, v, tau, names, external)
        rows = np.flatnonzero(self._stiction.resting(v).any(axis=1))
        if len(rows):
            q, v, tau = q[rows], v[rows], tau[rows]
            M, bias, A, drift = self._equations(q, v, names)
            rank = self._rank(names, q[0])
            states = States(q, v, tau, M, bias - external, A, drift, rank)
            a[rows], lam[np.ix_(rows, np.isin(self.names, names))] = self._stiction.motion(states)
        return a.reshape(shape), lam.reshape(*shape[:-1], self.m)

    def without_sticking(
        self, q: Array, v: Array, tau: Array, active: Collection[str] | None = None
    ) -> tuple[Array, Array]:
        """Accelerations and λ as of ``forward``; ``tau`` includes static friction at rest."""
        shape, names = q.shape, self.closure.active_names(active)
        q, v, tau = np.atleast_2d(q, v, tau)
        a, lam = self._sliding(q, v, tau, names)
        return a.reshape(shape), lam.reshape(*shape[:-1], self.m)

    def inverse(
        self, q: Array, v: Array, a: Array, lam: ArrayLike, external: Array | float = 0.0
    ) -> Array:
        """Torques M a + C v + G + S + F + Aᵀλ for a motion and constraint forces λ.

        Args:
            q: Joint positions in [rad] or [m], shape (n,) or (k, n).
            v: Joint velocities in [rad/s] or [m/s], likewise.
            a: Joint accelerations in [rad/s²] or [m/s²], likewise.
            lam: Multipliers as ``forward`` returns them, shape (m,) or (k, m).
            external: Torques that act on the links, beside the drives', shape (n,).

        Returns:
            Torques in [N m] or [N], shape of ``q``.

        Raises:
            InvalidInput: If a shape or value is not allowed.
        """
        multipliers = real_array("lam", lam)
        if multipliers.shape not in ((self.m,), (*q.shape[:-1], self.m)):
            required = f"({self.m},)" if q.ndim == 1 else f"({self.m},) or ({len(q)}, {self.m})"
            raise InvalidInput(f"lam has shape {multipliers.shape}; {required} is expected")
        if not np.isfinite(multipliers).all():
            raise InvalidInput("lam holds numbers that are not finite")
        rows = self._terms(CONSTRAINT_ROWS, q, 0.0 * q, selection=(self.closure.rows.names,))
        reaction = times(transposed(rows[..., :-1]), multipliers)
        frictionless = self._terms(INVERSE, q, v, a, WITHOUT_FRICTION) + reaction - external
        return np.asarray(self._friction.overcome(frictionless, v, np.sign(v), q))

    def _sliding(
        self, q: Array, v: Array, tau: Array, names: tuple[str, ...], external: Array | float = 0.0
    ) -> tuple[Array, Array]:
        """Accelerations and multipliers of a batch, friction at rest left out."""
        free = tau - self._friction(v, np.sign(v), q, tau) + external
        a, lam = np.empty_like(q), np.zeros((len(q), self.m))
        columns = np.isin(self.names, names)
        for first in range(0, len(q), CHUNK):
            part = slice(first, first + CHUNK)
            M, bias, A, drift = self._equations(q[part], v[part], names)
            rank, forces = self._rank(names, q[first]), free[part] - bias
            a[part], lam[part, columns] = constrained_motion(M, forces, A, drift, rank)
        return a, lam

    def _equations(
        self, q: Array, v: Array, names: tuple[str, ...]
    ) -> tuple[Array, Array, Array, Array]:
        """M, C v + G + S, A and γ."""
        bias = self._terms(INVERSE, q, v, 0.0 * q, WITHOUT_FRICTION)
        rows = self._terms(CONSTRAINT_ROWS, q, v, selection=(names,))
        return self._terms(MASS_MATRIX, q), bias, rows[..., :-1], rows[..., -1]

    def _rank(self, names: tuple[str, ...], near: Array) -> int:
        """Number of independent rows; the initially active constraints are closed at ``q0``."""
        closed = set(names) <= set(self.closure.initially_active)
        return self.closure.rank(names, self.model.q0 if closed else near)
