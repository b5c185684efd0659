# SPDX-License-Identifier: Apache-2.0
"""Terms that task controllers evaluate at every tick, as expressions of ``equations``."""

from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from arm_dynamics.equations import rigid_body, spring
from arm_dynamics.equations.factorizations import ltdl
from arm_dynamics.equations.frame import drift, jacobian, placement
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.tree_builder import frame_of, gravity_of, tree_of
from arm_dynamics.task_space.axes import AXES, rows_of


class TaskInstant(NamedTuple):
    """The arm at one state, in the task's m axes, as numbers or expressions.

    Attributes:
        position: Position of the frame in the world in [m], shape (3,).
        rotation: Rotation of the frame in the world, shape (3, 3).
        J: Jacobian, shape (m, n).
        velocity: J v, shape (m,).
        drift: J̇ v, shape (m,).
        M: Mass matrix, shape (n, n).
        bias: C v + G + S, shape (n,).
        B: M⁻¹ Jᵀ, shape (n, m).
        A: Mobility J M⁻¹ Jᵀ, shape (m, m).
        inertia: Λ = A⁻¹, damped near a singularity, shape (m, m).
    """

    position: Any
    rotation: Any
    J: Any
    velocity: Any
    drift: Any
    M: Any
    bias: Any
    B: Any
    A: Any
    inertia: Any


def frame_functions(model: ArmModel, name: str, axes: tuple[str, ...]) -> list[ca.Function]:
    """The functions of a frame: ``state`` of q and v, ``motion`` of q, v and a.

    Results of the first are those of ``TaskInstant`` and an upper bound of 1/σ of
    ``inertia.task_inertia``, inf where Λ is no inertia, which tells a singularity; those of the
    second are position, rotation, J v and J a + J̇ v of all six axes.
    """
    tree, frame = tree_of(model), frame_of(model, name)
    q, v, a = (ca.SX.sym(letter, model.n) for letter in "qva")
    position, rotation = placement(tree, frame, q)
    J = jacobian(tree, frame, q)
    Jdot_v = drift(J, q, v)
    rows = rows_of(axes)
    gravity = gravity_of(model)
    bias = spring.frictionless(model.springs, tree, q, v, ca.SX(model.n, 1), gravity)
    M, J_task = rigid_body.mass_matrix(tree, q), J[rows, :]
    B = ltdl.solve_columns(M, J_task.T)
    A = J_task @ B
    inertia = ltdl.solve_columns(A, ca.SX.eye(len(axes)))
    scale = _scales(A, sum(axis in AXES[:3] for axis in axes))
    # The trace of the scaled Λ, whose eigenvalues are all positive if it is an inertia.
    diagonal = ca.diag(inertia)
    is_inertia = ca.logic_and(ca.mmin(diagonal) > 0, ca.mmax(diagonal) < np.inf)
    bound = ca.if_else(is_inertia, ca.sum1(scale**2 * diagonal), np.inf)
    instant = TaskInstant(
        position=position, rotation=rotation, J=J_task, velocity=J_task @ v, drift=Jdot_v[rows],
        M=M, bias=bias, B=B, A=A, inertia=inertia,
    )  # fmt: skip
    state, motion = [*instant, bound], [position, rotation, J @ v, J @ a + Jdot_v]
    return [
        ca.Function("state", [q, v], [ca.densify(x) for x in state], {"cse": True}),
        ca.Function("motion", [q, v, a], [ca.densify(x) for x in motion], {"cse": True}),
    ]


def _scales(A: ca.SX, linear: int) -> ca.SX:
    """The scales of ``inertia.task_inertia``, shape (m,)."""
    mobility, parts = ca.fmax(ca.diag(A), 0), []
    for first, end in ((0, linear), (linear, A.shape[0])):
        if first < end:
            scale = ca.sqrt(ca.sum1(mobility[first:end]) / (end - first))
            parts.append(ca.repmat(ca.if_else(scale < 1e-9, 1, scale), end - first))
    return ca.densify(ca.vertcat(*parts))
