# SPDX-License-Identifier: Apache-2.0
"""Steps that end where the constraints hold: projection of positions and velocities.

The state at the end of a step is moved to the nearest one that obeys φ(q) = 0 and A(q) v = 0, near
in the metric of M. Nothing drifts, and a method keeps its order, since the way back is as short
as the method's own error (Hairer, Wanner, Solving Ordinary Differential Equations II, 1996,
section VII.2; Eich, SIAM J. Numer. Anal. 30(5), 1993).
"""

from __future__ import annotations

import casadi as ca

from arm_dynamics import ArmModel, SceneError
from arm_dynamics.equations import constraint, rigid_body
from arm_dynamics.equations.projection import SINGULAR, Metric, Projector
from arm_dynamics.model.tree_builder import linkage_of
from arm_sim.plant.symbols import Symbols, dense_function

# Newton's steps with the factors of the first; the first leaves the square of the step's error.
CLOSING_STEPS = 3
# What may be left of φ in [m] or [rad], and of A v in [m/s] or [rad/s]: that is left alone in
# singular positions.
LEFT_OPEN, LEFT_MOVING = 1e-9, 1e-6
# Residuals under this, in [m] or [rad], are rounding, and are left alone: what rests, rests.
ROUNDING = 1e-15
# Longest way back, relative to the step, and largest part of the speed that it may take. Beyond,
# the step has left its branch of the motion or its accelerations were worth nothing.
ASTRAY = 0.1
# A state so far out is refused by every stepper.
REFUSED = 1e200


class Bilateral:
    """Equation of motion and projection of a scene with bilateral constraints.

    Attributes:
        acceleration: CasADi function (q, v, tau, p) -> q̈.
        project: CasADi function (x before a step, x after it, p) -> x after it, on the
            constraints, beyond all bounds if that was not possible; and how far the step had left
            them, in [m] or [rad] and in [m/s] or [rad/s].
    """

    def __init__(self, model: ArmModel, s: Symbols) -> None:
        _check_alone(model)
        self._n, self._s = model.n, s
        self._rows = constraint.rows(
            linkage_of(model, model.constraint_rows), s.tree, s.q, s.v, s.active
        )
        self._metric = Metric(rigid_body.mass_matrix(s.tree, s.q))
        self._held = Projector(self._metric, self._rows.jacobian)
        self.acceleration = self._acceleration()
        self.project = self._project()

    def _acceleration(self) -> ca.Function:
        s, metric = self._s, self._metric
        bias = rigid_body.inverse(s.tree, s.q, s.v, ca.SX(self._n, 1), s.gravity)
        free = metric.of_forces(s.tau - bias - s.viscous)
        a = metric.motion(self._held.nearest(free, -self._rows.drift))
        return dense_function("acceleration", [s.q, s.v, s.tau, s.p], a)

    def _project(self) -> ca.Function:
        s, n, metric, rows = self._s, self._n, self._metric, self._rows
        before, after = ca.SX.sym("before", 2 * n), ca.SX.sym("after", 2 * n)
        still, q = ca.SX(n, 1), s.q
        for _ in range(CLOSING_STEPS):
            left = _beyond_rounding(_at(rows.residual, s.q, q))
            q = q + metric.motion(self._held.nearest(still, -left))
        A = _at(rows.jacobian, s.q, q)
        v = s.v + metric.motion(Projector(metric, A, SINGULAR).nearest(still, -(A @ s.v)))
        left = ca.fmax(
            _largest(_at(rows.every, s.q, q)) - LEFT_OPEN, _largest(A @ v) - LEFT_MOVING
        )
        way = _astray(q - s.q, q - before[:n]) + _astray(v - s.v, v)
        refused = REFUSED * (ca.fmax(0, left) + way)
        gap = _largest(rows.residual), _largest(rows.jacobian @ s.v)
        results = [ca.vertcat(q, v) + refused, *gap]
        found = ca.substitute(results, [s.q, s.v], [after[:n], after[n:]])
        return dense_function("project", [before, after, s.p], *found)


def _check_alone(model: ArmModel) -> None:
    """Refuse what cannot be simulated together with bilateral constraints.

    Raises:
        SceneError: Saying what.
    """
    for present, what in (
        (model.has_dry_friction, "dry friction by events (with lugre it goes)"),
        (bool(model.scene.contacts), "a contact"),
    ):
        if present:
            raise SceneError(
                f"scene: bilateral constraints together with {what} cannot be simulated; "
                "leave one of them out"
            )


def _at(expression: ca.SX, q: ca.SX, place: ca.SX) -> ca.SX:
    return ca.substitute(expression, q, place)


def _beyond_rounding(residual: ca.SX) -> ca.SX:
    return residual - ca.fmax(-ROUNDING, ca.fmin(ROUNDING, residual))


def _astray(correction: ca.SX, whole: ca.SX) -> ca.SX:
    """Positive if a correction is large for what it corrects."""
    return ca.fmax(0, ca.sumsqr(correction) - ASTRAY**2 * ca.sumsqr(whole) - LEFT_OPEN**2)


def _largest(values: ca.SX) -> ca.SX:
    return ca.mmax(ca.fabs(ca.vertcat(0, values)))
