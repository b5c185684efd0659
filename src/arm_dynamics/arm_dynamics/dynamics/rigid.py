# SPDX-License-Identifier: Apache-2.0
"""Terms of the equation of motion without friction, for single points and batches."""

from __future__ import annotations

from functools import partial

import numpy as np

from arm_dynamics.arrays import Array, each
from arm_dynamics.dynamics import compiled_terms as terms
from arm_dynamics.dynamics.compiled_backend import compiled
from arm_dynamics.dynamics.compiled_terms import Answer, BatchTerm
from arm_dynamics.equations.forward_dynamics import DENSE_AT_MOST
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.pinocchio_terms import RigidTerms

# Rows from which a batch is worth compiling code.
MANY = 256


class RigidDynamics:
    """Terms for vectors of shape (n,) or batches (k, n) that have been validated already.

    Pinocchio computes them point by point; from ``MANY`` points, compiled code does, which is
    built on first use where possible.

    Args:
        model: The arm; used from one thread only.
    """

    def __init__(self, model: ArmModel) -> None:
        self._points = RigidTerms(model)
        self._springs, self._gravity = model.springs, np.array(model.scene.gravity)
        self._built: dict[BatchTerm, Answer | None] = {}

    def inverse(self, q: Array, v: Array, a: Array, gravity: Array) -> Array:
        """M a + C v + G in [N m] or [N], shape (…, n); ``gravity``: the scene's, or zeros."""
        return self._answer(terms.INVERSE, q, v, a, gravity)

    def frictionless(self, q: Array, v: Array, a: Array) -> Array:
        """M a + C v + G + S in [N m] or [N], shape (…, n)."""
        return self.inverse(q, v, a, self._gravity) + self.spring(q, v)

    def forward(self, q: Array, v: Array, tau: Array) -> Array:
        """M⁻¹ (tau - C v - G) in [rad/s²] or [m/s²], shape (…, n).

        Raises:
            ModelError: If a joint moves no mass.
            InvalidInput: If the result overflows.
        """
        a = self._answer(terms.FORWARD, q, v, tau)
        lost = ~np.isfinite(a).all(axis=-1)
        if lost.any():
            a[lost] = each(self._points.forward, q[lost], v[lost], tau[lost])  # names the joint
        return a

    def mass_matrix(self, q: Array) -> Array:
        """M in [kg m²] or [kg], armature included, shape (…, n, n)."""
        return self._answer(terms.MASS_MATRIX, q)

    def coriolis_matrix(self, q: Array, v: Array) -> Array:
        """C, with dM/dt - 2 C skew-symmetric, shape (…, n, n)."""
        if self._points.robot.n > DENSE_AT_MOST:  # an expression of the size of n³
            return each(self._points.coriolis, q, v)
        return self._answer(terms.CORIOLIS_MATRIX, q, v)

    def gravity(self, q: Array) -> Array:
        """G in [N m] or [N], shape (…, n)."""
        return self._answer(terms.GRAVITY, q)

    def spring(self, q: Array, v: Array) -> Array:
        """Torques S of springs and their dampers in [N m] or [N], shape (…, n)."""
        return self._answer(terms.SPRING, q, v) if self._springs else np.zeros_like(q)

    def energies(self, q: Array, v: Array) -> Array:
        """Kinetic energy, armature included, and potential energy in [J], shape (…, 2).

        The potential energy is that of gravity and springs.
        """
        return self._answer(terms.ENERGIES, q, v)

    def of_frame(self, what: str, frame: str) -> Answer:
        """One of ``OF_FRAMES`` of a frame, as a function of valid vectors.

        Raises:
            InvalidInput: If there is no such frame.
        """
        self._points.motion(frame)
        return partial(self._answer, terms.OF_FRAMES[what](frame))

    def constraint_rows(self, q: Array, v: Array, names: tuple[str, ...]) -> Array:
        """A and γ = Ȧ v of bilateral constraints side by side, shape (…, m, n + 1)."""
        return self._answer(terms.constraint_rows(names), q, v)

    def _answer(self, term: BatchTerm, *given: Array) -> Array:
        answer = None
        if given[0].ndim == 2 and len(given[0]) >= MANY:
            if term not in self._built:
                self._built[term] = compiled(term, self._points)
            answer = self._built[term]
        if answer is None:
            return each(partial(term.point, self._points), *given)
        return answer(*given)
