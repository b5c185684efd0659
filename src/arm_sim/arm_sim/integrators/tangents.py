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

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_sim.integrators import nystrom
from arm_sim.integrators.implicit_tangents import implicit_tangent
from arm_sim.integrators.methods import Method
from arm_sim.integrators.steps import Scaled, Step, build_step
from arm_sim.integrators.tableaux import Tableau, weighed_sum
from arm_sim.plant.slopes import Kept, Slopes, jacobian_by

Pair = tuple[ca.Function, ca.Function]
"""Function (x, u, p, h) -> (x at the end, c), and function (c, dx, dw, dh) -> dx at the end."""


@one_at_a_time
def build_tangent(
    method: Method,
    rhs: ca.Function,
    slopes: Slopes,
    n: int,
    project: ca.Function | None = None,
    scaled: Scaled | None = None,
    tuned: Sequence[int] = (),
    dense: bool = False,
) -> Pair:
    """Build the derivative of one step of ``build_step``.

    Args:
        method: The method.
        rhs: Function (x, u, p) -> x'.
        slopes: Its derivatives.
        n: Degrees of freedom; x starts with q and v of n each.
        project: Projection of (q, v) onto the constraints, see ``Mechanics.project``.
        scaled: See ``slopes.scaled_jacobian``; called only if the method is implicit.
        tuned: Indices in p of the quantities to differentiate by, those of ``slopes``.
        dense: Whether ``advance`` is to return the continuous output, too, where all stages of an
            explicit method are used, see ``Step.inside``.

    Returns:
        ``advance`` and ``propagate``: the step with its coefficients, and the propagation of
        tangents.
    """
    if method.name == "implicit":
        if scaled is not None and scaled() is not None:
            return _undivided(build_step(method, rhs, n, project, scaled), tuned)
        pair = implicit_tangent(rhs, slopes, n, tuned)
    elif method.tableau is None:
        pair = _semi_implicit(slopes, n)
    else:
        pair = _staged(method.tableau, slopes, n, dense)
    return pair if project is None else _projected(pair, project, n, tuned)


def _symbols(slopes: Slopes) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
    f = slopes.coefficients
    x, u, p = (ca.MX.sym(name, f.size1_in(i)) for i, name in enumerate("xup"))
    return x, u, p, ca.MX.sym("h")


def _changes(slopes: Slopes) -> tuple[ca.SX, ca.SX, ca.SX]:
    dx, dw = (ca.SX.sym(name, slopes.carried.size1_in(i)) for i, name in ((1, "dx"), (2, "dw")))
    return dx, dw, ca.SX.sym("dh")


def _staged(tableau: Tableau, slopes: Slopes, n: int, dense: bool) -> Pair:
    """Runge-Kutta methods; stages that do not affect the result are omitted."""
    used = stages_used(tableau)
    x, u, p, h = _symbols(slopes)
    k: dict[int, ca.MX] = {}
    c: dict[int, ca.MX] = {}
    for i in used:
        k[i], c[i] = slopes.coefficients(_state(tableau, i, k, x, h, n), u, p)
    kept = ca.vertcat(h, *(k[i] for i in used), *(c[i] for i in used))
    after = _state(tableau, len(tableau.b), k, x, h, n)
    results = [after, kept]
    if dense and len(used) == len(tableau.b):
        step = Step(x, h, after, [], tableau, list(k.values()))
        results += step.inside(lambda _, y: slopes.coefficients(y, u, p)[0])
    advance = ca.Function("advance", [x, u, p, h], results, {"cse": True})

    dx, dw, dh = _changes(slopes)
    h, s = ca.SX.sym("h"), ca.SX.sym("k", dx.shape[0], len(used))
    t = ca.SX.sym("c", slopes.coefficients.size1_out(1), len(used))
    slope = {i: s[:, place] for place, i in enumerate(used)}
    dk: dict[int, ca.SX] = {}
    rows = (*tableau.a, tableau.b)

    def moved(i: int) -> ca.SX:
        weights = rows[i]
        if tableau.positions:
            return nystrom.tangent(weights, tableau.positions[i], dk, slope, dx, h, dh, n)
        return dx + h * weighed_sum(weights, dk, dx) + dh * weighed_sum(weights, slope, dx)

    for place, i in enumerate(used):
        dk[i] = slopes.carried(t[:, place], moved(i), dw)
    kept, change = ca.vertcat(h, ca.vec(s), ca.vec(t)), moved(len(rows) - 1)
    return advance, ca.Function("propagate", [kept, dx, dw, dh], [change], {"cse": True})


def _state(tableau: Tableau, i: int, k: dict[int, ca.MX], x: ca.MX, h: ca.MX, n: int) -> ca.MX:
    """State of stage i, and after the last one that at the end."""
    if tableau.positions:
        return nystrom.stage(tableau, i, list(k.values()), x, h, n)
    return x + h * weighed_sum((*tableau.a, tableau.b)[i], k, x)


def stages_used(tableau: Tableau) -> list[int]:
    """Stages on which the result depends."""
    used = [i for i, weight in enumerate(tableau.b) if weight]
    for i in reversed(range(len(tableau.b))):
        if i in used:
            used += [j for j, weight in enumerate(tableau.a[i]) if weight and j not in used]
    return sorted(used)


def _semi_implicit(slopes: Slopes, n: int) -> Pair:
    """Velocities first, then positions with the new velocities, as in ``build_step``."""
    x, u, p, h = _symbols(slopes)
    k, c = slopes.coefficients(x, u, p)
    after = x + h * k
    v = after[n : 2 * n]
    end, kept = ca.vertcat(x[:n] + h * v, after[n:]), ca.vertcat(h, k, v, c)
    advance = ca.Function("advance", [x, u, p, h], [end, kept], {"cse": True})

    dx, dw, dh = _changes(slopes)
    h, k = ca.SX.sym("h"), ca.SX.sym("k", dx.shape[0])
    v, c = ca.SX.sym("v", n), ca.SX.sym("c", slopes.coefficients.size1_out(1))
    moved = dx + h * slopes.carried(c, dx, dw) + dh * k
    change = ca.vertcat(dx[:n] + h * moved[n : 2 * n] + dh * v, moved[n:])
    kept = ca.vertcat(h, k, v, c)
    return advance, ca.Function("propagate", [kept, dx, dw, dh], [change], {"cse": True})


def _projected(pair: Pair, project: ca.Function, n: int, tuned: Sequence[int]) -> Pair:
    """The same with the state projected onto the constraints at the end."""
    advance, propagate = pair
    before, after, p = (ca.SX.sym(name, project.size1_in(i)) for i, name in enumerate("xyp"))
    projected = project(before, after, p)[0]
    kept = Kept()
    by_before, by_after, by_p = (
        kept.matrix(ca.jacobian(projected, by)) for by in (before, after, p[list(tuned), :])
    )
    onto = ca.Function("onto", [before, after, p], [projected, kept.values], {"cse": True})

    x, u, p, h = (advance.mx_in(i) for i in range(4))
    moved, c, *inside = advance(x, u, p, h)
    projected, coefficients = onto(x[: 2 * n], moved[: 2 * n], p)
    end = ca.vertcat(projected, moved[2 * n :])
    results = [end, ca.vertcat(c, coefficients), *inside]
    advance = ca.Function("advance", [x, u, p, h], results, {"cse": True})

    c, dx, dw, dh = (ca.SX.sym(name, propagate.size1_in(i)) for i, name in enumerate("cxwh"))
    moved = propagate(c, dx, dw, dh)
    change = by_before @ dx[: 2 * n] + by_after @ moved[: 2 * n] + by_p @ dw[n:]
    arguments = [ca.vertcat(c, kept.symbols), dx, dw, dh]
    change = ca.vertcat(change, moved[2 * n :])
    return advance, ca.Function("propagate", arguments, [change], {"cse": True})


def _undivided(step: ca.Function, tuned: Sequence[int]) -> Pair:
    """A step that is differentiated at once, not stage by stage."""
    x, u, p, h = (step.mx_in(i) for i in range(4))
    after = step(x, u, p, h)
    by_x, by_u, by_h = (ca.jacobian(after, by) for by in (x, u, h))
    by_w = ca.horzcat(by_u, jacobian_by(after, p, tuned))
    slopes = [ca.densify(slope) for slope in (by_x, by_w, by_h)]
    kept = ca.vertcat(*(ca.vec(slope) for slope in slopes))
    advance = ca.Function("advance", [x, u, p, h], [after, kept], {"cse": True})
    symbols = [ca.SX.sym(name, *slope.shape) for name, slope in zip("XWH", slopes, strict=True)]
    columns = [
        ca.SX.sym(f"d{name}", slope.shape[1]) for name, slope in zip("xwh", slopes, strict=True)
    ]
    change = sum((J @ d for J, d in zip(symbols, columns, strict=True)), ca.SX(x.shape[0], 1))
    kept = ca.vertcat(*(ca.vec(J) for J in symbols))
    return advance, ca.Function("propagate", [kept, *columns], [change], {"cse": True})
