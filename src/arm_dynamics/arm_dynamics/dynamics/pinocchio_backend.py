# SPDX-License-Identifier: Apache-2.0
"""Terms of the equation of motion without friction, from Pinocchio, one point after another."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
import pinocchio as pin

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import ArmError, InvalidInput, ModelError
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.constraint_rows import ConstraintRows
from arm_dynamics.model.pinocchio_terms import RigidTerms


class Pointwise:
    """Answers for vectors of shape (n,) or batches (k, n) that were checked already.

    Source of the algorithms: Featherstone, Rigid Body Dynamics Algorithms, 2008, as implemented by
    Pinocchio.

    Args:
        model: The arm; used from one thread only.
    """

    def __init__(self, model: ArmModel) -> None:
        self.model = model
        self._terms, self._weightless = RigidTerms(model), RigidTerms(model, weightless=True)
        self._pin = model.pin
        self._driveless = self._pin.copy()
        self._driveless.armature = np.zeros(self._pin.nv)
        self._data = self._pin.createData()

    def inverse(self, q: Array, v: Array, a: Array, gravity: Array) -> Array:
        """M a + C v + G in [N m] or [N], shape (…, n); ``gravity``: the scene's, or zeros."""
        terms = self._terms if gravity.any() else self._weightless
        return _each(terms.inverse, q, v, a)

    def forward(self, q: Array, v: Array, tau: Array) -> Array:
        """M⁻¹ (tau - C v - G) in [rad/s²] or [m/s²], shape (…, n).

        Raises:
            ModelError: If a joint moves no mass.
            InvalidInput: If the answer overflows.
        """
        return _each(self._projected if self.model.has_followers else self._tree, q, v, tau)

    def mass_matrix(self, q: Array) -> Array:
        """M in [kg m²] or [kg], armature included, shape (…, n, n)."""
        return _each(self._terms.mass, q)

    def coriolis_matrix(self, q: Array, v: Array) -> Array:
        """C, with dM/dt - 2 C skew-symmetric, shape (…, n, n)."""
        return _each(self._terms.coriolis, q, v)

    def gravity(self, q: Array) -> Array:
        """G in [N m] or [N], shape (…, n)."""
        return _each(self._terms.gravity, q)

    def energies(self, q: Array, v: Array) -> Array:
        """Kinetic energy, with that of the armature, and potential energy in [J], shape (…, 2)."""
        return _each(self._energies, self.model.configuration(q), self.model.spread(v))

    def constraint_rows(self, q: Array, v: Array, names: tuple[str, ...]) -> Array:
        """A and γ = Ȧ v of bilateral constraints side by side, shape (…, m, n + 1).

        Args:
            q: Joint positions, shape (n,) or (k, n).
            v: Joint velocities, likewise.
            names: Which constraints.
        """
        return _each(lambda qi, vi: self._stacked(qi, vi, names), q, v)

    @cached_property
    def _constraints(self) -> ConstraintRows:
        return ConstraintRows(self.model)

    def _stacked(self, q: Array, v: Array, names: tuple[str, ...]) -> Array:
        row = self._constraints.stacked(q, v, names)
        return np.column_stack([row.jacobian, row.drift])

    def _tree(self, q: Array, v: Array, tau: Array) -> Array:
        full = self.model.configuration(q), self.model.spread(v)
        a: Array = pin.aba(self._pin, self._data, *full, tau, pin.Convention.WORLD)
        if not np.isfinite(a).all():
            raise self._unsolvable(q)
        return a.copy()

    def _projected(self, q: Array, v: Array, tau: Array) -> Array:
        try:
            return np.linalg.solve(self._terms.mass(q), tau - self._terms.bias(q, v))
        except np.linalg.LinAlgError:
            raise self._unsolvable(q) from None

    def _unsolvable(self, q: Array) -> ArmError:
        inertia = np.diag(self._terms.mass(q))
        if inertia.min() > 0.0:
            return InvalidInput("the acceleration overflows: velocities or torques are too large")
        return ModelError(
            f"joint '{self.model.joint_names[int(np.argmin(inertia))]}' moves no mass, so no "
            "torque determines its acceleration; give a link inertia, the joint an armature, or "
            "lock it"
        )

    def _energies(self, q: Array, v: Array) -> Array:
        # Pinocchio 4.1 forgets the armature of joints whose axis is not a coordinate axis.
        drives = 0.5 * np.sum(self._pin.armature * v**2)
        kinetic = pin.computeKineticEnergy(self._driveless, self._data, q, v) + drives
        return np.array([kinetic, pin.computePotentialEnergy(self._pin, self._data, q)])


def _each(law: Callable[..., Array], *vectors: Array) -> Array:
    if vectors[0].ndim == 1:
        return np.array(law(*vectors))
    return np.array([law(*row) for row in zip(*vectors, strict=True)])
