# SPDX-License-Identifier: Apache-2.0
"""Controllers in task space: motion, motion and force, impedance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, cast

import casadi as ca
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.arrays import Array, unit_vector, vector
from arm_dynamics.attributes import sealed
from arm_dynamics.control.controller import ArmState, Controller, checked
from arm_dynamics.control.friction_compensation import friction_feed_forward
from arm_dynamics.control.law import Parts
from arm_dynamics.control.pole_placement import gain, gains
from arm_dynamics.equations.elementary import root
from arm_dynamics.equations.frame import rotation_vector
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.task_space.inertia import axis_masses
from arm_dynamics.task_space.instant import TaskInstant, frame_functions
from arm_dynamics.task_space.task_space import TaskSpace
from arm_dynamics.trajectory.reference import Reference, TaskReference

# A controller of a frame of the arm
TaskController = Controller[TaskReference]


class _TaskLaw:
    """A controller by a formula of the task's motion."""

    _dynamics: _TaskDynamics
    tuning: tuple[Array, ...]

    @property
    def key(self) -> tuple[Any, ...] | None:
        """What the formula depends on besides the task; see ``law.Law``."""
        return None if self._dynamics.key is None else (type(self).__name__, *self._dynamics.key)

    def torque(self, state: ArmState, reference: TaskReference) -> Array:
        """Return joint torques in [N m] or [N], shape (n,)."""
        inputs = self._dynamics.inputs(state, reference)
        return np.asarray(self.task_law(inputs, reference, self.tuning))

    def task_law(self, inputs: TaskInput, reference: TaskReference, tuning: Sequence[Any]) -> Any:
        """The torque, for numbers and expressions."""
        raise NotImplementedError


@sealed
class OperationalSpace(_TaskLaw):
    """Computed torque in the task's axes: ẍ = ẍ_d + K_d ė + K_p e, with posture in the null space.

    τ = Jᵀ (Λ (ẍ - J̇ q̇) + µ + p + s) + Pᵀ τ_posture, evaluated as inverse dynamics of the posture's
    acceleration q̈_p and a force on top, M q̈_p + C q̇ + G + S + Jᵀ Λ (ẍ - J̇ q̇ - J q̈_p), which is
    the same (Khatib 1987; see ``task_space``). Near a singularity Λ is damped: the arm yields
    in the singular direction.
    """

    def __init__(
        self, task: TaskSpace, bandwidth: ArrayLike = 20.0, damping_ratio: ArrayLike = 1.0,
        posture: ArrayLike | None = None, posture_bandwidth: ArrayLike = 4.0,
        friction: bool = False,
    ) -> None:  # fmt: skip
        """Choose gains.

        Args:
            task: The task, in axes ``local_world_aligned``; used from one thread only.
            bandwidth: ω in [rad/s] of every axis, a number or shape (m,).
            damping_ratio: ζ of every axis, likewise.
            posture: Preferred joint positions, shape (n,); None to only damp the null space.
            posture_bandwidth: ω of the posture in [rad/s], a number or shape (n,).
            friction: Whether to feed the model's friction forward.

        Raises:
            InvalidInput: If a number has a wrong shape or value, or the axes are others.
        """
        self._dynamics = _TaskDynamics(task, posture, posture_bandwidth, friction)
        self.tuning = *self._dynamics.tuning, *gains(bandwidth, damping_ratio, task.m)

    def task_law(self, inputs: TaskInput, reference: TaskReference, tuning: Sequence[Any]) -> Any:
        """The torque, for numbers and expressions."""
        *posture_gains, kp, kd = tuning
        desired = inputs.acceleration + kd * inputs.error_rate + kp * inputs.error
        return self._dynamics.torque(inputs, reference, desired, posture_gains)


@sealed
class MotionForce(_TaskLaw):
    """Operational-space motion in all directions but one, and a force along that one.

    Along the direction the frame presses with ``reference.force`` and only brakes: at rest in
    contact exactly this force acts on the surface (Khatib 1987, section V, for one direction).
    """

    def __init__(
        self, task: TaskSpace, direction: ArrayLike, bandwidth: ArrayLike = 20.0,
        damping_ratio: ArrayLike = 1.0, posture: ArrayLike | None = None,
        posture_bandwidth: ArrayLike = 4.0, friction: bool = False,
    ) -> None:  # fmt: skip
        """Choose the direction in the world, shape (3,); the rest is as in ``OperationalSpace``.

        Raises:
            InvalidInput: If the direction is zero or not among the task's axes, and as there.
        """
        self._dynamics = _TaskDynamics(task, posture, posture_bandwidth, friction)
        kp, kd = gains(bandwidth, damping_ratio, task.m)
        u = unit_vector("direction", direction, 3)
        along = np.concatenate([u, np.zeros(3)])[task.rows]
        if np.linalg.norm(along) < 1.0 - 1e-9:
            raise InvalidInput(f"direction = {u} is not among the axes of the task, {task.axes}")
        square = np.outer(along, along)
        across, brake = np.eye(task.m) - square, (kd @ along**2) * square
        self.tuning = *self._dynamics.tuning, kp, kd, along, across, brake

    def task_law(self, inputs: TaskInput, reference: TaskReference, tuning: Sequence[Any]) -> Any:
        """The torque, for numbers and expressions."""
        *posture_gains, kp, kd, along, across, brake = tuning
        desired = inputs.acceleration + kd * inputs.error_rate + kp * inputs.error
        desired = across @ desired - brake @ inputs.arm.velocity
        motion_torque = self._dynamics.torque(inputs, reference, desired, posture_gains)
        return motion_torque + inputs.arm.J.T @ (reference.force * along)


@sealed
class CartesianImpedance(_TaskLaw):
    """The frame as springs and dampers about its path: Λ ë + D ė + K e = -f_ext.

    The arm keeps its own effective inertia, so no force need be measured (Hogan, "Impedance
    control", ASME J. Dyn. Sys. Meas. Control 107, 1985; Ott, Cartesian Impedance Control of
    Redundant and Flexible-Joint Robots, 2008, section 3.2). D = 2 ζ √(K m) with m the mass
    of each axis, see ``inertia.axis_masses``.
    """

    def __init__(
        self, task: TaskSpace, stiffness: ArrayLike, damping_ratio: ArrayLike = 0.7,
        posture: ArrayLike | None = None, posture_bandwidth: ArrayLike = 4.0,
        friction: bool = False, damping: ArrayLike | None = None,
    ) -> None:  # fmt: skip
        """Choose stiffness and damping.

        Args:
            task: The task, in axes ``local_world_aligned``; used from one thread only.
            stiffness: K in [N/m] and [N m/rad], a number or shape (m,), not negative.
            damping_ratio: ζ of every axis alone, likewise.
            posture: As in ``OperationalSpace``.
            posture_bandwidth: Likewise.
            friction: Likewise.
            damping: D in [N s/m] and [N m s/rad] in place of the ratio, likewise.

        Raises:
            InvalidInput: If a number has a wrong shape or value, or the axes are others.
        """
        self._dynamics = _TaskDynamics(task, posture, posture_bandwidth, friction)
        self._has_damping_ratio = damping is None
        ratio = 2.0 * gain("damping_ratio", damping_ratio, task.m)
        resistance = ratio if damping is None else gain("damping", damping, task.m)
        self.tuning = *self._dynamics.tuning, gain("stiffness", stiffness, task.m), resistance

    @property
    def key(self) -> tuple[Any, ...] | None:
        """See ``law.Law``."""
        key = super().key
        return None if key is None else (*key, self._has_damping_ratio)

    def task_law(self, inputs: TaskInput, reference: TaskReference, tuning: Sequence[Any]) -> Any:
        """The torque, for numbers and expressions."""
        *posture_gains, K, D = tuning
        if self._has_damping_ratio:
            D = D * root(K * axis_masses(inputs.arm.A, inputs.arm.inertia))
        force = K * inputs.error + D * inputs.error_rate
        tau = self._dynamics.torque(inputs, reference, inputs.acceleration, posture_gains)
        return tau + inputs.arm.J.T @ force


@sealed
class AlongJoints:
    """Adapts a task controller to joint references: their pose, velocity and acceleration."""

    memory: tuple[Array, ...] = ()

    def __init__(self, control: TaskController, task: TaskSpace, force: float = 0.0) -> None:
        """Take a controller, its task, and the force in [N] along its direction."""
        self._control, self._task, self._force = control, task, force

    @property
    def key(self) -> tuple[Any, ...] | None:
        """What the formula depends on besides the model; see ``law.Law``."""
        key, task = getattr(self._control, "key", None), self._task
        return None if key is None else (*key, task.frame, task.axes, task.threshold)

    @property
    def tuning(self) -> tuple[Array, ...]:
        """Numbers of the formula."""
        control: Any = self._control
        return *control.tuning, np.array([self._force])

    def formula(
        self, rigid: Any, q: ca.SX, v: ca.SX, desired: Reference, tuning: Parts, memory: Parts
    ) -> tuple[ca.SX, Parts]:
        """Torques as an expression, not numbers near singularities; see ``law.Law``."""
        task, control = self._task, cast(Any, self._control)
        *gains_of_task, force = tuning
        state, motion = frame_functions(task.model, task.frame, task.axes)
        position, rotation, velocity, acceleration = motion(desired.q, desired.v, desired.a)
        reference = TaskReference(position, rotation, velocity, acceleration, force, desired.q)
        *parts, bound = state(q, v)
        arm = TaskInstant._make(parts)
        rotation_error = rotation_vector(reference.rotation @ arm.rotation.T)
        error = ca.vertcat(reference.position - arm.position, rotation_error)[task.rows]
        error_rate = reference.velocity[task.rows] - arm.velocity
        inputs = TaskInput(q, v, arm, error, error_rate, reference.acceleration[task.rows])
        tau = control.task_law(inputs, reference, gains_of_task)
        return ca.if_else(bound < 1.0 / task.threshold, tau, np.nan), memory

    def torque(self, state: ArmState, reference: Reference) -> Array:
        """Return joint torques in [N m] or [N], shape (n,)."""
        return self._control.torque(state, task_reference(self._task, reference, self._force))


def task_reference(task: TaskSpace, reference: Reference, force: float = 0.0) -> TaskReference:
    """The task reference of a joint reference: x, J q̇ and J q̈ + J̇ q̇, with the posture.

    Args:
        task: The task, in axes ``local_world_aligned``.
        reference: Joint positions, velocities and accelerations, each of shape (n,).
        force: Force along the controller's direction in [N].
    """
    q, v, a = reference.q, reference.v, reference.a
    position, rotation, velocity, acceleration = task.motion.accelerated(q, v, a)
    return TaskReference(position, rotation, velocity, acceleration, force, posture=q)


def at_rest(task: TaskSpace, q: ArrayLike, force: float = 0.0) -> TaskReference:
    """Constant reference at the frame's pose for joint positions ``q``, shape (n,)."""
    here, still = vector("q", q, task.n), np.zeros(task.n)
    return replace(task_reference(task, Reference(here, still, still), force), posture=None)


class TaskInput(NamedTuple):
    """Input of a task controller at one instant, in the task's axes, numbers or expressions.

    Attributes:
        q: Joint positions, shape (n,).
        v: Joint velocities, shape (n,).
        arm: The arm.
        error: Error of the pose, shape (m,).
        error_rate: Error of the velocity, likewise.
        acceleration: Acceleration of the reference, likewise.
    """

    q: Any
    v: Any
    arm: Any
    error: Any
    error_rate: Any
    acceleration: Any


class _TaskDynamics:
    """What all task controllers share: errors of the frame, and torques with the posture."""

    def __init__(
        self, task: TaskSpace, posture: ArrayLike | None, bandwidth: ArrayLike, friction: bool
    ) -> None:
        task.require_world_axes()
        self._task = task
        self._posture = None if posture is None else vector("posture", posture, task.n)
        self.tuning = gains(bandwidth, 1.0, task.n)
        self._friction = SteadyFriction.of(task.model) if friction else None

    @property
    def key(self) -> tuple[Any, ...] | None:
        """What its part of a formula depends on; None where the posture is given."""
        return (self._friction is not None,) if self._posture is None else None

    def inputs(self, state: ArmState, reference: TaskReference) -> TaskInput:
        """Errors of a measured state, and the arm's terms there."""
        q, v = checked(state, self._task.n)
        arm, rows = self._task.instant(q, v), self._task.rows
        rotation_error = pin.log3(reference.rotation @ arm.rotation.T)
        error = np.concatenate([reference.position - arm.position, rotation_error])
        error_rate = reference.velocity[rows] - arm.velocity
        return TaskInput(q, v, arm, error[rows], error_rate, reference.acceleration[rows])

    def torque(
        self, inputs: TaskInput, reference: TaskReference, desired: Any, tuning: Sequence[Any]
    ) -> Any:
        """Torque for a desired acceleration of the frame, with the posture in the null space."""
        arm, (kp, kd) = inputs.arm, tuning
        goal = self._posture if reference.posture is None else reference.posture
        a = -kd * inputs.v
        if goal is not None:
            a = a + kp * (goal - inputs.q)
        force = arm.inertia @ (desired - arm.drift - arm.J @ a)
        tau = arm.M @ a + arm.bias + arm.J.T @ force
        if self._friction is not None:
            joint_velocity = arm.B @ (arm.inertia @ reference.velocity[self._task.rows])
            tau = tau + friction_feed_forward(self._friction, joint_velocity, inputs.q, tau)
        return tau
