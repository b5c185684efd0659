# SPDX-License-Identifier: Apache-2.0
"""Derivatives of a scene's equation of motion: coefficients, and propagation of tangents.

For an arm held by its joints alone, x' = (v, g) changes by H⁻¹ K d(x, u), where K is the
derivative of the residual torque of a given acceleration (Carpentier, Mansard, "Analytical
derivatives of rigid body dynamics algorithms", Robotics: Science and Systems, 2018): a fraction of
the work of differentiating forward dynamics. Loops and contacts are differentiated directly. H is
M of the free joints, with ones on the diagonal for held joints and internal states z; K is
H ∂(v̇, ż)/∂(x, w), where w are the command u and, below it, tunable quantities. Derivatives are
called slopes, x' itself ``x_dot``.
"""

from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca

from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.equations import rigid_body
from arm_dynamics.equations.derivatives import inverse_derivatives
from arm_dynamics.equations.factorizations import ltdl
from arm_dynamics.equations.forward_dynamics import DENSE_AT_MOST
from arm_sim.coefficients import Coefficients
from arm_sim.plant.plant import Plant
from arm_sim.plant.state_space import flow_with_modes, laws_with_modes, split
from arm_sim.plant.symbols import dense_function


class Slopes:
    """Derivatives of x' = f(x, u, p) by x and u, and by some of the tunable quantities in p.

    Args:
        plant: The equations.
        p_indices: Indices in p of the quantities to differentiate by.

    Attributes:
        coefficients: CasADi function (x, u, p) -> x' and the coefficients c of its derivative.
        tangent: CasADi function (c, dx, dw) -> dx', linear in dx and in the changes dw of u and
            of those quantities, one below the other.
    """

    def __init__(self, plant: Plant, p_indices: Sequence[int] = ()) -> None:
        x, u, p = (ca.SX.sym(name, plant.rhs.size1_in(i)) for i, name in enumerate("xup"))
        x_dot, n, by_p = _x_dot(plant, x, u, p), plant.model.n, p[list(p_indices), :]
        dx, dw = ca.SX.sym("dx", plant.nx), ca.SX.sym("dw", n + len(p_indices))
        c = Coefficients()
        if plant.constrained:
            J_x, J_w = (ca.jacobian(x_dot[n:], by) for by in (x, ca.vertcat(u, by_p)))
            changes = c.substitute(J_x) @ dx + c.substitute(J_w) @ dw
        else:
            K_x, K_w, H = scaled_slopes(plant, x, u, p, x_dot)
            if p_indices:
                K_w = ca.horzcat(K_w, _scaled_by_p(by_p, plant, x, u, p, x_dot))
            contacts = contact_slopes(plant, x, u, p, x_dot) if plant.mechanics.contact else None
            if contacts:
                K_x[:n, : 2 * n] += contacts.torques
            rows = c.substitute(K_x) @ dx + c.substitute(K_w) @ dw
            load, rates = ca.vertsplit(rows, [0, n, plant.nx - n])
            da = _solution(c, H[:n, :n], load)
            if contacts:
                da = da + _contact_change(c, contacts, dx[: 2 * n], da)
            changes = ca.vertcat(da, rates)
        self.coefficients = dense_function("coefficients", [x, u, p], x_dot, c.values)
        change = ca.vertcat(dx[n : 2 * n], changes)
        self.tangent = dense_function("tangent", [c.symbols, dx, dw], change)


def _solution(c: Coefficients, H: ca.SX, load: ca.SX) -> ca.SX:
    """H⁻¹ load, with the factors of H among the coefficients."""
    factors = ltdl.factorize(ca.sparsify(H))
    pivots = c.substitute(1 / ca.diag(factors))
    factors = c.substitute(ca.tril(factors, False))
    return ltdl.solve_lower(factors, pivots * ltdl.solve_upper(factors, load))


def _scaled_by_p(by_p: ca.SX, plant: Plant, x: ca.SX, u: ca.SX, p: ca.SX, x_dot: ca.SX) -> ca.SX:
    """H ∂g/∂p for some entries of p, as ``scaled_slopes`` for x and u."""
    n, a = plant.model.n, ca.SX.sym("a", plant.model.n)
    torques = ca.jacobian(residual(plant, x, u, p, a)[0], by_p)
    rows = ca.Function("rows", [x, u, p, a], [torques])(x, u, p, x_dot[n : 2 * n])
    return ca.vertcat(rows, ca.jacobian(plant.rhs(x, u, p)[2 * n :], by_p))


def _x_dot(plant: Plant, x: ca.SX, u: ca.SX, p: ca.SX) -> ca.SX:
    """x', with accelerations by the M that its derivative uses, where that is faster."""
    x_dot, n = plant.rhs(x, u, p), plant.model.n
    if n > DENSE_AT_MOST or not is_held_by_joints(plant):
        return x_dot
    at_rest = ca.SX(plant.nx, 1)
    load = residual(plant, x, u, p, at_rest[:n])[0]
    H = scaled_slopes(plant, x, u, p, at_rest)[2]
    a = ltdl.solve(ca.sparsify(H[:n, :n]), load)
    return ca.vertcat(x_dot[:n], a, x_dot[2 * n :]) if plant.nz else ca.vertcat(x_dot[:n], a)


def pullback(plant: Plant) -> ca.Function:
    """The transposed derivative of x' = f(x, u, p), for gradients of functions of x'.

    With H g = R for the residual R of ``residual``, μᵀ dg = (H⁻¹ μ)ᵀ dR at fixed
    accelerations, which is a gradient of inverse dynamics, at less than twice its cost.

    Args:
        plant: The equations.

    Returns:
        CasADi function (x, u, p, x', μ) -> f_xᵀ μ, f_uᵀ μ and, by tunable quantities, f_pᵀ μ.
    """
    x, u, p = (ca.SX.sym(name, plant.rhs.size1_in(i)) for i, name in enumerate("xup"))
    n, tunable = plant.model.n, len(plant.parameters.nominal)
    x_dot, mu = ca.SX.sym("x_dot", plant.nx), ca.SX.sym("mu", plant.nx)
    arguments = [x, u, p, x_dot, mu]
    if not is_held_by_joints(plant):
        gradients = [ca.jtimes(plant.rhs(x, u, p), by, mu, True) for by in (x, u, p)]
    else:
        R, H = residual(plant, x, u, p, x_dot[n : 2 * n])
        nu = ca.SX.sym("nu", n)
        weighted = ca.dot(nu, R) + ca.dot(mu[:n], x[n : 2 * n])
        rates = plant.rhs(x, u, p)[2 * n :]
        weighted = weighted + ca.dot(mu[2 * n :], rates) if plant.nz else weighted
        by_nu = [ca.gradient(weighted, by) for by in (x, u, p)]
        load = ltdl.solve(ca.sparsify(H), mu[n : 2 * n])
        gradients = ca.Function("g", [*arguments, nu], by_nu)(*arguments, load)
    by_x, by_u, by_p = gradients
    return dense_function("pullback", arguments, by_x, by_u, by_p[:tunable])


def is_held_by_joints(plant: Plant) -> bool:
    """Whether an arm is held by its joints alone: no loops, no contacts."""
    return not (plant.constrained or (plant.points and not plant.options.sliding))


def residual(plant: Plant, x: ca.SX, u: ca.SX, p: ca.SX, a: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Residual torque of accelerations ``a`` of free joints, and H.

    The residual is zero at the accelerations of the motion, and H is its derivative by them up to
    the sign. Shapes (n,) and (n, n).
    """
    n, s, joints = plant.model.n, plant.mechanics.symbols, plant.mechanics.joints
    q, v, _ = split(x, n)
    tau = rigid_body.inverse_dynamics(s.tree, s.q, s.v, s.tau, s.gravity)
    inertial = tau, rigid_body.mass_matrix(s.tree, s.q)
    tau, M = ca.Function("inertial", [s.q, s.v, s.tau, joints.p], inertial)(q, v, a, p)
    free, load = _free_and_load(plant, x, u, p)
    return free @ (load - tau), _inertia_of_free(free, M)


def scaled_slopes(
    plant: Plant, x: ca.SX, u: ca.SX, p: ca.SX, x_dot: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """H ∂g/∂x, H ∂g/∂u and H of x' = (v, g), without loops.

    With contacts, at constant contact forces, less the derivatives of their torques.
    """
    n, s, joints = plant.model.n, plant.mechanics.symbols, plant.mechanics.joints
    q, v, z = split(x, n)
    by_q, by_v, M = inverse_derivatives(s.tree, s.q, s.v, s.tau, s.gravity)
    inertial = ca.Function("inertial", [s.q, s.v, s.tau, joints.p], [by_q, by_v, M])
    by_q, by_v, M = inertial(q, v, x_dot[n : 2 * n], p)
    free, load = _free_and_load(plant, x, u, p)
    inertial_by_x = ca.horzcat(by_q, by_v, ca.SX(n, z.shape[0]))
    rows = ca.sparsify(free @ (ca.jacobian(load, x) - inertial_by_x))
    rates = plant.rhs(x, u, p)[2 * n :]
    K_x = ca.vertcat(rows, ca.jacobian(rates, x))
    K_u = ca.vertcat(ca.sparsify(free @ ca.jacobian(load, u)), ca.jacobian(rates, u))
    H = ca.diagcat(_inertia_of_free(free, M), ca.SX.eye(z.shape[0]))
    return K_x, K_u, H


def _inertia_of_free(free: ca.SX, M: ca.SX) -> ca.SX:
    """M of free joints, with ones on the diagonal for held ones."""
    return free @ M @ free + ca.SX.eye(M.shape[0]) - free


class ContactSlopes(NamedTuple):
    """Results of ``ContactFunctions.slopes``.

    Attributes:
        torques: Derivatives of the torques of constant contact forces by q and v.
        rates: Derivatives of the accelerations of the active rows by q and v, at constant q̈.
        rows: The active rows.
        mobility: Accelerations of the joints per unknown force.
        forces: Minus the unknown forces per acceleration of the rows.
    """

    torques: ca.SX
    rates: ca.SX
    rows: ca.SX
    mobility: ca.SX
    forces: ca.SX


def contact_slopes(plant: Plant, x: ca.SX, u: ca.SX, p: ca.SX, x_dot: ca.SX) -> ContactSlopes:
    """Derivatives of the contacts' forces and accelerations."""
    n, contact = plant.model.n, plant.mechanics.contact
    assert contact is not None
    q, v, _ = split(x, n)
    force, tau = plant.events["loads"](x, u, p)[1], _torque(plant, x, u, p)
    return ContactSlopes(*contact.slopes()(q, v, tau, p, x_dot[n : 2 * n], force))


def _contact_change(c: Coefficients, slopes: ContactSlopes, dx: ca.SX, da: ca.SX) -> ca.SX:
    """What the forces of contacts add to the change ``da`` at constant forces."""
    violation = c.substitute(slopes.rates) @ dx + c.substitute(slopes.rows) @ da
    mobility, forces = c.substitute(slopes.mobility), c.substitute(slopes.forces)
    return mobility @ (forces @ violation)


@one_at_a_time
def scaled_jacobian(plant: Plant) -> ca.Function | None:
    """The Jacobian of x' = (v, g) by x = (q, w), scaled to preserve a tree's sparsity.

    Returns:
        CasADi function (x, u, p, x') -> H ∂g/∂q, H ∂g/∂w, H, sparse; or None for short arms, and
        for arms with loops or contacts, where the Jacobian itself is as good.
    """
    n = plant.model.n
    if n <= DENSE_AT_MOST or not is_held_by_joints(plant):
        return None
    x, u, p = (ca.SX.sym(name, plant.rhs.size1_in(i)) for i, name in enumerate("xup"))
    x_dot = ca.SX.sym("x_dot", plant.nx)
    K, _, H = scaled_slopes(plant, x, u, p, x_dot)
    parts = [ca.sparsify(part) for part in (K[:, :n], K[:, n:], H)]
    return ca.Function("jacobian", [x, u, p, x_dot], parts, {"cse": True})


def _free_and_load(plant: Plant, x: ca.SX, u: ca.SX, p: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Diagonal with ones for free joints, and the load on them besides inertia."""
    s, joints = plant.mechanics.symbols, plant.mechanics.joints
    q, v, _ = split(x, plant.model.n)
    load = s.tau - s.passive - joints.friction + joints.stop
    load_of = ca.Function("load", [s.q, s.v, s.tau, joints.p], [load])
    free = ca.Function("free", [joints.p], [ca.diag(joints.sliding)])(p)
    return free, load_of(q, v, _torque(plant, x, u, p), p)


def _torque(plant: Plant, x: ca.SX, u: ca.SX, p: ca.SX) -> ca.SX:
    """Torque of drives and laws with states on the links, shape (n,)."""
    laws = laws_with_modes(plant.laws, plant.mechanics)
    return flow_with_modes(laws, plant.mechanics, *split(x, plant.model.n), u, p)[0]
