# SPDX-License-Identifier: Apache-2.0
"""The services of running nodes as functions: NumPy in, NumPy out, no spinning."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from types import MappingProxyType
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen, sealed
from arm_dynamics.client.values import fields_of, fixed, flat, motion, rows, shaped, whole, words
from arm_dynamics.exceptions import Refused, Unreachable
from arm_dynamics.ros import interfaces
from arm_dynamics.ros.common.caller import Caller
from arm_dynamics.terms.table import OF_SERVICE, TASK_SPACE

ALL_TERMS = 31  # as arm_dynamics.Term.ALL, which would import Pinocchio
_U32 = 2**32 - 1


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


@sealed
class ArmClient:
    """Calls the services of a dynamics node and a sim node; one instance for each thread.

    Every method waits for the node and for its answer, each at most ``timeout``. The reply to a
    first call may get lost while the two ends discover each other, so a call is repeated where
    that is safe. Errors: ``NoAnswer`` when no node offers the service or answers, ``Refused`` with
    the node's message when it declines, ``InvalidInput`` for arguments that cannot be sent.

    Example:
        >>> with ArmClient() as arm:
        ...     tau = arm.inverse_dynamics(q, v, a)  # q of shape (n,), or (k, n) for k points
    """

    def __init__(
        self, dynamics: str = "dynamics", sim: str = "sim", timeout: float = 5.0,
        domain: int | None = None,
    ) -> None:  # fmt: skip
        """Join the ROS graph.

        Args:
            dynamics: Name of the dynamics node, with its namespace if it has one.
            sim: Name of the sim node, likewise.
            timeout: Time to wait for a node, and for each of its answers, in [s].
            domain: ROS domain; None for that of the environment.
        """
        self._caller = Caller(timeout, domain)
        self._dynamics, self._sim = dynamics, sim

    def close(self) -> None:
        """Leave the ROS graph; may be called repeatedly."""
        self._caller.close()

    def __enter__(self) -> Self:
        """Return the client itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the ROS graph."""
        self.close()

    # --- the dynamics node ---------------------------------------------------------------------

    def model_info(self) -> ModelFacts:
        """Properties of the node's arm."""
        answer = self._ask(self._dynamics, interfaces.MODEL_INFO)
        values = {field.name: getattr(answer, field.name) for field in fields(ModelFacts)}
        for name, value in values.items():
            if not isinstance(value, str | float):
                values[name] = tuple(value) if isinstance(value, list) else np.array(value, float)
        return ModelFacts(**values)

    def inverse_dynamics(
        self, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None,
        terms: int = ALL_TERMS, joint_names: Sequence[str] = (),
    ) -> Array:  # fmt: skip
        """Torques that produce a motion: the chosen terms of M a + C v + G + S + F.

        Args:
            q: Positions in [rad] or [m], shape (n,), or (k, n) for k points in one call.
            v: Velocities, of the same shape; None for zeros.
            a: Accelerations, likewise.
            terms: Sum of INERTIA 1, CORIOLIS 2, GRAVITY 4, FRICTION 8 and SPRING 16.
            joint_names: Order of all vectors; empty for the model's.

        Returns:
            Torques in [N m] or [N], shape of ``q``.
        """
        options = {"terms": whole("terms", terms, ALL_TERMS)}
        answer, shape = self._ask_at(
            interfaces.INVERSE_DYNAMICS, q, joint_names, options, velocity=v, acceleration=a
        )
        return shaped(answer.effort, shape)

    def forward_dynamics(
        self, q: ArrayLike, v: ArrayLike | None = None, tau: ArrayLike | None = None,
        joint_names: Sequence[str] = (),
    ) -> Array:  # fmt: skip
        """Accelerations that torques produce, shape of ``q``; see ``inverse_dynamics``."""
        answer, shape = self._ask_at(
            interfaces.FORWARD_DYNAMICS, q, joint_names, velocity=v, effort=tau
        )
        return shaped(answer.acceleration, shape)

    def dynamics_terms(
        self, q: ArrayLike, v: ArrayLike | None = None, joint_names: Sequence[str] = ()
    ) -> Terms:
        """M, C, G, F, S and the energies; see ``inverse_dynamics`` for the arguments."""
        answer, (*batch, n) = self._ask_at(interfaces.DYNAMICS_TERMS, q, joint_names, velocity=v)
        shapes = {name: shape for entry in OF_SERVICE for name, shape in entry.parts.items()}
        return Terms(tuple(answer.joint_names), **fields_of(answer, shapes, tuple(batch), n=n))

    def task_space(
        self, frame: str, q: ArrayLike, v: ArrayLike | None = None, *,
        reference: str = "local_world_aligned", axes: str | Sequence[str] = "pose",
        direction: ArrayLike = (), joint_names: Sequence[str] = (),
    ) -> dict[str, Any]:  # fmt: skip
        """The equation of motion in task space, at a frame.

        Args:
            frame: A frame that moves.
            q: Positions, as for ``inverse_dynamics``.
            v: Velocities, likewise.
            reference: ``local_world_aligned``, ``local`` or ``world``.
            axes: ``pose``, ``position``, ``orientation``, or some of x, y, z, rx, ry, rz.
            direction: Direction along which to return the effective mass, one number for each
                axis.
            joint_names: Order of all vectors; none for the model's.

        Returns:
            The fields of ``arm_msgs/TaskSpace`` by name, as arrays in their natural shapes; a
            batch has k in front. ``axes`` and ``joint_names`` are tuples.
        """
        options = {
            "frame": str(frame), "reference": str(reference), "axes": words("axes", axes),
            "direction": flat("direction", direction),
        }  # fmt: skip
        answer, (*batch, n) = self._ask_at(
            interfaces.TASK_SPACE, q, joint_names, options, velocity=v
        )
        names = {"axes": tuple(answer.axes), "joint_names": tuple(answer.joint_names)}
        shapes = TASK_SPACE | {"effective_mass": (), "effective_mass_bounded": ()}
        return names | fields_of(answer, shapes, tuple(batch), n=n, m=len(answer.axes))

    def inverse_kinematics(
        self, frame: str, pose: ArrayLike, seed: ArrayLike | None = None, *,
        axes: str | Sequence[str] = "pose", joint_names: Sequence[str] = (),
    ) -> Postures:  # fmt: skip
        """Inverse kinematics: joint positions within limits that bring a frame to a pose.

        The request is sent only once: an unreachable pose takes the node some tenths of a second,
        and the client's timeout applies to all of them together.

        Args:
            frame: A frame that moves.
            pose: Position x y z in [m] and quaternion x y z w of the frame in the world, shape
                (7,), or (k, 7) for k poses in one call.
            seed: Initial guess in [rad] or [m], shape (n,), or (k, n), one for each of k poses.
                Without a guess of its own, each search begins at the result of the previous one,
                so poses of a path give neighbouring positions; with None, the first begins at the
                scene's initial position.
            axes: ``pose``, ``position``, ``orientation``, or some of x, y, z, rx, ry, rz.
            joint_names: Order of all vectors; none for the model's.

        Raises:
            NotReached: If a pose is not reached; ``found`` holds the results.
        """
        fields = motion(joint_names, pose=pose, seed=seed)
        fields |= {"frame": str(frame), "axes": words("axes", axes)}
        batch = rows("pose", pose, 7)
        answer = self._answer(self._dynamics, interfaces.INVERSE_KINEMATICS, fields, once=True)
        if not len(answer.reached):
            _agreed(answer)
        names = tuple(answer.joint_names)
        if seed is not None:
            rows("seed", seed, len(names))
        postures = Postures(
            names, shaped(answer.position, (*batch, len(names))),
            np.array(answer.reached, bool).reshape(batch),
            shaped(answer.distance, batch), shaped(answer.angle, batch),
        )  # fmt: skip
        if not answer.success:
            raise NotReached(answer.message, postures)
        return postures

    def constrained_dynamics(
        self, q: ArrayLike, v: ArrayLike | None = None, tau: ArrayLike | None = None,
        joint_names: Sequence[str] = (),
    ) -> ConstrainedMotion:  # fmt: skip
        """Accelerations and forces that torques produce under the scene's constraints.

        τ = M a + C v + G + S + F + Aᵀλ with A v = 0, for the initially active constraints.
        Arguments as for ``forward_dynamics``; the constraints should be satisfied at ``q``.
        """
        answer, shape = self._ask_at(
            interfaces.CONSTRAINED_DYNAMICS, q, joint_names, velocity=v, effort=tau
        )
        names = tuple(answer.constraint_names)
        return ConstrainedMotion(
            tuple(answer.joint_names), names, shaped(answer.acceleration, shape),
            shaped(answer.multipliers, (*shape[:-1], len(names))),
        )  # fmt: skip

    def constrained_inverse_dynamics(
        self, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None,
        multipliers: ArrayLike | None = None, joint_names: Sequence[str] = (),
    ) -> Array:  # fmt: skip
        """Torques for a motion and for forces on the scene's constraints.

        As ``inverse_dynamics``, with ``multipliers`` λ as ``constrained_dynamics`` gives them, in
        [N] or [N m], shape (m,), or (k, m); None for zeros.
        """
        answer, shape = self._ask_at(
            interfaces.CONSTRAINED_DYNAMICS, q, joint_names, {"inverse": True},
            velocity=v, acceleration=a, multipliers=multipliers,
        )  # fmt: skip
        return shaped(answer.effort, shape)

    # --- the sim node --------------------------------------------------------------------------

    def reset(self) -> None:
        """Reset the simulation to its initial state and time zero."""
        self._ask(self._sim, interfaces.RESET)

    def pause(self) -> None:
        """Pause the simulation."""
        self._ask(self._sim, interfaces.PAUSE, data=True)

    def resume(self) -> None:
        """Resume the simulation."""
        self._ask(self._sim, interfaces.PAUSE, data=False)

    def step(self, steps: int = 1) -> float:
        """Advance a paused simulation by whole ticks; return its time in [s]. Never repeated."""
        fields = {"steps": whole("steps", steps, _U32)}
        return float(_agreed(self._answer(self._sim, interfaces.STEP, fields, once=True)).time)

    def set_joint_state(
        self,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        joint_names: Sequence[str] = (),
    ) -> None:
        """Set joint positions and velocities at once.

        Args:
            q: Positions in [rad] or [m], one for each joint; None keeps the current ones.
            v: Velocities, likewise; None for zeros.
            joint_names: Names of the joints; empty for all, in model order.
        """
        fields = motion(joint_names, position=q, velocity=v)
        self._ask(self._sim, interfaces.SET_JOINT_STATE, **fields)

    def set_payload(
        self, mass: float, com: ArrayLike = (0.0, 0.0, 0.0),
        inertia: ArrayLike = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), index: int = 0,
    ) -> None:  # fmt: skip
        """Change a payload that the scene declares tunable.

        Args:
            mass: Mass in [kg].
            com: Centre of mass in the payload's frame in [m], shape (3,).
            inertia: Inertia about the centre of mass: xx, xy, xz, yy, yz, zz in [kg m²].
            index: Index of the payload in the scene.
        """
        self._ask(
            self._sim, interfaces.SET_PAYLOAD, index=whole("index", index, _U32), mass=float(mass),
            com=fixed("com", com, 3), inertia=fixed("inertia", inertia, 6),
        )  # fmt: skip

    def set_friction(self, viscous: ArrayLike, joint_names: Sequence[str] = ()) -> None:
        """Change viscous friction that the scene declares tunable.

        Args:
            viscous: Coefficients in [N m s/rad] or [N s/m], shape (n,).
            joint_names: Names of the joints; empty for all, in model order.
        """
        self._ask(self._sim, interfaces.SET_FRICTION, **motion(joint_names, viscous=viscous))

    def reset_counters(self) -> None:
        """Reset the counters of the loop and of its communication partners."""
        self._ask(self._sim, interfaces.RESET_COUNTERS)

    # --- both ----------------------------------------------------------------------------------

    def _ask(self, node: str, service: interfaces.Service, **fields: Any) -> Any:
        """The response of a node; raises ``Refused`` if the request was declined."""
        return _agreed(self._answer(node, service, fields))

    def _ask_at(
        self, service: interfaces.Service, q: ArrayLike, joint_names: Sequence[str],
        options: Mapping[str, Any] = MappingProxyType({}), **vectors: ArrayLike | None,
    ) -> tuple[Any, tuple[int, ...]]:  # fmt: skip
        """The response of the dynamics node at points, and their shape: (n,) or (k, n)."""
        fields = motion(joint_names, position=q, **vectors)
        answer = self._ask(self._dynamics, service, **fields, **options)
        n = len(answer.joint_names)
        return answer, (*rows("position", q, n), n)

    def _answer(
        self, node: str, service: interfaces.Service, fields: dict[str, Any], once: bool = False
    ) -> Any:
        """The response of a node, refusals included; with ``once``, the request is sent once."""
        request = service.type.Request(**fields)
        return self._caller.ask(node, service, request, repeatable=not once)


def _agreed(answer: Any) -> Any:
    if not answer.success:
        raise Refused(answer.message)
    return answer
