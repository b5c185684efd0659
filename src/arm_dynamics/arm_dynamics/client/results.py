# SPDX-License-Identifier: Apache-2.0
"""Results of the services of a dynamics node, as arrays in their natural shapes."""

from typing import NotRequired, TypedDict

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen
from arm_dynamics.exceptions import Refused, Unreachable


@frozen
class ModelFacts:
    """Properties of a dynamics node's arm; vectors have shape (n,).

    Attributes:
        joint_names: Names of the joints, in model order.
        joint_types: ``revolute``, ``continuous`` or ``prismatic``.
        position_lower: Lower position limits in [rad] or [m]; -inf for none.
        position_upper: Upper position limits in [rad] or [m]; inf for none.
        velocity_limits: Speed limits in [rad/s] or [m/s]; inf for none.
        effort_limits: Torque limits in [N m] or [N]; inf for none.
        frame_names: Frames of the arm.
        total_mass: Mass of everything that moves, in [kg].
        gravity: Gravity in the world frame in [m/s²], shape (3,).
        summary: One-line description.
    """

    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    position_lower: Array
    position_upper: Array
    velocity_limits: Array
    effort_limits: Array
    frame_names: tuple[str, ...]
    total_mass: float
    gravity: Array
    summary: str


@frozen
class Terms:
    """Terms of the equation of motion; a batch has k in front of every shape.

    Attributes:
        joint_names: Order of the vectors.
        mass_matrix: M(q), shape (n, n).
        coriolis_matrix: C(q, v), shape (n, n).
        gravity: G(q) in [N m] or [N], shape (n,).
        friction: F(v) in [N m] or [N], shape (n,).
        spring: S(q, v), torque of springs and their dampers, in [N m] or [N], shape (n,).
        kinetic_energy: Kinetic energy in [J], shape ().
        potential_energy: Potential energy in [J], shape ().
    """

    joint_names: tuple[str, ...]
    mass_matrix: Array
    coriolis_matrix: Array
    gravity: Array
    friction: Array
    spring: Array
    kinetic_energy: Array
    potential_energy: Array


class TaskTerms(TypedDict):
    """The equation of motion in task space at one state; a batch has k in front of every shape.

    A dictionary, with the fields of ``arm_msgs/TaskSpace``, where their units are; see
    ``task_space.TaskTerms`` for their formulas.

    Attributes:
        joint_names: Order of the joints.
        axes: Order of the m axes.
        pose: Position x y z and quaternion x y z w of the frame in the world, shape (7,).
        jacobian: J, shape (m, n).
        twist: J v, shape (m,).
        bias: J̇ v, shape (m,).
        inertia: Λ, shape (m, m).
        coriolis: µ, shape (m,).
        gravity: p, shape (m,).
        spring: s, shape (m,).
        inverse: J̄, shape (n, m).
        null_space: 1 - J̄ J, shape (n, n).
        manipulability: √det(J Jᵀ), shape ().
        condition: Ratio of the singular values of J, shape ().
        damped: Whether results are bounded near a singularity, shape ().
        effective_mass: Along the requested direction, shape (); missing without one.
        effective_mass_bounded: Whether it is bounded, likewise.
    """

    joint_names: tuple[str, ...]
    axes: tuple[str, ...]
    pose: Array
    jacobian: Array
    twist: Array
    bias: Array
    inertia: Array
    coriolis: Array
    gravity: Array
    spring: Array
    inverse: Array
    null_space: Array
    manipulability: Array
    condition: Array
    damped: NDArray[np.bool_]
    effective_mass: NotRequired[Array]
    effective_mass_bounded: NotRequired[NDArray[np.bool_]]


@frozen
class ConstrainedMotion:
    """Motion under the scene's constraints; a batch has k in front of both shapes.

    Attributes:
        joint_names: Order of the accelerations.
        constraint_names: The constraint that each multiplier belongs to, m names.
        acceleration: Joint accelerations in [rad/s²] or [m/s²], shape (n,).
        multipliers: λ, what the arm exerts on the constraints, in [N] or [N m], shape (m,): force
            and moment of a constraint's first frame on its second, in axes of the second.
    """

    joint_names: tuple[str, ...]
    constraint_names: tuple[str, ...]
    acceleration: Array
    multipliers: Array


@frozen
class Postures:
    """Joint positions for poses; a batch has k in front of every shape.

    Attributes:
        joint_names: Order of the positions.
        q: Joint positions within limits, in [rad] or [m], shape (n,); the nearest found where a
            pose is not reached.
        reached: Whether the pose is reached to 1e-9 m and 1e-9 rad, shape ().
        distance: Remaining position error in [m], shape ().
        angle: Remaining orientation error in [rad], shape ().
    """

    joint_names: tuple[str, ...]
    q: Array
    reached: NDArray[np.bool_]
    distance: Array
    angle: Array


class NotReached(Refused, Unreachable):
    """A node's inverse kinematics did not reach every pose; the message is the node's.

    ``found`` holds the result for each pose: the nearest posture where a pose is not reached.
    """

    def __init__(self, message: str, found: Postures) -> None:
        super().__init__(message, float(found.distance.max()))
        self.found = found
