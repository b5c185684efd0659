# SPDX-License-Identifier: Apache-2.0
"""The transposed derivative of a method's step, without the derivative itself.

The gradient by the state at the end of a step, λ = ∂L/∂x⁺, is propagated back to the beginning
stage by stage (Hager, "Runge-Kutta methods in optimal control and the transformed adjoint system",
Numerische Mathematik 87, 2000, section 2; Sanz-Serna, SIAM Review 58, 2016):

    λ_i = h b_i λ + h Σ_{j>i} a_ji f_xᵀ(y_j) λ_j,   λ⁻ = λ + Σ f_xᵀ(y_i) λ_i,   ∂L/∂u = Σ f_uᵀ λ_i.

This is the exact gradient of the computed step. Only the state at the beginning is required.
"""

import casadi as ca

from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_sim.integrators import nystrom
from arm_sim.integrators.methods import Method
from arm_sim.integrators.nystrom import Pullback, Slope, StageGradients
from arm_sim.integrators.steps import Scaled, build_step
from arm_sim.integrators.tableaux import Tableau, weighted_sum
from arm_sim.integrators.tangents import stages_used


@one_at_a_time
def build_adjoint(
    method: Method, rhs: ca.Function, pullback: ca.Function, n: int,
    project: ca.Function | None = None, scaled: Scaled | None = None,
) -> ca.Function:  # fmt: skip
    """Build the transposed derivative of one step of ``build_step``.

    Args:
        method: The method.
        rhs: Function (x, u, p) -> x'.
        pullback: Transposed derivative of ``rhs``, see ``plant.slopes.pullback``.
        n: Degrees of freedom; x starts with q and v of n each.
        project: Projection of (q, v) onto the constraints, see ``Mechanics.project``.
        scaled: See ``slopes.scaled_jacobian``; called only if the method is implicit.

    Returns:
        Function (x, u, p, h, λ) -> gradients by x, u and the tunable quantities in p.
    """
    x, u, p = (ca.MX.sym(name, rhs.size1_in(i)) for i, name in enumerate("xup"))
    h, weight = ca.MX.sym("h"), ca.MX.sym("weight", x.shape[0])
    tunable = pullback.size1_out(2)
    after_weight, direct = weight, ca.MX.zeros(x.shape[0])

    def slope(y: ca.MX) -> ca.MX:
        return rhs(y, u, p)

    def pull(y: ca.MX, k: ca.MX, gradient: ca.MX) -> StageGradients:
        gradients: StageGradients = pullback(y, u, p, k, gradient)
        return gradients

    if project is not None and method.name != "implicit":
        after = build_step(method, rhs, n)(x, u, p, h)
        after_weight, direct = _pull_through_projection(project, n, x, after, p, weight)
    if method.name == "implicit":
        after = build_step(method, rhs, n, project, scaled)(x, u, p, h)
        by_x, by_u, by_p = (ca.jtimes(after, by, weight, True) for by in (x, u, p))
        by_p = by_p[:tunable]
    elif method.tableau is None:
        by_x, by_u, by_p = _semi_implicit(slope, pull, n, x, h, after_weight)
    elif method.tableau.positions:
        by_x, by_u, by_p = nystrom.adjoint(method.tableau, slope, pull, n, x, h, after_weight)
    else:
        by_x, by_u, by_p = _staged(method.tableau, slope, pull, x, h, after_weight)
    results = [by_x + direct, by_u, by_p]
    return ca.Function("adjoint", [x, u, p, h, weight], results, {"cse": True})


def _pull_through_projection(
    project: ca.Function, n: int, x: ca.MX, after: ca.MX, p: ca.MX, weight: ca.MX
) -> tuple[ca.MX, ca.MX]:
    """The weight of a step's end before its projection, and what x adds through that directly."""
    end = ca.MX.sym("end", 2 * n)
    projected = project(x[: 2 * n], end, p)[0]
    gradients = [ca.jtimes(projected, by, weight[: 2 * n], True) for by in (x, end)]
    gradients_at = ca.Function("projection_gradients", [x, end, p, weight], gradients)
    by_x, by_end = gradients_at(x, after[: 2 * n], p, weight)
    return ca.vertcat(by_end, weight[2 * n :]), by_x


def _staged(
    tableau: Tableau, slope: Slope, pull: Pullback, x: ca.MX, h: ca.MX, weight: ca.MX
) -> StageGradients:
    """Explicit Runge-Kutta methods, λ_i from the last stage to the first."""
    used = stages_used(tableau)
    y: dict[int, ca.MX] = {}
    k: dict[int, ca.MX] = {}
    for i in used:
        y[i] = x + h * weighted_sum(tableau.a[i], k, x)
        k[i] = slope(y[i])
    stages: dict[int, StageGradients] = {}
    for i in reversed(used):
        by_slope = tableau.b[i] * weight
        for j, (by_y, _, _) in stages.items():
            if i < len(tableau.a[j]) and tableau.a[j][i]:
                by_slope = by_slope + tableau.a[j][i] * by_y
        stages[i] = pull(y[i], k[i], h * by_slope)
    by_x, by_u, by_p = (sum(terms[1:], terms[0]) for terms in zip(*stages.values(), strict=True))
    return weight + by_x, by_u, by_p


def _semi_implicit(
    slope: Slope, pull: Pullback, n: int, x: ca.MX, h: ca.MX, weight: ca.MX
) -> StageGradients:
    """Positions advance with the new velocities, so they do not depend on the derivative of q."""
    end_weight = ca.vertcat(weight[:n], weight[n : 2 * n] + h * weight[:n], weight[2 * n :])
    by_x, by_u, by_p = pull(x, slope(x), ca.vertcat(ca.MX.zeros(n), h * end_weight[n:]))
    return end_weight + by_x, by_u, by_p
