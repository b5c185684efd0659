# SPDX-License-Identifier: Apache-2.0
"""Terms of the equation of motion as expressions, named as those of ``RigidTerms``."""

from dataclasses import replace

import casadi as ca

from arm_dynamics.codegen.kernel import operations
from arm_dynamics.equations import constraint, frame, rigid_body, spring
from arm_dynamics.equations.forward_dynamics import algorithms
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.constraint_rows import ConstraintRows
from arm_dynamics.model.tree_builder import frame_of, gravity_of, linkage_of, tree_of


class RigidExpressions:
    """Terms of M a + C v + G + S, friction left out; S is what springs and their dampers take.

    Arguments are expressions of shape (n,); those by which a term is differentiated must be
    symbols. Results have the shapes of those of ``RigidTerms``.
    """

    def __init__(self, model: ArmModel) -> None:
        self._model, self._tree, self._gravity = model, tree_of(model), gravity_of(model)

    def inverse(self, q: ca.SX, v: ca.SX, a: ca.SX, weight: ca.SX | float = 1.0) -> ca.SX:
        """M a + C v + G in [N m] or [N], gravity times ``weight``."""
        return rigid_body.inverse_dynamics(self._tree, q, v, a, weight * self._gravity)

    def frictionless(self, q: ca.SX, v: ca.SX, a: ca.SX) -> ca.SX:
        """M a + C v + G + S in [N m] or [N]."""
        return spring.frictionless(self._model.springs, self._tree, q, v, a, self._gravity)

    def forward(self, q: ca.SX, v: ca.SX, tau: ca.SX) -> ca.SX:
        """M⁻¹ (tau - C v - G) in [rad/s²] or [m/s²], by the algorithm with fewest operations."""
        x, w, u = state = [ca.SX.sym(name, self._model.n) for name in ("q", "v", "tau")]
        candidates = [
            ca.Function("a", state, [law(self._tree, x, w, u, self._gravity)], {"cse": True})
            for _, law in algorithms(self._tree, self._model.n)
        ]
        return min(candidates, key=operations)(q, v, tau)

    def gravity(self, q: ca.SX) -> ca.SX:
        """G in [N m] or [N]."""
        return rigid_body.gravity_torque(self._tree, q, self._gravity)

    def spring(self, q: ca.SX, v: ca.SX) -> ca.SX:
        """S in [N m] or [N]."""
        return spring.torque(self._model.springs, self._tree, q, v)

    def standing(self, q: ca.SX) -> ca.SX:
        """G + S of an arm at rest in [N m] or [N]."""
        return self.gravity(q) + self.spring(q, ca.SX(q.shape[0], 1))

    def mass(self, q: ca.SX) -> ca.SX:
        """M in [kg m²] or [kg]."""
        return rigid_body.mass_matrix(self._tree, q)

    def coriolis(self, q: ca.SX, v: ca.SX) -> ca.SX:
        """C of Christoffel's symbols."""
        return rigid_body.coriolis_matrix(self._tree, q, v)

    def energies(self, q: ca.SX, v: ca.SX) -> ca.SX:
        """Kinetic energy, armature included, and potential energy of gravity and springs."""
        still, none = ca.SX(q.shape[0], 1), ca.SX(3, 1)
        # M v, without forming M
        momentum = rigid_body.inverse_dynamics(self._tree, q, still, v, none)
        whole = tree_of(self._model, regroup=False)
        potential = rigid_body.potential_energy(whole, q, self._gravity)
        potential += spring.energy(self._model.springs, whole, q)
        return ca.vertcat(ca.dot(v, momentum) / 2, potential)

    def constraint_rows(self, q: ca.SX, v: ca.SX, names: tuple[str, ...]) -> ca.SX:
        """A and γ = Ȧ v of the named bilateral constraints side by side."""
        numeric = ConstraintRows(self._model)
        listed = zip(numeric.names, numeric.places, numeric.counts, strict=True)
        every = {place: range(count) for name, place, count in listed if name in names}
        linkage = linkage_of(self._model, every)
        alone = [replace(linkage, constraints={i: linkage.constraints[i]}) for i in every]
        rows = [constraint.rows(one, self._tree, q, v, lambda _: 1.0) for one in alone]
        A = ca.vertcat(ca.SX(0, self._model.n), *(row.jacobian for row in rows))
        return ca.horzcat(A, ca.vertcat(ca.SX(0, 1), *(row.drift for row in rows)))

    def pose(self, q: ca.SX, name: str) -> ca.SX:
        """Homogeneous transformation from a frame's axes to the world's."""
        p, R = frame.placement(self._tree, frame_of(self._model, name), q)
        return ca.vertcat(ca.horzcat(R, p), ca.SX([[0.0, 0.0, 0.0, 1.0]]))

    def jacobian(self, q: ca.SX, name: str) -> ca.SX:
        """J of a frame in world axes at its origin, linear rows first."""
        return frame.jacobian(self._tree, frame_of(self._model, name), q)

    def jacobian_derivative(self, q: ca.SX, v: ca.SX, name: str) -> ca.SX:
        """J̇ of the same J."""
        return frame.derivative(self.jacobian(q, name), q, v)
