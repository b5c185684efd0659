# SPDX-License-Identifier: Apache-2.0
"""Terms that task controllers evaluate at every tick, compiled into a single call.

The expressions are those of ``equations``; each kernel is checked against Pinocchio when built.
"""

from __future__ import annotations

from typing import NamedTuple
from weakref import WeakKeyDictionary

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.kernel import Kernel
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.equations import rigid_body, spring
from arm_dynamics.equations.frame import drift, jacobian, placement
from arm_dynamics.exceptions import ModelError
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.pinocchio_terms import FrameMotion, RigidTerms
from arm_dynamics.model.tree_builder import frame_of, gravity_of, tree_of
from arm_dynamics.task_space.axes import AXES, rows_of
from arm_dynamics.task_space.inertia import regularized
from arm_dynamics.terms.verify import compare, random_states


class TaskInstant(NamedTuple):
    """The arm at one state, in the task's m axes; overwritten by the next call.

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

    position: Array
    rotation: Array
    J: Array
    velocity: Array
    drift: Array
    M: Array
    bias: Array
    B: Array
    A: Array
    inertia: Array


class TaskKernel:
    """States and references of one frame, compiled; keep one instance per thread.

    Args:
        model: The model.
        frame: Name of a frame that moves.
        axes: Axes of the task, as from ``axes.chosen_axes``.
        threshold: As that of ``TaskSpace``.

    Raises:
        ModelError: If a joint that carries the frame moves no mass.
        KernelError: If generated code differs from Pinocchio, or cannot be compiled.
    """

    def __init__(
        self, model: ArmModel, frame: str, axes: tuple[str, ...], threshold: float
    ) -> None:
        self._threshold, self._bound = threshold, 1.0 / threshold
        kernel = build(model, frame, axes)
        self._state, self._motion = kernel.call("state"), kernel.call("meant")
        self._instant = _instant(self._state.outputs, model.n, len(axes))
        self._scaled = self._state.outputs[-2].reshape((len(axes), -1), order="F")

    def state(self, q: Array, v: Array) -> TaskInstant:
        """All terms at a state, for valid vectors of shape (n,)."""
        *_, bound, _, scale = self._state(q, v)
        if bound[0] < self._bound:
            return self._instant
        damped = regularized(self._scaled, scale, self._threshold)
        return self._instant._replace(inertia=damped.matrix)

    def frame_motion(self, q: Array, v: Array, a: Array) -> tuple[Array, Array, Array, Array]:
        """Position, rotation, J v and J a + J̇ v of all six axes, for a joint reference.

        Shapes (3,), (3, 3), (6,) and (6,), axes of the world; overwritten by the next call.
        """
        position, rotation, velocity, acceleration = self._motion(q, v, a)
        return position, rotation, velocity, acceleration


_built: WeakKeyDictionary[ArmModel, dict[tuple[str, tuple[str, ...]], Kernel]]
_built = WeakKeyDictionary()


def build(model: ArmModel, frame: str, axes: tuple[str, ...]) -> Kernel:
    """The functions of a frame, built once for a model; see ``TaskKernel``, errors included."""
    known = _built.setdefault(model, {})
    if (frame, axes) not in known:
        known[frame, axes] = _compiled(model, frame, axes)
    return known[frame, axes]


@one_at_a_time
def _compiled(model: ArmModel, frame: str, axes: tuple[str, ...]) -> Kernel:
    kernel = Kernel(expressions(model, frame, axes))
    _check(kernel, model, frame, axes)
    return kernel


def expressions(model: ArmModel, name: str, axes: tuple[str, ...]) -> list[ca.Function]:
    """The functions of a frame: ``state`` of q and v, ``meant`` of q, v and a.

    Results of the first are those of ``TaskInstant`` and three that tell a singularity: a bound of
    1/σ of ``inertia.task_inertia``, its scaled mobility and scales; those of the second are of
    ``TaskKernel.frame_motion``.
    """
    tree, frame = tree_of(model), frame_of(model, name)
    q, v, a = (ca.SX.sym(letter, model.n) for letter in "qva")
    placed = placement(tree, frame, q)
    J = jacobian(tree, frame, q)
    moving = drift(J, q, v)
    rows = [AXES.index(axis) for axis in axes]
    gravity = gravity_of(model)
    bias = spring.frictionless(model.springs, tree, q, v, ca.SX(model.n, 1), gravity)
    M, part = rigid_body.mass_matrix(tree, q), J[rows, :]
    B = _solved(M, part.T)
    A = part @ B
    inertia = _solved(A, ca.SX.eye(len(rows)))
    scale = _scales(A, sum(axis in AXES[:3] for axis in axes))
    bound, scaled = _largest(inertia, scale), A / (scale @ scale.T)
    state = [*placed, part, part @ v, moving[rows], M, bias, B, A, inertia, bound, scaled, scale]
    motion = [*placed, J @ v, J @ a + moving]
    return [
        ca.Function("state", [q, v], [ca.densify(x) for x in state], {"cse": True}),
        ca.Function("meant", [q, v, a], [ca.densify(x) for x in motion], {"cse": True}),
    ]


def _instant(outputs: tuple[Array, ...], n: int, m: int) -> TaskInstant:
    """The outputs of a kernel as matrices, including those of a single column."""
    shapes = ((3,), (3, 3), (m, n), (m,), (m,), (n, n), (n,), (n, m), (m, m), (m, m))
    return TaskInstant._make(
        memory.reshape(shape, order="F") for memory, shape in zip(outputs, shapes, strict=False)
    )


def _solved(matrix: ca.SX, right: ca.SX) -> ca.SX:
    """Solve for every column; common subexpressions are computed once (``cse``)."""
    return ca.horzcat(*[rigid_body.solve(matrix, column) for column in ca.horzsplit(right)])


def _scales(A: ca.SX, linear: int) -> ca.SX:
    """The scales of ``inertia.task_inertia``, shape (m,)."""
    mobility, parts = ca.fmax(ca.diag(A), 0), []
    for first, end in ((0, linear), (linear, A.shape[0])):
        if first < end:
            scale = ca.sqrt(ca.sum1(mobility[first:end]) / (end - first))
            parts.append(ca.repmat(ca.if_else(scale < 1e-9, 1, scale), end - first))
    return ca.densify(ca.vertcat(*parts))


def _largest(inertia: ca.SX, scale: ca.SX) -> ca.SX:
    """Upper bound of the largest eigenvalue of the scaled Λ; inf where Λ is not an inertia.

    This is its trace, since all eigenvalues of an inertia are positive.
    """
    mass = ca.diag(inertia)
    sound = ca.logic_and(ca.mmin(mass) > 0, ca.mmax(mass) < np.inf)
    return ca.if_else(sound, ca.sum1(scale**2 * mass), np.inf)


def _check(kernel: Kernel, model: ArmModel, frame: str, axes: tuple[str, ...]) -> None:
    """Check a kernel at random states; errors as those of ``TaskKernel``."""
    rigid, motion = RigidTerms(model), FrameMotion(model, frame, "local_world_aligned")
    rows, state = rows_of(axes), kernel.call("state")
    now = _instant(state.outputs, model.n, len(axes))
    for q, v in np.swapaxes(random_states(model.n, 2), 0, 1):
        state(q, v)
        if not np.isfinite(now.B).all():
            raise ModelError(
                f"a joint that carries frame '{frame}' moves no mass; give its links inertia, "
                "the joint an armature, or lock it"
            )
        position, rotation, J, J_dot = motion.moving(q, v)
        M, bias = rigid.mass(q), rigid.bias(q, v) + rigid.spring(q, v)
        for what, made, expected in (
            ("position", now.position, position),
            ("rotation", now.rotation, rotation),
            ("J", now.J, J[rows]),
            ("J' v", now.drift, J_dot[rows] @ v),
            ("M", now.M, M),
            ("C v + G + S", now.bias, bias),
            ("M inverse", M @ now.B, J[rows].T),
        ):
            size = np.maximum(abs(expected), 1.0)
            compare(f"{what} of frame '{frame}'", ((made - expected)[None], size[None]))
