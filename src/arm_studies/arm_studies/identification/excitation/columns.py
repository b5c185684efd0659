# SPDX-License-Identifier: Apache-2.0
"""Information of a motion about an arm: the regressor of its torques, as expressions.

Torques are linear in the parameters to be identified, τ = W(q, v, a) π (Khalil and Dombre,
Modeling, Identification and Control of Robots, 2002, chapter 12): for each link the inertial
parameters that its joint can distinguish from its parent's, and for each joint the inertia of its
drive, viscous and Coulomb friction and an offset. Combinations that no motion can separate are
grouped by the singular value decomposition of W at random states.
"""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.equations import rigid_body
from arm_dynamics.equations.tree import Link, Tree, constant
from arm_dynamics.model import ArmModel
from arm_dynamics.model.tree_builder import gravity_of, tree_of

_DEPENDENT = 1e-9  # singular values, relative to the largest, that are zero but for rounding


@one_at_a_time
def regressor(model: ArmModel, transition: Array) -> ca.Function:
    """W of standard parameters as a function of q, v and a, each of shape (n,).

    Args:
        model: The arm.
        transition: Speed over which the column of Coulomb friction changes its sign, shape (n,).

    Returns:
        A function whose result has shape (n, columns).
    """
    n = model.n
    q, v, a = (ca.SX.sym(name, n) for name in "qva")
    links, symbols = zip(*(_symbolic(link) for link in tree_of(model).links), strict=True)
    inertial = of_bodies(model, links, ca.vertcat(*symbols), (q, v, a))
    W = ca.densify(ca.horzcat(inertial, *friction_columns(v, a, transition), ca.SX.eye(n)))
    return ca.Function("regressor", [q, v, a], [W], {"cse": True})


def of_bodies(
    model: ArmModel, links: Sequence[Link], numbers: ca.SX, state: tuple[ca.SX, ca.SX, ca.SX]
) -> ca.SX:
    """Columns of the torques of some links by numbers in which these are linear."""
    tree = tree_of(model)
    bodies = Tree(tuple(links), np.zeros(len(links)), tree.followers, tree.offsets)
    return ca.jacobian(rigid_body.inverse_dynamics(bodies, *state, gravity_of(model)), numbers)


def friction_columns(v: ca.SX, a: ca.SX, transition: Array) -> list[ca.SX]:
    """Columns of armature, viscous and Coulomb friction, each of shape (n, n)."""
    return [ca.diag(x) for x in (a, v, ca.tanh(v / transition))]


def _symbolic(link: Link) -> tuple[Link, ca.SX]:
    """The link with symbols for the inertias that ``tree.regrouped`` leaves, and the symbols."""
    if link.prismatic:
        m = ca.SX.sym("m")
        return Link(link.parent, True, link.R, link.p, m, ca.SX(3, 1), ca.SX(3, 3)), m
    x = ca.SX.sym("x", 7)
    rows = (x[2], x[3], x[4]), (x[3], 0, x[5]), (x[4], x[5], x[6])
    inertia = ca.vertcat(*(ca.horzcat(*row) for row in rows))
    h = ca.vertcat(x[0], x[1], 0)
    return Link(link.parent, False, link.R, link.p, ca.SX(0), h, inertia), x


@one_at_a_time
def distinct(W: ca.Function, states: Array, weight: Array) -> ca.Function:
    """Independent combinations of the columns, of similar size at random states.

    A basis of the row space of W, each vector divided by its singular value; rank and optimum of
    the determinant of a motion's regressor are the same in any basis.

    Args:
        W: See ``regressor``.
        states: Random q, v and a, shape (k, 3, n).
        weight: Of the torque of each joint, shape (n,).

    Returns:
        A function of q, v and a whose result has shape (independent columns, n): transposed.
    """
    rows = np.vstack([weight[:, None] * W(*state).full() for state in states])
    _, sigma, V = np.linalg.svd(rows, full_matrices=False)
    kept = sigma > _DEPENDENT * sigma[0]
    K = V[kept] / sigma[kept, None] * np.sqrt(len(states))
    n = len(weight)
    q, v, a = (ca.SX.sym(name, n) for name in "qva")
    scaled = ca.DM(K) @ (constant(np.diag(weight)) @ W(q, v, a)).T
    return ca.Function("distinct", [q, v, a], [scaled], {"cse": True})


def random_states(lower: Array, upper: Array, v: Array, a: Array, count: int) -> Array:
    """Random q, v and a within limits, reproducible, shape (count, 3, n)."""
    rng, n = np.random.default_rng(0), len(lower)
    u = rng.uniform(-1.0, 1.0, (count, 3, n))
    middle, half = (lower + upper) / 2.0, (upper - lower) / 2.0
    return np.stack([middle + half * u[:, 0], v * u[:, 1], a * u[:, 2]], axis=1)


def information(Wt: ca.MX) -> ca.MX:
    """Log det(W Wᵀ) of a wide matrix by Cholesky factors, which a D-optimal motion maximizes.

    Args:
        Wt: Shape (columns, rows).
    """
    M = ca.SX.sym("M", ca.Sparsity.lower(Wt.shape[0]))
    R = ca.chol(ca.tril2symm(M))
    logdet = ca.Function("logdet", [M], [2.0 * ca.sum1(ca.log(ca.diag(R)))])
    return logdet(ca.tril(Wt @ Wt.T))
