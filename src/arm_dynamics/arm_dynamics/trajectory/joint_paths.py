# SPDX-License-Identifier: Apache-2.0
"""Joint motion along a Cartesian path, with velocity and acceleration exact from J and J̇.

Along the path dq/du = J⁺ x' is integrated, the minimum-norm joint motion that follows it; the
second derivative is that of this field, null space included (Golub and Pereyra, "The
differentiation of pseudo-inverses", SIAM J. Numer. Anal. 10(2), 1973, for full row rank):

    q'' = J⁺ (x'' - J' q') + (1 - J⁺ J) J'ᵀ (J Jᵀ)⁻¹ x'
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import InvalidInput, Unreachable
from arm_dynamics.task_space.inertia import pseudo_inverse, task_inertia
from arm_dynamics.task_space.inverse_kinematics import InverseKinematics
from arm_dynamics.task_space.task_space import TaskSpace
from arm_dynamics.trajectory.cartesian import CartesianTrajectory, Path, PathPoint
from arm_dynamics.trajectory.limits import Limits
from arm_dynamics.trajectory.reference import Reference
from arm_dynamics.trajectory.timing.laws import Timing
from arm_dynamics.trajectory.timing.scaling import Capacity, slowdown
from arm_dynamics.trajectory.trajectory import Trajectory

_LARGEST_U = 1.0 - 1e-15  # beyond its end a trajectory is at rest, but a path over u is not


@frozen
class JointPath:
    """Joint positions along a path, timed.

    Attributes:
        over: Joint positions over u in [0, 1]; its "time" is u.
        timing: u over time.
    """

    over: Trajectory
    timing: Timing

    @property
    def duration(self) -> float:
        """Duration in [s]."""
        return self.timing.duration

    def sample(self, t: float) -> Reference:
        """Position, velocity and acceleration at the time ``t`` in [s], each of shape (n,)."""
        u, du, ddu = self.timing.at(t)
        at = self.over.sample(min(max(u, 0.0), _LARGEST_U))
        return Reference(*_by_time((at.q, at.v, at.a), du, ddu))

    def slower(self, stretch: float) -> JointPath:
        """The path with all times multiplied by ``stretch``."""
        return replace(self, timing=self.timing.slower(stretch))

    def along(self, us: Array) -> Array:
        """Positions and first and second derivatives by u at k points of the path, (3, k, n)."""
        return self.over.at(np.clip(us, 0.0, _LARGEST_U))

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """Positions, velocities and accelerations at times in [s], shape (k, n) each."""
        u, du, ddu = np.array([self.timing.at(float(t)) for t in times]).T
        return _by_time(self.along(u), du[:, None], ddu[:, None])


def _by_time(along: Any, du: Any, ddu: Any) -> tuple[Array, Array, Array]:
    """Positions, velocities and accelerations at u(t), by the chain rule."""
    q, first, second = along
    return q, first * du, second * du**2 + first * ddu


def joint_path(
    task: TaskSpace,
    trajectory: CartesianTrajectory,
    seed: ArrayLike | None = None,
    knots: int = 100,
) -> JointPath:
    """Turn a timed path of the frame into joint references.

    Args:
        task: The task, in axes ``local_world_aligned``.
        trajectory: The motion of its frame.
        seed: Joint positions near the start, shape (n,); None for the scene's initial ones.
        knots: Number of segments of the joint path; its error falls with the sixth power.

    Returns:
        The joint path, with the trajectory's timing.

    Raises:
        Unreachable: If the start cannot be reached, the path runs through a singularity or a
            joint leaves its limits; the message says where.
        InvalidInput: If an argument is not allowed.
    """
    if knots < 1:
        raise InvalidInput(f"knots = {knots}; at least one is expected")
    path, solver = trajectory.path, InverseKinematics(task)
    q = solver.reach(path.at(0.0), seed)
    us = np.linspace(0.0, 1.0, knots + 1)
    rows: list[tuple[Array, Array, Array]] = []
    for u in us:
        place = path.at(u)
        if rows:
            q = solver.correct(place, _advance(task, path, u - 1.0 / knots, 1.0 / knots, q))
        rows.append((q, *derivatives(task, place, q, u)))
        check_limits(task, q, u)
    positions, first, second = (np.array(part) for part in zip(*rows, strict=True))
    return JointPath(Trajectory.through(us, positions, first, second), trajectory.timing)


def paced(
    motion: JointPath,
    dynamics: Dynamics,
    limit: ArrayLike | None = None,
    count: int = 400,
    acceleration: ArrayLike = np.inf,
) -> JointPath:
    """Slow a joint path down until it is within all limits of the arm, at every instant.

    All times are stretched by one factor. Velocities, accelerations, torques and the voltages of
    motors are kept between points, too: see ``timing.scaling.slowdown``.

    Args:
        motion: The motion.
        dynamics: The model.
        limit: Torque limits in [N m] or [N], a number or shape (n,); None for the model's. The
            limits of the motors' currents and voltages hold in any case.
        count: Number of points along the path at which limits are checked first; where a limit
            might be exceeded between them, there will be more.
        acceleration: Limits of joint accelerations in [rad/s²] or [m/s²], positive, likewise.

    Returns:
        The motion, slowed down if necessary.

    Raises:
        Unreachable: If gravity, springs and dry friction exceed a limit at any speed.
        InvalidInput: If an argument is not allowed.
    """
    if count < 2:
        raise InvalidInput(f"count = {count}; at least 2 are expected")
    capacity = Capacity.of(dynamics, limit, acceleration)
    edges = np.linspace(0.0, motion.duration, count // 4 + 1)
    return motion.slower(slowdown(capacity, motion.at, edges))


def derivatives(task: TaskSpace, place: PathPoint, q: Array, u: float) -> tuple[Array, Array]:
    """Derivatives q' and q'' of the joints at a point of a path, each of shape (n,).

    Raises:
        Unreachable: If the frame is singular there, at the fraction ``u`` of the path.
    """
    rows = task.rows
    J = task.motion.jacobian(q)[rows]
    if task.m > task.n or task_inertia(J @ J.T, task.linear, task.threshold).damped:
        raise _singularity(task, u)
    J_plus = pseudo_inverse(J)
    x1, x2 = place.first[rows], place.second[rows]
    first = J_plus @ x1
    J_dot = task.motion.moving(q, first).jacobian_rate[rows]
    null_motion = J_dot.T @ np.linalg.solve(J @ J.T, x1)
    return first, J_plus @ (x2 - J_dot @ first) + null_motion - J_plus @ (J @ null_motion)


def check_limits(task: TaskSpace, q: Array, u: float) -> None:
    """Refuse joint positions beyond their limits at the fraction ``u`` of a path."""
    model = task.model
    beyond = np.maximum(model.position_lower - q, q - model.position_upper)
    joint = np.argmax(beyond)
    if beyond[joint] > 1e-9:
        unit = Limits.of(model).unit(int(joint), "position")
        raise Unreachable(
            f"at {u:.1%} of the path joint '{model.joint_names[joint]}' would be at "
            f"{q[joint]:.6g}{unit}; allowed: {model.position_lower[joint]:.6g} to "
            f"{model.position_upper[joint]:.6g}{unit}",
            float(beyond[joint]),
        )


def _advance(task: TaskSpace, path: Path, u: float, h: float, q: Array) -> Array:
    """One step of the classical Runge-Kutta method along dq/du = J⁺ x'."""

    def field(at: float, here: Array) -> Array:
        return pseudo_inverse(task.motion.jacobian(here)[task.rows]) @ path.at(at).first[task.rows]

    try:
        k1 = field(u, q)
        k2 = field(u + h / 2, q + h / 2 * k1)
        k3 = field(u + h / 2, q + h / 2 * k2)
        k4 = field(u + h, q + h * k3)
    except np.linalg.LinAlgError:
        raise _singularity(task, u) from None
    return q + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def _singularity(task: TaskSpace, u: float) -> Unreachable:
    return Unreachable(
        f"the path runs into a singularity of frame '{task.frame}' at {u:.1%} of its length; "
        "choose another path or seed, or a task with fewer axes"
    )
