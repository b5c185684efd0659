# SPDX-License-Identifier: Apache-2.0
"""Terms of the equation of motion as expressions, named as those of ``RigidTerms``."""

from __future__ import annotations

import casadi as ca

from arm_dynamics.equations import rigid_body, spring
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.tree_builder import gravity_of, tree_of


class RigidExpressions:
    """Terms of M a + C v + G + S, friction left out; S is what springs and their dampers take.

    Arguments are expressions of shape (n,); those of ``coriolis`` must be symbols.

    Args:
        model: The arm.
    """

    def __init__(self, model: ArmModel) -> None:
        self._tree, self._gravity, self._springs = tree_of(model), gravity_of(model), model.springs

    def frictionless(self, q: ca.SX, v: ca.SX, a: ca.SX) -> ca.SX:
        """M a + C v + G + S in [N m] or [N], shape (n,)."""
        return spring.frictionless(self._springs, self._tree, q, v, a, self._gravity)

    def gravity(self, q: ca.SX) -> ca.SX:
        """G in [N m] or [N], shape (n,)."""
        return rigid_body.gravity_torque(self._tree, q, self._gravity)

    def spring(self, q: ca.SX, v: ca.SX) -> ca.SX:
        """S in [N m] or [N], shape (n,)."""
        return spring.torque(self._springs, self._tree, q, v)

    def standing(self, q: ca.SX) -> ca.SX:
        """G + S of an arm at rest in [N m] or [N], shape (n,)."""
        return self.gravity(q) + self.spring(q, ca.SX(q.shape[0], 1))

    def mass(self, q: ca.SX) -> ca.SX:
        """M in [kg m²] or [kg], shape (n, n)."""
        return rigid_body.mass_matrix(self._tree, q)

    def coriolis(self, q: ca.SX, v: ca.SX) -> ca.SX:
        """C of Christoffel's symbols, shape (n, n)."""
        return rigid_body.coriolis_matrix(self._tree, q, v)
