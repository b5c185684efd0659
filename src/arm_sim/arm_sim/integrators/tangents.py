# SPDX-License-Identifier: Apache-2.0
"""The derivative of a method's step, from the derivatives of f at its stages.

Differentiating x' = f(x, u) along with the state turns a Runge-Kutta method into the same method
for the columns dx, du, dh (Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I,
1993, section I.14; Bock, "Numerical treatment of inverse problems in chemical reaction kinetics",
1981: internal numerical differentiation):

    dy_i = dx + h Σ a_ij dk_j + dh Σ a_ij k_j,   dk_i = f_x(y_i) dy_i + f_w(y_i) dw,

where w holds all quantities that are constant over the step: u, and tunable quantities if
derivatives by them are requested. This is the exact derivative of the computed step, not of the
exact motion.
"""

from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca

from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_sim.coefficients import Coefficients
from arm_sim.integrators import nystrom
from arm_sim.integrators.implicit_tangents import implicit_tangent
from arm_sim.integrators.methods import Method
from arm_sim.integrators.steps import Scaled, Step, build_step
from arm_sim.integrators.tableaux import Tableau, weighted_sum
from arm_sim.plant.slopes import Slopes
from arm_sim.plant.symbols import jacobian_by


class Tangent(NamedTuple):
    """A step with the coefficients of its derivative, and that derivative.

    Attributes:
        advance: Function (x, u, p, h) -> x at the end, and coefficients c.
        propagate: Function (c, dx, dw, dh) -> dx at the end.
    """

    advance: ca.Function
    propagate: ca.Function


@one_at_a_time
def build_tangent(
    method: Method, rhs: ca.Function, slopes: Slopes, n: int, project: ca.Function | None = None,
    scaled: Scaled | None = None, p_indices: Sequence[int] = (), dense: bool = False,
) -> Tangent:  # fmt: skip
    """Build the derivative of one step of ``build_step``.

    Args:
        method: The method.
        rhs: Function (x, u, p) -> x'.
        slopes: Derivatives of ``rhs``.
        n: Degrees of freedom; x starts with q and v of n each.
        project: Projection of (q, v) onto the constraints, see ``Mechanics.project``.
        scaled: See ``slopes.scaled_jacobian``; called only if the method is implicit.
        p_indices: Indices in p of the quantities to differentiate by, those of ``slopes``.
        dense: Whether ``advance`` is to return the continuous output, too, where all stages of an
            explicit method are used, see ``Step.dense_output``.

    """
    if method.name == "implicit":
        if scaled is not None and scaled() is not None:
            return _differentiate_whole(build_step(method, rhs, n, project, scaled), p_indices)
        tangent = Tangent(*implicit_tangent(rhs, slopes, n, p_indices))
    elif method.tableau is None:
        tangent = _semi_implicit(slopes, n)
    else:
        tangent = Tangent(
            _staged_advance(method.tableau, slopes, n, dense),
            _staged_propagation(method.tableau, slopes, n),
        )
    return tangent if project is None else _with_projection(tangent, project, n, p_indices)


def _arguments(slopes: Slopes) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
    """Symbols x, u, p and h."""
    f = slopes.coefficients
    x, u, p = (ca.MX.sym(name, f.size1_in(i)) for i, name in enumerate("xup"))
    return x, u, p, ca.MX.sym("h")


def _changes(slopes: Slopes) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Symbols dx, dw and dh."""
    dx, dw = (ca.SX.sym(name, slopes.tangent.size1_in(i)) for i, name in ((1, "dx"), (2, "dw")))
    return dx, dw, ca.SX.sym("dh")


def _staged_advance(tableau: Tableau, slopes: Slopes, n: int, dense: bool) -> ca.Function:
    """Runge-Kutta methods; stages that do not affect the result are omitted.

    The coefficients are h, the slopes k of all stages, and those of the derivatives of f there.
    """
    used, (x, u, p, h) = stages_used(tableau), _arguments(slopes)
    k: dict[int, ca.MX] = {}
    c: dict[int, ca.MX] = {}

    def state(i: int) -> ca.MX:
        """The state at stage i, or at the end of the step after the last stage."""
        if tableau.positions:
            return nystrom.stage(tableau, i, list(k.values()), x, h, n)
        return x + h * weighted_sum((*tableau.a, tableau.b)[i], k, x)

    for i in used:
        k[i], c[i] = slopes.coefficients(state(i), u, p)
    after = state(len(tableau.b))
    results = [after, ca.vertcat(h, *k.values(), *c.values())]
    if dense and len(used) == len(tableau.b):
        step = Step(x, h, after, [], tableau, list(k.values()))
        results += step.dense_output(lambda _, y: slopes.coefficients(y, u, p)[0])
    return ca.Function("advance", [x, u, p, h], results, {"cse": True})


def _staged_propagation(tableau: Tableau, slopes: Slopes, n: int) -> ca.Function:
    """``propagate`` of ``build_tangent`` for methods with stages, from coefficients of each."""
    used, (dx, dw, dh) = stages_used(tableau), _changes(slopes)
    h, k_symbols = ca.SX.sym("h"), ca.SX.sym("k", dx.shape[0], len(used))
    c_symbols = ca.SX.sym("c", slopes.coefficients.size1_out(1), len(used))
    k = dict(zip(used, ca.horzsplit(k_symbols), strict=True))
    c = dict(zip(used, ca.horzsplit(c_symbols), strict=True))
    dk: dict[int, ca.SX] = {}

    def change(i: int) -> ca.SX:
        """Change of the state at stage i, or at the end of the step after the last stage."""
        weights = (*tableau.a, tableau.b)[i]
        if tableau.positions:
            return nystrom.tangent(weights, tableau.positions[i], dk, k, dx, h, dh, n)
        return dx + h * weighted_sum(weights, dk, dx) + dh * weighted_sum(weights, k, dx)

    for i in used:
        dk[i] = slopes.tangent(c[i], change(i), dw)
    coefficients = ca.vertcat(h, ca.vec(k_symbols), ca.vec(c_symbols))
    after = change(len(tableau.b))
    return ca.Function("propagate", [coefficients, dx, dw, dh], [after], {"cse": True})


def stages_used(tableau: Tableau) -> list[int]:
    """Stages on which the result depends."""
    used = [i for i, weight in enumerate(tableau.b) if weight]
    for i in reversed(range(len(tableau.b))):
        if i in used:
            used += [j for j, weight in enumerate(tableau.a[i]) if weight and j not in used]
    return sorted(used)


def _semi_implicit(slopes: Slopes, n: int) -> Tangent:
    """Velocities first, then positions with the new velocities, as in ``build_step``.

    The coefficients are h, the slope k, the new velocities, and those of the derivative of f.
    """
    x, u, p, h = _arguments(slopes)
    k, c = slopes.coefficients(x, u, p)
    x_new = x + h * k
    v = x_new[n : 2 * n]
    results = [ca.vertcat(x[:n] + h * v, x_new[n:]), ca.vertcat(h, k, v, c)]
    advance = ca.Function("advance", [x, u, p, h], results, {"cse": True})
    return Tangent(advance, _semi_implicit_propagation(slopes, n))


def _semi_implicit_propagation(slopes: Slopes, n: int) -> ca.Function:
    dx, dw, dh = _changes(slopes)
    h, k = ca.SX.sym("h"), ca.SX.sym("k", dx.shape[0])
    v, c = ca.SX.sym("v", n), ca.SX.sym("c", slopes.coefficients.size1_out(1))
    dx_new = dx + h * slopes.tangent(c, dx, dw) + dh * k
    after = ca.vertcat(dx[:n] + h * dx_new[n : 2 * n] + dh * v, dx_new[n:])
    arguments = [ca.vertcat(h, k, v, c), dx, dw, dh]
    return ca.Function("propagate", arguments, [after], {"cse": True})


def _with_projection(
    tangent: Tangent, project: ca.Function, n: int, p_indices: Sequence[int]
) -> Tangent:
    """A step and its derivative with the state projected onto the constraints at its end."""
    before, after, p = (ca.SX.sym(name, project.size1_in(i)) for i, name in enumerate("xyp"))
    projected, of_projection = project(before, after, p)[0], Coefficients()
    by_before, by_after, by_p = (
        of_projection.substitute(ca.jacobian(projected, by))
        for by in (before, after, p[list(p_indices), :])
    )
    results = [projected, of_projection.values]
    onto = ca.Function("onto", [before, after, p], results, {"cse": True})

    arguments = x, _, p, _ = tangent.advance.mx_in()
    end, c, *inside = tangent.advance.call(arguments)
    qv, c_projection = onto(x[: 2 * n], end[: 2 * n], p)
    results = [ca.vertcat(qv, end[2 * n :]), ca.vertcat(c, c_projection), *inside]
    advance = ca.Function("advance", arguments, results, {"cse": True})

    c, dx, dw, dh = tangent.propagate.sx_in()
    dend = tangent.propagate(c, dx, dw, dh)
    dqv = by_before @ dx[: 2 * n] + by_after @ dend[: 2 * n] + by_p @ dw[n:]
    arguments = [ca.vertcat(c, of_projection.symbols), dx, dw, dh]
    results = [ca.vertcat(dqv, dend[2 * n :])]
    return Tangent(advance, ca.Function("propagate", arguments, results, {"cse": True}))


def _differentiate_whole(step: ca.Function, p_indices: Sequence[int]) -> Tangent:
    """A step that is differentiated at once, not stage by stage."""
    arguments = x, u, p, h = step.mx_in()
    after = step(x, u, p, h)
    by_w = ca.horzcat(ca.jacobian(after, u), jacobian_by(after, p, p_indices))
    slopes = [ca.densify(J) for J in (ca.jacobian(after, x), by_w, ca.jacobian(after, h))]
    coefficients = ca.vertcat(*map(ca.vec, slopes))
    advance = ca.Function("advance", arguments, [after, coefficients], {"cse": True})

    by_x, by_w, by_h = (ca.SX.sym("J", *J.shape) for J in slopes)
    dx, dw, dh = (ca.SX.sym("d", J.shape[1]) for J in slopes)
    coefficients = ca.vertcat(*map(ca.vec, (by_x, by_w, by_h)))
    change = by_x @ dx + by_w @ dw + by_h @ dh
    propagate = ca.Function("propagate", [coefficients, dx, dw, dh], [change], {"cse": True})
    return Tangent(advance, propagate)
