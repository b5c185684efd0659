# SPDX-License-Identifier: Apache-2.0
"""Constrained motion in the metric of M, for constraint rows of any rank.

Gauss' principle: of all accelerations that obey A a = b, nature takes the one that is nearest to
the free one in the metric of M (Udwadia, Kalaba, Analytical Dynamics, 1996). With M = LᵀDL and
x = D^½ L a that metric is the identity and the rows are vectors y = D^-½ L^-ᵀ Aᵀ. These are made
orthogonal one after another (modified Gram-Schmidt; Björck, Numerical Methods for Least Squares
Problems, 1996, section 2.4). A row that depends on those before it leaves nothing but rounding and
is left out. A M⁻¹ Aᵀ, whose condition is that of the rows squared, is never formed.
"""

from __future__ import annotations

import casadi as ca

from arm_dynamics.laws.rigid_body import eliminated, factored, substituted

# A row of which less than this part is new counts as dependent; see docs/constraints.md.
DEPENDENT = 1e-5
# Entries of A under this, in m or 1, are rounding.
NOTHING = 1e-12
_TINY = 1e-200


class Metric:
    """Coordinates x in which M is the identity.

    Args:
        M: Joint-space inertia in [kg m²] or [kg], shape (n, n).
    """

    def __init__(self, M: ca.SX) -> None:
        self._factors = factored(M)
        self._root = 1 / ca.sqrt(ca.diag(self._factors))
        self.mobility = ca.sumsqr(self._root)

    def of_forces(self, forces: ca.SX) -> ca.SX:
        """D^-½ L^-ᵀ f for columns of generalised forces, shape (n, k)."""
        return ca.sparsify(ca.diag(self._root) @ eliminated(self._factors, forces))

    def motion(self, x: ca.SX) -> ca.SX:
        """Acceleration, velocity or displacement L⁻¹ D^-½ x, shape (n,)."""
        return substituted(self._factors, self._root * x)


class Held:
    """Orthogonal directions that constraint rows take from the motion.

    Args:
        metric: Of the robot at its position.
        A: Rows, shape (m, n).
    """

    def __init__(self, metric: Metric, A: ca.SX) -> None:
        Y = metric.of_forces(A.T)
        self._metric, self._rows = metric, [Y[:, k] for k in range(A.shape[0])]
        sizes = [ca.sumsqr(y) for y in self._rows]
        largest = ca.SX(0)
        for size in sizes:
            largest = ca.fmax(largest, size)
        threshold = DEPENDENT**2 * largest + NOTHING**2 * metric.mobility + _TINY
        self._overlap: list[list[ca.SX]] = []
        self._weights: list[ca.SX] = []
        for k in range(len(self._rows)):
            self._orthogonalise(k, threshold)

    def nearest(self, x: ca.SX, b: ca.SX) -> ca.SX:
        """The vector nearest to ``x`` that obeys the first rows: y_k·x = b_k, shape (n,)."""
        found, wanted = x, []
        for k in range(b.shape[0]):
            w = b[k] - sum((r * wanted[j] for j, r in enumerate(self._overlap[k])), ca.SX(0))
            wanted.append(w)
            found = found + self._rows[k] * (self._weights[k] * (w - ca.dot(self._rows[k], found)))
        return found

    def _orthogonalise(self, k: int, threshold: ca.SX) -> None:
        y, overlap = self._rows[k], []
        for j in range(k):
            r = self._weights[j] * ca.dot(self._rows[j], y)
            y = y - r * self._rows[j]
            overlap.append(r)
        size = ca.sumsqr(y)
        # 0 below the threshold, 1 above twice it; no branches, so that vectors of arms can run it.
        gate = ca.fmin(1, ca.fmax(0, (size - threshold) / threshold))
        self._rows[k] = y
        self._overlap.append(overlap)
        self._weights.append(gate / ca.fmax(size, threshold))


def acceleration(M: ca.SX, force: ca.SX, A: ca.SX, drift: ca.SX) -> ca.SX:
    """Acceleration a of M a + Aᵀλ = force under A a + drift = 0.

    Args:
        M: Joint-space inertia in [kg m²] or [kg], shape (n, n).
        force: Torques that act: command less Coriolis, gravity and friction, shape (n,).
        A: Constraint rows, shape (m, n); dependent ones are allowed.
        drift: Ȧ v, shape (m,).

    Returns:
        Accelerations, shape (n,).
    """
    metric = Metric(M)
    return metric.motion(Held(metric, A).nearest(metric.of_forces(force), -drift))
