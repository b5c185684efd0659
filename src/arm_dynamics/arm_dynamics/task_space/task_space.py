# SPDX-License-Identifier: Apache-2.0
"""Dynamics of an arm in the task space of one of its frames: f = Λ ẍ + µ + p + s.

Source: Khatib, "A unified approach for motion and force control of robot manipulators: the
operational space formulation", IEEE J. Robotics and Automation 3(1), 1987. Craig writes Λ, µ and p
as M_x, V_x and G_x (Introduction to Robotics, section 6.9). The force s is that of springs, S, in
task space, as p is that of gravity, G.
"""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array, each, real_number, unit_vector, vectors
from arm_dynamics.attributes import frozen, sealed
from arm_dynamics.dynamics.dynamics import Dynamics, model_of
from arm_dynamics.dynamics.gauss import times
from arm_dynamics.exceptions import InvalidInput, ModelError
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.frame_motion import FrameMotion, check_moving
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.task_space.axes import AXES, chosen_axes, rows_of
from arm_dynamics.task_space.inertia import (
    THRESHOLD,
    condition_number,
    manipulability,
    scales,
    task_inertia,
)
from arm_dynamics.task_space.instant import TaskInstant


@frozen
class Pose:
    """Placement of a frame in the world.

    Attributes:
        position: Position in [m], shape (3,) or (k, 3).
        rotation: Rotation matrix, its columns the frame's axes, shape (3, 3) or (k, 3, 3).
    """

    position: Array
    rotation: Array


@frozen
class TaskTerms:
    """The arm at one state, in the task's m axes; a batch has k in front of every shape.

    Attributes:
        position: Position of the frame in the world in [m], shape (3,).
        rotation: Rotation of the frame in the world, shape (3, 3).
        jacobian: J, with ẋ = J q̇, shape (m, n).
        velocity: ẋ = J q̇ in [m/s] and [rad/s], shape (m,).
        bias: J̇ q̇, the acceleration at zero joint acceleration, shape (m,).
        inertia: Λ = (J M⁻¹ Jᵀ)⁻¹ in [kg], [kg m], [kg m²], shape (m, m).
        coriolis: µ = Λ (J M⁻¹ C q̇ - J̇ q̇) in [N] and [N m], shape (m,).
        gravity: p = Λ J M⁻¹ G in [N] and [N m], shape (m,).
        spring: s = Λ J M⁻¹ S in [N] and [N m], shape (m,); zero without springs.
        inverse: J̄ = M⁻¹ Jᵀ Λ, the dynamically consistent inverse of J, shape (n, m).
        null_space: P = 1 - J̄ J: velocities P z do not move the frame, torques Pᵀ z do not
            accelerate it, shape (n, n).
        manipulability: √det(J Jᵀ), zero at a singularity.
        condition: Ratio of the singular values of J, inf at a singularity.
        damped: Whether the state is so near a singularity that Λ, µ, p, s, J̄ and P were
            damped.
    """

    position: Array
    rotation: Array
    jacobian: Array
    velocity: Array
    bias: Array
    inertia: Array
    coriolis: Array
    gravity: Array
    spring: Array
    inverse: Array
    null_space: Array
    manipulability: Any
    condition: Any
    damped: Any


@frozen
class EffectiveMass:
    """Effective mass along a direction.

    Attributes:
        mass: In [kg] along an axis or [kg m²] about one; a float, or shape (k,).
        damped: Whether the direction is (nearly) immobile and its infinite mass was bounded.
    """

    mass: Any
    damped: Any


@frozen
class MassEllipsoid:
    """Principal effective masses.

    Attributes:
        masses: From light to heavy in [kg] or [kg m²], shape (m,) or (k, m).
        axes: Their directions as columns, shape (m, m) or (k, m, m).
        damped: Whether a mass, truly infinite, was bounded.
    """

    masses: Array
    axes: Array
    damped: Any


@sealed
class TaskSpace:
    """Dynamics at a frame; keep one instance per thread.

    Methods take vectors of shape (n,) or batches (k, n), as those of ``Dynamics``. In the frame
    ``local`` the rates are those of the components along the moving axes.

    Args:
        dynamics: A ``Dynamics`` or an ``ArmModel``.
        frame: Name of a frame that moves.
        reference: Axes and point of the velocities: ``local_world_aligned`` (the frame's origin,
            axes of the world), ``local`` (axes of the frame), ``world`` (spatial velocity at the
            world's origin).
        selection: ``pose``, ``position``, ``orientation``, or some of x, y, z, rx, ry, rz.
        threshold: Scaled mobility, dimensionless, below which results are damped; see
            ``inertia.task_inertia``.

    Attributes:
        model: The arm.
        frame: The frame as given, likewise ``reference`` and ``threshold``.
        axes: Names of the m axes.
        rows: Which of the six axes these are, for rows of a Jacobian.
        linear: Number of linear ones among them, which come first.
        rigid: Terms of the arm in joint space.
        motion: Kinematics of the frame.

    Raises:
        InvalidInput: If a name is unknown or the threshold is not in (0, 1).

    Example:
        >>> hand = TaskSpace(Dynamics("panda.yaml"), "panda_hand", selection="position")
        >>> hand.effective_mass(q, [0, 0, 1]).mass  # doctest: +SKIP
    """

    def __init__(
        self,
        dynamics: Dynamics | ArmModel,
        frame: str,
        reference: str = "local_world_aligned",
        selection: str | Iterable[str] = "pose",
        threshold: float = THRESHOLD,
    ) -> None:
        self.model = model_of(dynamics)
        self.frame, self.reference = frame, reference
        self.axes = chosen_axes(selection)
        self.threshold = real_number(threshold)
        if not 0.0 < self.threshold < 1.0:
            raise InvalidInput(f"threshold = {threshold!r}; allowed: a number between 0 and 1")
        self.rows = rows_of(self.axes)
        self.linear = sum(axis in AXES[:3] for axis in self.axes)
        check_moving(self.model, frame)
        self.rigid = RigidTerms(self.model)
        self.motion = FrameMotion(self.model, frame, reference)

    @property
    def n(self) -> int:
        """Degrees of freedom of the arm."""
        return self.model.n

    @property
    def m(self) -> int:
        """Number of axes of the task."""
        return len(self.axes)

    def require_world_axes(self) -> None:
        """Reject a task in other axes than ``local_world_aligned``.

        Raises:
            InvalidInput: Saying so.
        """
        if self.reference != "local_world_aligned":
            raise InvalidInput(
                f"reference = '{self.reference}' of the task; 'local_world_aligned' is expected"
            )

    def pose(self, q: ArrayLike) -> Pose:
        """Pose of the frame, for positions ``q`` in [rad] or [m], shape (n,) or (k, n)."""
        position, rotation = _rows(self.motion.placement, *vectors(self.model.joint_names, q=q))
        return Pose(_plain(position), _plain(rotation))

    def jacobian(self, q: ArrayLike) -> Array:
        """J of shape (m, n) or (k, m, n)."""
        return each(
            lambda qi: self.motion.jacobian(qi)[self.rows], *vectors(self.model.joint_names, q=q)
        )

    def jacobian_rate(self, q: ArrayLike, v: ArrayLike) -> Array:
        """J̇ of shape (m, n) or (k, m, n)."""
        return each(self._jacobian_rate, *vectors(self.model.joint_names, q=q, v=v))

    def bias(self, q: ArrayLike, v: ArrayLike) -> Array:
        """J̇ v in [m/s²] and [rad/s²], shape (m,) or (k, m)."""
        return each(
            lambda qi, vi: self._jacobian_rate(qi, vi) @ vi,
            *vectors(self.model.joint_names, q=q, v=v),
        )

    def terms(self, q: ArrayLike, v: ArrayLike | None = None) -> TaskTerms:
        """All terms at a state, see ``TaskTerms``.

        Args:
            q: Joint positions in [rad] or [m], shape (n,) or (k, n).
            v: Joint velocities in [rad/s] or [m/s], likewise; None for rest.

        Raises:
            InvalidInput: If a shape or value is not allowed.
            ModelError: If a joint that carries the frame moves no mass.
        """
        still = np.zeros(self.n) if v is None else v
        q, v = vectors(self.model.joint_names, q=q, v=still)
        position, rotation, J, J_dot, W, bias, gravity, spring = _rows(self._state, q, v)
        A, drift = self._mobility(J, W), times(J_dot, v)
        inertia = task_inertia(A, self.linear, self.threshold)
        JW, L = J @ W, inertia.matrix
        J_bar = np.swapaxes(JW, -1, -2) @ L
        return TaskTerms(
            position=_plain(position),
            rotation=_plain(rotation),
            jacobian=_plain(J),
            velocity=_plain(times(J, v)),
            bias=_plain(drift),
            inertia=_plain(L),
            coriolis=_plain(times(L, times(JW, bias - gravity) - drift)),
            gravity=_plain(times(L, times(JW, gravity))),
            spring=_plain(times(L, times(JW, spring))),
            inverse=_plain(J_bar),
            null_space=_plain(np.eye(self.n) - J_bar @ J),
            manipulability=_plain(manipulability(J)),
            condition=_plain(condition_number(J)),
            damped=_plain(inertia.damped),
        )

    def instant(self, q: Array, v: Array) -> TaskInstant:
        """The terms of controllers at a state, for valid vectors of shape (n,).

        Raises:
            ModelError: If a joint that carries the frame moves no mass.
        """
        frame, rigid = self.motion.moving(q, v), self.rigid
        J, W = frame.jacobian[self.rows], rigid.mobility(q)
        A = self._mobility(J, W)
        inertia = task_inertia(A, self.linear, self.threshold)
        return TaskInstant(
            position=frame.position,
            rotation=frame.rotation,
            J=J,
            velocity=J @ v,
            drift=frame.jacobian_rate[self.rows] @ v,
            M=rigid.mass(q),
            bias=rigid.bias(q, v) + rigid.spring(q, v),
            B=W @ J.T,
            A=A,
            # Where nothing is damped, the inverse that the expressions take, too.
            inertia=inertia.matrix if inertia.damped else np.linalg.inv(A),
        )

    def effective_mass(self, q: ArrayLike, direction: ArrayLike) -> EffectiveMass:
        """Effective mass for a force along a direction: 1 / (uᵀ Λ⁻¹ u).

        Force per acceleration along ``u``, the frame free to give way in all other directions
        (Khatib, "Inertial properties in robotic manipulation", IJRR 14(1), 1995, equation (22)).

        Args:
            q: Joint positions in [rad] or [m], shape (n,) or (k, n).
            direction: In the task's axes, shape (m,), any length but zero.

        Raises:
            InvalidInput: If a shape or value is not allowed.
            ModelError: If a joint that carries the frame moves no mass.
        """
        (q,), u = vectors(self.model.joint_names, q=q), unit_vector("direction", direction, self.m)
        A = self._mobility(*_rows(self._at_rest, q))
        reference = np.square(scales(A, self.linear) * u).sum(-1)
        mobility, floor = (A @ u) @ u, self.threshold * reference
        damped = mobility < floor
        return EffectiveMass(_plain(1.0 / np.maximum(mobility, floor)), _plain(damped))

    def mass_ellipsoid(self, q: ArrayLike) -> MassEllipsoid:
        """Principal effective masses: eigenvectors of Λ, for axes of one kind.

        Args:
            q: Joint positions in [rad] or [m], shape (n,) or (k, n).

        Raises:
            InvalidInput: If the task has linear and angular axes, which do not compare.
            ModelError: If a joint that carries the frame moves no mass.
        """
        if self.linear not in (0, self.m):
            raise InvalidInput(
                f"an ellipsoid over {self.axes} mixes kg and kg m²; allowed: tasks of linear "
                "or of angular axes alone"
            )
        A = self._mobility(*_rows(self._at_rest, *vectors(self.model.joint_names, q=q)))
        values, axes = np.linalg.eigh(A)
        floor = self.threshold * np.maximum(values.mean(-1, keepdims=True), 1e-12)
        masses = 1.0 / np.maximum(values, floor)
        damped = (values < floor).any(-1)
        return MassEllipsoid(*map(_plain, (masses[..., ::-1], axes[..., ::-1], damped)))

    def _state(self, q: Array, v: Array) -> tuple[Array, ...]:
        """Position, rotation, J, J̇, M⁻¹, C v + G, G and S."""
        position, rotation, J, J_dot = self.motion.moving(q, v)
        rows, rigid = self.rows, self.rigid
        terms = rigid.mobility(q), rigid.bias(q, v), rigid.gravity(q), rigid.spring(q, v)
        return position, rotation, J[rows], J_dot[rows], *terms

    def _at_rest(self, q: Array) -> tuple[Array, Array]:
        """J and M⁻¹."""
        return self.motion.jacobian(q)[self.rows], self.rigid.mobility(q)

    def _jacobian_rate(self, q: Array, v: Array) -> Array:
        return self.motion.moving(q, v).jacobian_rate[self.rows]

    def _mobility(self, J: Array, W: Array) -> Array:
        """A = J M⁻¹ Jᵀ for W = M⁻¹."""
        A = J @ W @ np.swapaxes(J, -1, -2)
        if not np.isfinite(A).all():
            raise ModelError(
                f"a joint that carries frame '{self.frame}' moves no mass; give its links "
                "inertia, the joint an armature, or lock it"
            )
        return 0.5 * (A + np.swapaxes(A, -1, -2))


def _rows(answer: Callable[..., tuple[Array, ...]], *vectors: Array) -> tuple[Array, ...]:
    """``arrays.each`` for a function whose result has several parts."""
    parts = answer(*vectors) if vectors[0].ndim == 1 else zip(*map(answer, *vectors), strict=True)
    return tuple(map(np.array, parts))


def _plain(value: Any) -> Any:
    """Read-only arrays; single numbers as Python floats."""
    array = np.asarray(value)
    if array.ndim == 0:
        return array.item()
    array.setflags(write=False)
    return array
