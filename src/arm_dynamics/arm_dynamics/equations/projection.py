# SPDX-License-Identifier: Apache-2.0
"""Motion under constraints in the metric of M, also through singular positions.

Gauss' principle: of all accelerations with A a = b, the actual one is nearest to the unconstrained
one in the metric of M (Udwadia, Kalaba, Analytical Dynamics, 1996). With M = LᵀDL and x = D^½ L a
that metric is the identity and the rows are vectors y = D^-½ L^-ᵀ Aᵀ. These are orthogonalized one
after another (modified Gram-Schmidt; Björck, Numerical Methods for Least Squares Problems, 1996,
section 2.4). A row that depends on those before it leaves only rounding and is dropped. A M⁻¹ Aᵀ,
whose condition number is that of the rows squared, is never formed.
"""

import casadi as ca

from arm_dynamics.equations.factorizations import ltdl

# Below this fraction of the largest row, the new component of a row is rounding.
DEPENDENT = 1e-9
# Entries of A below this, in m or 1, are rounding.
ROUNDING = 1e-13
# Below this fraction the robot passes a singular position, where rounding rotates the directions
# of possible motion: there, a row's effect on accelerations fades out, and velocities are kept.
SINGULAR = 1e-5
_TINY = 1e-200  # so that rows that are all zero divide by no zero
SHARP = 1e9  # slope of a gate over the relative excess above its threshold


class Metric:
    """Coordinates x in which M is the identity.

    Args:
        M: Joint-space inertia in [kg m²] or [kg], shape (n, n).
    """

    def __init__(self, M: ca.SX) -> None:
        self._factors = ltdl.factorize(M)
        self._root = 1 / ca.sqrt(ca.diag(self._factors))
        self.mobility = ca.sumsqr(self._root)

    def of_forces(self, forces: ca.SX) -> ca.SX:
        """D^-½ L^-ᵀ f for columns of generalized forces, shape (n, k)."""
        return ca.sparsify(ca.diag(self._root) @ ltdl.solve_upper(self._factors, forces))

    def motion(self, x: ca.SX) -> ca.SX:
        """Acceleration, velocity or displacement L⁻¹ D^-½ x, shape (n,)."""
        return ltdl.solve_lower(self._factors, self._root * x)


class Projector:
    """Orthogonal directions in which constraint rows prevent motion.

    Args:
        metric: Metric of the robot at its position.
        A: Rows, shape (m, n).
        least: Rows whose new component is below this fraction of the largest are dropped.
    """

    def __init__(self, metric: Metric, A: ca.SX, least: float = DEPENDENT) -> None:
        Y = metric.of_forces(A.T)
        self._metric, self._rows = metric, [Y[:, k] for k in range(A.shape[0])]
        sizes = [ca.sumsqr(y) for y in self._rows]
        largest = ca.SX(0)
        for size in sizes:
            largest = ca.fmax(largest, size)
        self._least = least**2 * largest + ROUNDING**2 * metric.mobility + _TINY
        self._singular = SINGULAR**2 * largest + _TINY
        self._overlap: list[list[ca.SX]] = []
        self._sizes: list[ca.SX] = []
        self._bars: list[ca.SX] = []
        self._gains: list[ca.SX] = []
        self._gates: list[ca.SX] = []
        for k in range(len(self._rows)):
            self._orthogonalize(k)

    @property
    def rank(self) -> ca.SX:
        """Number of independent rows."""
        return sum(self._gates, ca.SX(0))

    def nearest(self, x: ca.SX, b: ca.SX) -> ca.SX:
        """The vector nearest to ``x`` that satisfies the first rows, y_k·x = b_k, shape (n,)."""
        return self.solved(x, b)[0]

    def solved(self, x: ca.SX, b: ca.SX) -> tuple[ca.SX, ca.SX]:
        """The same, and the multipliers: ``x`` + Σ λ_k y_k, λ of shape (m,).

        The multiplier of a dependent row is zero.
        """
        nearest, components, shares = x, list[ca.SX](), list[ca.SX]()
        for k in range(b.shape[0]):
            y, w = self._rows[k], b[k]
            for j, r in enumerate(self._overlap[k]):
                w = w - r * components[j]
            components.append(self._gains[k] * self._sizes[k] * w)
            shares.append(self._gains[k] * w - self._bars[k] * ca.dot(y, nearest))
            nearest = nearest + y * shares[k]
        for k in reversed(range(len(shares))):
            for j, r in enumerate(self._overlap[k]):
                shares[j] = shares[j] - r * shares[k]
        return nearest, ca.vertcat(ca.SX(0, 1), *shares)

    def _orthogonalize(self, k: int) -> None:
        y, overlap = self._rows[k], list[ca.SX]()
        for j in range(k):
            r = self._bars[j] * ca.dot(self._rows[j], y)
            y = y - r * self._rows[j]
            overlap.append(r)
        size, least = ca.sumsqr(y), self._least
        # 0 below the threshold, else 1; without branches, such that it can be vectorized over
        # arms.
        gate = ca.fmin(1, ca.fmax(0, SHARP * (size - least) / least))
        self._gates.append(gate)
        self._rows[k] = y
        self._sizes.append(size)
        self._overlap.append(overlap)
        self._bars.append(gate / ca.fmax(size, least))
        self._gains.append(gate / ca.fmax(size, self._singular))
