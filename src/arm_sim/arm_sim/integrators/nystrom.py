# SPDX-License-Identifier: Apache-2.0
"""Nyström's methods: stages of q'' = f(q, q') whose positions are chosen by themselves.

Stage i is evaluated at

    q_i = q + c_i h v + h² Σ ā_ij a_j,   w_i = w + h Σ a_ij k_j,   c_i = Σ a_ij,

with w = (v, z), the accelerations a and the rates k of w, and the step ends at q + h v + h² Σ b̄_i
a_i and w + h Σ b_i k_i (Nyström, Acta Soc. Sci. Fennicae 50(13), 1925; Hairer, Nørsett, Wanner,
Solving Ordinary Differential Equations I, 1993, section II.14). Internal states z advance like the
velocities, and the order conditions of w' = g(q, w), q' = v are the same as those of q'' = f(q,
q'). Where two stages share their position, all that depends on positions alone is computed once.
"""

from collections.abc import Callable, Mapping, Sequence

import casadi as ca

from arm_sim.integrators.tableaux import Tableau, weighted_sum

Rates = Sequence[ca.MX] | Mapping[int, ca.SX]
# Gradients by x, u and p
StageGradients = tuple[ca.MX, ca.MX, ca.MX]
# x' at a state
Slope = Callable[[ca.MX], ca.MX]
# Gradients at a state, from x' there and the gradient by x'
Pullback = Callable[[ca.MX, ca.MX, ca.MX], StageGradients]


def slopes(
    tableau: Tableau, rhs: ca.Function, unpaired: Callable[[int, ca.MX], ca.MX], n: int, x: ca.MX,
    u: ca.MX, p: ca.MX, h: ca.MX,
) -> list[ca.MX]:  # fmt: skip
    """The slopes x' at the stages; arguments as those of ``methods.build_step``.

    ``unpaired`` gives the slope of a stage which shares its position with no other.
    """
    k: list[ca.MX] = []
    pair = _stages_at_one_position(rhs, n)
    while (i := len(k)) < len(tableau.a):
        y = stage(tableau, i, k, x, h, n)
        if not _shares_position(tableau, i):
            k.append(unpaired(i, y))
            continue
        row = tableau.a[i + 1]
        others = x + h * weighted_sum(row[:i], k, x) if any(row[:i]) else x
        k += pair.call([y, others, h * row[i], u, p])
    return k


def stage(tableau: Tableau, i: int, slopes: Sequence[ca.MX], x: ca.MX, h: ca.MX, n: int) -> ca.MX:
    """State of stage i, or at the end of the step after the last one, as a function call."""
    rows = [*tableau.a, tableau.b]
    if not rows[i]:
        return x
    x_, *rates = (ca.SX.sym(name, x.shape[0]) for name in ("x", *"k" * len(slopes)))
    h_ = ca.SX.sym("h")
    after = x_ + h_ * weighted_sum(rows[i], rates, x_)
    acceleration = weighted_sum(tableau.positions[i], rates, x_)[n : 2 * n]
    q = x_[:n] + h_ * (sum(rows[i]) * x_[n : 2 * n] + h_ * acceleration)
    y = ca.vertcat(q, after[n:])
    return ca.Function(f"stage_{i}", [h_, x_, *rates], [y], {"cse": True})(h, x, *slopes)


def tangent(
    weights: Sequence[float], positions: Sequence[float], changes: Rates, slopes: Rates, dx: ca.SX,
    h: ca.SX, dh: ca.SX, n: int,
) -> ca.SX:  # fmt: skip
    """Derivative of the state of a ``stage``, along dx, dh and the changes dk of the slopes."""
    dw = dx + h * weighted_sum(weights, changes, dx) + dh * weighted_sum(weights, slopes, dx)
    da, a = (weighted_sum(positions, rates, dx)[n : 2 * n] for rates in (changes, slopes))
    v = slopes[0][:n]
    dq = dx[:n] + sum(weights) * (h * dx[n : 2 * n] + dh * v) + h * (h * da + 2 * dh * a)
    return ca.vertcat(dq, dw[n:])


def adjoint(
    tableau: Tableau, slope: Slope, pull: Pullback, n: int, x: ca.MX, h: ca.MX, weight: ca.MX
) -> StageGradients:
    """The transposed derivative of a step, see ``adjoints``.

    From the last stage to the first, with the gradients μ_j by the later states (q, w)_j, the last
    of which is the result:

        ∂L/∂k_i = h (Σ a_ji μ_j^v + h Σ ā_ji μ_j^q) for the velocities, h Σ a_ji μ_j^z for z,
        μ_i = (∂x'/∂x)ᵀ ∂L/∂k_i.

    The state at the beginning enters each of them as it is, and its velocity by c_j h v.

    Args:
        tableau: The method.
        slope: x' at a state.
        pull: Gradients at a state, from x' there and the gradient by x'.
        n: Degrees of freedom.
        x: State at the beginning.
        h: Length of the step.
        weight: Gradient by the state at the end.
    """
    k: list[ca.MX] = []
    y: list[ca.MX] = []
    for i in range(len(tableau.a)):
        y.append(stage(tableau, i, k, x, h, n))
        k.append(slope(y[i]))
    rows, positions = (*tableau.a, tableau.b), tableau.positions
    weights = {len(k): weight}
    by_x, by_u, by_p = weight + _gradient_by_velocity(tableau.b, weight, h, n), 0.0, 0.0
    for i in reversed(range(len(k))):
        rate = _gradient_sum(rows, i, weights)
        velocity = h * (rate[n : 2 * n] + h * _gradient_sum(positions, i, weights)[:n])
        by_slope = ca.vertcat(ca.MX.zeros(n), velocity, h * rate[2 * n :])
        weights[i], stage_by_u, stage_by_p = pull(y[i], k[i], by_slope)
        by_x = by_x + weights[i] + _gradient_by_velocity(tableau.a[i], weights[i], h, n)
        by_u, by_p = by_u + stage_by_u, by_p + stage_by_p
    return by_x, by_u, by_p


def _shares_position(tableau: Tableau, i: int) -> bool:
    """Whether stage i and the next one are at the same position."""
    a, positions = tableau.a, tableau.positions
    following = i + 1 < len(a)
    return following and (sum(a[i]), positions[i]) == (sum(a[i + 1]), positions[i + 1])


def _stages_at_one_position(rhs: ca.Function, n: int) -> ca.Function:
    """Function (y, x, s, u, p) -> k = x' at y = (q, …), and x' at q and w + s k of x = (…, w)."""
    y, u, p = (ca.SX.sym(name, rhs.size1_in(i)) for i, name in enumerate("yup"))
    x, s = ca.SX.sym("x", y.shape[0]), ca.SX.sym("s")
    first = rhs(y, u, p)
    second = rhs(ca.vertcat(y[:n], (x + s * first)[n:]), u, p)
    results = [ca.densify(first), ca.densify(second)]
    return ca.Function("at_one_position", [y, x, s, u, p], results, {"cse": True})


def _gradient_sum(rows: Sequence[Sequence[float]], i: int, weights: Mapping[int, ca.MX]) -> ca.MX:
    """Gradients of the later stages and of the result, times their weights of stage i."""
    users = [j for j in weights if i < len(rows[j]) and rows[j][i]]
    zeros = ca.MX.zeros(weights[max(weights)].shape[0])
    return sum((rows[j][i] * weights[j] for j in users), zeros)


def _gradient_by_velocity(row: Sequence[float], weight: ca.MX, h: ca.MX, n: int) -> ca.MX:
    """Gradient by x of c_i h v in the position of a stage."""
    rest = ca.MX.zeros(weight.shape[0] - 2 * n)
    return ca.vertcat(ca.MX.zeros(n), sum(row) * h * weight[:n], rest)
