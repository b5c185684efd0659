# SPDX-License-Identifier: Apache-2.0
"""Motion under bilateral constraints, and projection of steps onto them.

The state at the end of a step is moved to the nearest one, in the metric of M, with φ(q) = 0 and
A(q) v = 0. There is no drift, and a method keeps its order, since the correction is of the size of
the method's own error (Hairer, Wanner, Solving Ordinary Differential Equations II, 1996, section
VII.2; Eich, SIAM J. Numer. Anal. 30(5), 1993).
"""

import casadi as ca

from arm_dynamics import ArmModel
from arm_dynamics.equations import constraint
from arm_dynamics.equations.projection import SINGULAR, Metric, Projector
from arm_dynamics.model.tree_builder import linkage_of
from arm_sim.plant.response import Response
from arm_sim.plant.symbols import Joints, Symbols, dense_function

# Newton steps with the factors of the first, which leaves the square of the step's error.
CLOSING_STEPS = 3
# Largest φ in [m] or [rad], and A v in [m/s] or [rad/s], that may remain after the projection,
# which does not correct them in singular positions.
POSITION_TOLERANCE, VELOCITY_TOLERANCE = 1e-9, 1e-6
# Residuals below this, in [m] or [rad], are rounding and not corrected, such that an arm at rest
# stays at rest.
ROUNDING = 1e-15
# Largest correction relative to the step, and to the speed before or after it: a motion that comes
# to rest has none at its end. Beyond, the step has left its branch of the motion or its
# accelerations were invalid.
MAX_CORRECTION = 0.1
# Corrections of speeds in [m/s] or [rad/s] that are never too large; of positions, those of
# ``POSITION_TOLERANCE``.
SMALL_SPEED_CORRECTION = 1e-9
# Numbers of a refused state, which every stepper rejects, are of this size.
REFUSAL_SIZE = 1e200


class Bilateral(Response):
    """Response of an arm under bilateral constraints, and projection onto them.

    Where joints stick, motions and rows are those of the other joints.

    Args:
        model: The robot.
        s: Its symbols.
        joints: Modes of the joints.

    Attributes:
        rows: The constraints.
    """

    def __init__(self, model: ArmModel, s: Symbols, joints: Joints) -> None:
        super().__init__(model, s, joints)
        self._n, self._s = model.n, s
        self.rows = constraint.rows(
            linkage_of(model, model.constraint_rows), s.tree, s.q, s.v, s.active
        )
        self._metric = Metric(self._held)
        self._projector = Projector(self._metric, ca.sparsify(self.rows.jacobian @ self._sliding))

    def accelerations(self, load: ca.SX) -> ca.SX:
        """Accelerations as of ``Response``, under A a + γ = 0."""
        return self._metric.motion(self._solve_for(load)[0])

    def mobility(self, forces: ca.SX) -> ca.SX:
        """Mobility as of ``Response``, under A a = 0."""
        zero = ca.SX(self.rows.drift.shape[0], 1)
        columns = [
            self._metric.motion(self._projector.nearest(self._metric.of_forces(force), zero))
            for force in ca.horzsplit(self._sliding @ forces)
        ]
        return ca.horzcat(*columns)

    def reactions(self, load: ca.SX, a: ca.SX) -> ca.SX:
        """Reactions as of ``Response``; not unique where constraints are redundant."""
        load = load + self.rows.jacobian.T @ self._solve_for(load)[1]
        return super().reactions(load, a)

    def impact(self, push: ca.SX, change: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Impact as of ``Response``, under A v = 0 after the impact if that held before."""
        A = self.rows.jacobian
        free = self._metric.of_forces(self._sliding @ (push - self._M @ change))
        nearest, shares = self._projector.solved(free, -(A @ change))
        gain = change + self._metric.motion(nearest)
        return gain, self._sticking @ (self._M @ gain - push - A.T @ shares)

    @property
    def rank(self) -> ca.SX:
        """Number of degrees of freedom of sliding joints that the constraints remove."""
        return self._projector.rank

    def project(self, p: ca.SX) -> ca.Function:
        """Build the projection onto the constraints.

        Args:
            p: The vector of tunable numbers and modes.

        Returns:
            CasADi function (x before a step, x after it, p) -> x after it, projected, with
            numbers of the size ``REFUSAL_SIZE`` if that was not possible; and the residuals before
            projection, in [m] or [rad] and in [m/s] or [rad/s].
        """
        s, n, metric, rows = self._s, self._n, self._metric, self.rows
        before, after = ca.SX.sym("before", 2 * n), ca.SX.sym("after", 2 * n)
        zero, q = ca.SX(n, 1), s.q
        for _ in range(CLOSING_STEPS):
            residual = ca.substitute(rows.residual, s.q, q)
            correctable = residual - ca.fmax(-ROUNDING, ca.fmin(ROUNDING, residual))
            q = q + metric.motion(self._projector.nearest(zero, -correctable))
        A = ca.substitute(rows.jacobian, s.q, q)
        velocity_projector = Projector(metric, ca.sparsify(A @ self._sliding), SINGULAR)
        v = s.v + metric.motion(velocity_projector.nearest(zero, -(A @ s.v)))
        every = ca.substitute(rows.all_residuals, s.q, q)
        gap_excess = _largest(every) - POSITION_TOLERANCE
        excess = ca.fmax(gap_excess, _largest(A @ v) - VELOCITY_TOLERANCE)
        refusal = self._refusal(excess, q, v, before)
        gap = _largest(rows.residual), _largest(rows.jacobian @ s.v)
        results = [ca.vertcat(q, v) + refusal, *gap]
        projected = ca.substitute(results, [s.q, s.v], [after[:n], after[n:]])
        return dense_function("project", [before, after, p], *projected)

    def _refusal(self, excess: ca.SX, q: ca.SX, v: ca.SX, before: ca.SX) -> ca.SX:
        """Zero for a projected state (q, v) to be accepted, else a number that refuses it."""
        s, n = self._s, self._n
        astray = _too_large(q - s.q, POSITION_TOLERANCE, q - before[:n])
        astray += _too_large(v - s.v, SMALL_SPEED_CORRECTION, v, before[n:])
        return REFUSAL_SIZE * (ca.fmax(0, excess) + astray)

    def _solve_for(self, load: ca.SX) -> tuple[ca.SX, ca.SX]:
        free = self._metric.of_forces(self._sliding @ load)
        return self._projector.solved(free, -self.rows.drift)


def _too_large(correction: ca.SX, small: float, *wholes: ca.SX) -> ca.SX:
    """Positive if a correction is not small, and large relative to the largest whole change."""
    largest = ca.mmax(ca.vertcat(*map(ca.sumsqr, wholes)))
    return ca.fmax(0, ca.sumsqr(correction) - MAX_CORRECTION**2 * largest - small**2)


def _largest(values: ca.SX) -> ca.SX:
    return ca.mmax(ca.fabs(ca.vertcat(0, values)))
