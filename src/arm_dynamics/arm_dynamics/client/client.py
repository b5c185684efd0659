# SPDX-License-Identifier: Apache-2.0
"""The services of running nodes as functions: NumPy in, NumPy out, no spinning."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.client.values import (
    fixed,
    flat,
    motion,
    points,
    rows,
    shaped,
    task_shapes,
    whole,
    words,
)
from arm_dynamics.exceptions import Refused, Unreachable
from arm_dynamics.ros import interfaces
from arm_dynamics.ros.common.caller import Caller

ALL_TERMS = 31  # as arm_dynamics.Term.ALL, which would import Pinocchio
_U32 = 2**32 - 1


@dataclass(frozen=True)
class ModelFacts:
    """What a dynamics node knows about its arm; vectors have shape (n,).

    Attributes:
        joint_names: The model's order.
        joint_types: ``revolute``, ``continuous`` or ``prismatic``.
        position_lower: In [rad] or [m]; -inf for none.
        position_upper: In [rad] or [m]; inf for none.
        velocity_limits: In [rad/s] or [m/s]; inf for none.
        effort_limits: In [N m] or [N]; inf for none.
        frame_names: Frames of the arm.
        total_mass: In [kg].
        gravity: In the world frame in [m/s²], shape (3,).
        summary: A description in one line.
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


@dataclass(frozen=True)
class Terms:
    """The parts of the equation of motion; a batch has k in front of every shape.

    Attributes:
        joint_names: Order of the vectors.
        mass_matrix: M(q), shape (n, n).
        coriolis_matrix: C(q, v), shape (n, n).
        gravity: G(q) in [N m] or [N], shape (n,).
        friction: F(v) in [N m] or [N], shape (n,).
        spring: S(q, v), what springs and their dampers take, in [N m] or [N], shape (n,).
        kinetic_energy: In [J], shape ().
        potential_energy: In [J], shape ().
    """

    joint_names: tuple[str, ...]
    mass_matrix: Array
    coriolis_matrix: Array
    gravity: Array
    friction: Array
    spring: Array
    kinetic_energy: Array
    potential_energy: Array


@dataclass(frozen=True)
class ConstrainedMotion:
    """Motion under the scene's constraints; a batch has k in front of both shapes.

    Attributes:
        joint_names: Order of the accelerations.
        constraint_names: The constraint that each multiplier belongs to, m names.
        acceleration: In [rad/s²] or [m/s²], shape (n,).
        multipliers: λ, what the arm exerts against the constraints, in [N] or [N m], shape (m,):
            force and moment of a constraint's first frame upon its second, in axes of the second.
    """

    joint_names: tuple[str, ...]
    constraint_names: tuple[str, ...]
    acceleration: Array
    multipliers: Array


@dataclass(frozen=True)
class Postures:
    """Joint positions for poses; a batch has k in front of every shape.

    Attributes:
        joint_names: Order of the positions.
        q: Within limits, in [rad] or [m], shape (n,); the nearest found where a pose is not
            reached.
        reached: Whether the pose is reached to 1e-9 m and 1e-9 rad, shape ().
        distance: What is missing in [m], shape ().
        angle: What is missing in [rad], shape ().
    """

    joint_names: tuple[str, ...]
    q: Array
    reached: NDArray[np.bool_]
    distance: Array
    angle: Array


class NotReached(Refused, Unreachable):
    """A node searched for joint positions and did not reach every pose; the message is the node's.

    ``found`` holds what it found for each pose: the nearest posture where a pose is not reached.
    """

    def __init__(self, message: str, found: Postures) -> None:
        super().__init__(message, float(found.distance.max()))
        self.found = found


class ArmClient:
    """Calls the services of a dynamics node and a sim node; one instance for each thread.

    Every method waits for the node and for its answer, each at most ``timeout``. The reply to a
    first call may get lost while the two ends discover each other, so a call is repeated where
    that does no harm. Errors: ``NoAnswer`` when no node offers the service or answers, ``Refused``
    with the node's message when it declines, ``InvalidInput`` for arguments that cannot be sent.

    Example:
        >>> with ArmClient() as arm:
        ...     tau = arm.inverse_dynamics(q, v, a)  # q of shape (n,), or (k, n) for k points
    """

    def __init__(
        self,
        dynamics: str = "dynamics",
        sim: str = "sim",
        timeout: float = 5.0,
        domain: int | None = None,
    ) -> None:
        """Join the ROS graph.

        Args:
            dynamics: Name of the dynamics node, with its namespace if it has one.
            sim: Name of the sim node, likewise.
            timeout: In [s].
            domain: ROS domain; None for that of the environment.
        """
        self._caller = Caller(timeout, domain)
        self._dynamics, self._sim = dynamics, sim

    def close(self) -> None:
        """Leave the ROS graph; calling it again does no harm."""
        self._caller.close()

    def __enter__(self) -> Self:
        """Use it in a ``with`` statement."""
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the ROS graph."""
        self.close()

    # --- the dynamics node ---------------------------------------------------------------------

    def model_info(self) -> ModelFacts:
        """What the node knows about its arm."""
        answer = self._ask(self._dynamics, interfaces.MODEL_INFO)
        return ModelFacts(
            joint_names=tuple(answer.joint_names),
            joint_types=tuple(answer.joint_types),
            position_lower=np.array(answer.position_lower),
            position_upper=np.array(answer.position_upper),
            velocity_limits=np.array(answer.velocity_limits),
            effort_limits=np.array(answer.effort_limits),
            frame_names=tuple(answer.frame_names),
            total_mass=answer.total_mass,
            gravity=np.array(answer.gravity, float),
            summary=answer.summary,
        )

    def inverse_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike | None = None,
        a: ArrayLike | None = None,
        terms: int = ALL_TERMS,
        joint_names: Sequence[str] = (),
    ) -> Array:
        """Torques that produce a motion: the chosen terms of M a + C v + G + S + F.

        Args:
            q: Positions in [rad] or [m], shape (n,), or (k, n) for k points in one call.
            v: Velocities, of the same shape; None for zeros.
            a: Accelerations, likewise.
            terms: Sum of INERTIA 1, CORIOLIS 2, GRAVITY 4, FRICTION 8 and SPRING 16.
            joint_names: Order of all vectors; none for the model's.

        Returns:
            Torques in [N m] or [N], shape of ``q``.
        """
        fields = motion(joint_names, position=q, velocity=v, acceleration=a)
        terms = whole("terms", terms, ALL_TERMS)
        answer = self._ask(self._dynamics, interfaces.INVERSE_DYNAMICS, terms=terms, **fields)
        return shaped(answer.effort, points(answer, q))

    def forward_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike | None = None,
        tau: ArrayLike | None = None,
        joint_names: Sequence[str] = (),
    ) -> Array:
        """Accelerations that torques produce, shape of ``q``; see ``inverse_dynamics``."""
        fields = motion(joint_names, position=q, velocity=v, effort=tau)
        answer = self._ask(self._dynamics, interfaces.FORWARD_DYNAMICS, **fields)
        return shaped(answer.acceleration, points(answer, q))

    def dynamics_terms(
        self, q: ArrayLike, v: ArrayLike | None = None, joint_names: Sequence[str] = ()
    ) -> Terms:
        """M, C, G, F, S and the energies; see ``inverse_dynamics`` for the arguments."""
        fields = motion(joint_names, position=q, velocity=v)
        answer = self._ask(self._dynamics, interfaces.DYNAMICS_TERMS, **fields)
        shape = points(answer, q)
        squares = (*shape, shape[-1])
        return Terms(
            tuple(answer.joint_names),
            shaped(answer.mass_matrix, squares), shaped(answer.coriolis_matrix, squares),
            shaped(answer.gravity, shape), shaped(answer.friction, shape),
            shaped(answer.spring, shape),
            shaped(answer.kinetic_energy, shape[:-1]),
            shaped(answer.potential_energy, shape[:-1]),
        )  # fmt: skip

    def task_space(
        self,
        frame: str,
        q: ArrayLike,
        v: ArrayLike | None = None,
        *,
        reference: str = "local_world_aligned",
        axes: str | Sequence[str] = "pose",
        direction: ArrayLike = (),
        joint_names: Sequence[str] = (),
    ) -> dict[str, Any]:
        """The equation of motion as seen at a frame.

        Args:
            frame: A frame that moves.
            q: Positions, as for ``inverse_dynamics``.
            v: Velocities, likewise.
            reference: ``local_world_aligned``, ``local`` or ``world``.
            axes: ``pose``, ``position``, ``orientation``, or some of x, y, z, rx, ry, rz.
            direction: Also answer the mass felt along it, one number for each axis.
            joint_names: Order of all vectors; none for the model's.

        Returns:
            The fields of ``arm_msgs/TaskSpace`` by name, as arrays in their natural shapes; a
            batch has k in front. ``axes`` and ``joint_names`` are tuples.
        """
        answer = self._ask(
            self._dynamics, interfaces.TASK_SPACE, frame=str(frame), reference=str(reference),
            axes=words("axes", axes), direction=flat("direction", direction),
            **motion(joint_names, position=q, velocity=v),
        )  # fmt: skip
        n, m, batch = len(answer.joint_names), len(answer.axes), points(answer, q)[:-1]
        found: dict[str, Any] = {
            "axes": tuple(answer.axes), "joint_names": tuple(answer.joint_names)
        }  # fmt: skip
        for name, shape in task_shapes(n, m).items():
            values = np.array(getattr(answer, name))
            if values.size:
                found[name] = values.reshape((*batch, *shape))
        return found

    def inverse_kinematics(
        self,
        frame: str,
        pose: ArrayLike,
        seed: ArrayLike | None = None,
        *,
        axes: str | Sequence[str] = "pose",
        joint_names: Sequence[str] = (),
    ) -> Postures:
        """Joint positions that bring a frame to a pose, within joint limits.

        Asked only once: a pose out of reach takes the node some tenths of a second, and the
        client's timeout has to do for all of them.

        Args:
            frame: A frame that moves.
            pose: Position x y z in [m] and quaternion x y z w of the frame in the world, shape
                (7,), or (k, 7) for k poses in one call.
            seed: Where to begin, in [rad] or [m], shape (n,), or (k, n) for each of k poses.
                Without one of its own a search begins where the one before ended, so that poses
                of a path are answered by neighbours; None: the first begins at the scene's initial
                position.
            axes: ``pose``, ``position``, ``orientation``, or some of x, y, z, rx, ry, rz.
            joint_names: Order of all vectors; none for the model's.

        Raises:
            NotReached: If the arm cannot take every pose, with what was found in ``found``.
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
        found = Postures(
            names, shaped(answer.position, (*batch, len(names))),
            np.array(answer.reached, bool).reshape(batch),
            shaped(answer.distance, batch), shaped(answer.angle, batch),
        )  # fmt: skip
        if not answer.success:
            raise NotReached(answer.message, found)
        return found

    def constrained_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike | None = None,
        tau: ArrayLike | None = None,
        joint_names: Sequence[str] = (),
    ) -> ConstrainedMotion:
        """Accelerations and forces that torques produce under the scene's constraints.

        τ = M a + C v + G + S + F + Aᵀλ with A v = 0, for those that hold at the start. Arguments
        as for ``forward_dynamics``; the constraints should hold at ``q``.
        """
        fields = motion(joint_names, position=q, velocity=v, effort=tau)
        answer = self._ask(self._dynamics, interfaces.CONSTRAINED_DYNAMICS, **fields)
        shape, names = points(answer, q), tuple(answer.constraint_names)
        return ConstrainedMotion(
            tuple(answer.joint_names), names, shaped(answer.acceleration, shape),
            shaped(answer.multipliers, (*shape[:-1], len(names))),
        )  # fmt: skip

    def constrained_inverse_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike | None = None,
        a: ArrayLike | None = None,
        multipliers: ArrayLike | None = None,
        joint_names: Sequence[str] = (),
    ) -> Array:
        """Torques for a motion and for forces against the scene's constraints.

        As ``inverse_dynamics``, with ``multipliers`` λ as ``constrained_dynamics`` gives them, in
        [N] or [N m], shape (m,), or (k, m); None for zeros.
        """
        fields = motion(
            joint_names, position=q, velocity=v, acceleration=a, multipliers=multipliers
        )
        answer = self._ask(self._dynamics, interfaces.CONSTRAINED_DYNAMICS, inverse=True, **fields)
        return shaped(answer.effort, points(answer, q))

    # --- the sim node --------------------------------------------------------------------------

    def reset(self) -> None:
        """Put the simulation back to its initial state and time zero."""
        self._ask(self._sim, interfaces.RESET)

    def pause(self) -> None:
        """Stop the simulation's time."""
        self._ask(self._sim, interfaces.PAUSE, data=True)

    def resume(self) -> None:
        """Let the simulation's time go on."""
        self._ask(self._sim, interfaces.PAUSE, data=False)

    def step(self, steps: int = 1) -> float:
        """Advance a paused simulation by whole ticks; return its time in [s]. Asked only once."""
        fields = {"steps": whole("steps", steps, _U32)}
        answer = _agreed(self._answer(self._sim, interfaces.STEP, fields, once=True))
        return float(answer.time)

    def set_joint_state(
        self,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        joint_names: Sequence[str] = (),
    ) -> None:
        """Put joints somewhere at once.

        Args:
            q: Positions in [rad] or [m], one for each joint; None leaves them.
            v: Velocities, likewise; None for zeros.
            joint_names: Which joints; none for all in the model's order.
        """
        fields = motion(joint_names, position=q, velocity=v)
        self._ask(self._sim, interfaces.SET_JOINT_STATE, **fields)

    def set_payload(
        self,
        mass: float,
        com: ArrayLike = (0.0, 0.0, 0.0),
        inertia: ArrayLike = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        index: int = 0,
    ) -> None:
        """Change a payload that the scene declares tunable.

        Args:
            mass: In [kg].
            com: Centre of mass in the payload's frame in [m], shape (3,).
            inertia: About it: xx, xy, xz, yy, yz, zz in [kg m²].
            index: Which of the scene's payloads.
        """
        self._ask(
            self._sim, interfaces.SET_PAYLOAD, index=whole("index", index, _U32), mass=float(mass),
            com=fixed("com", com, 3), inertia=fixed("inertia", inertia, 6),
        )  # fmt: skip

    def set_friction(self, viscous: ArrayLike, joint_names: Sequence[str] = ()) -> None:
        """Change viscous friction that the scene declares tunable.

        Args:
            viscous: Coefficients in [N m s/rad] or [N s/m], shape (n,).
            joint_names: Joints that they belong to; empty: all, in model order.
        """
        self._ask(self._sim, interfaces.SET_FRICTION, **motion(joint_names, viscous=viscous))

    def reset_counters(self) -> None:
        """Have the loop's and the partners' counters begin afresh."""
        self._ask(self._sim, interfaces.RESET_COUNTERS)

    # --- both ----------------------------------------------------------------------------------

    def _ask(self, node: str, service: interfaces.Service, **fields: Any) -> Any:
        """The response of a node that did what it was asked; ``Refused`` if it declined."""
        return _agreed(self._answer(node, service, fields))

    def _answer(
        self, node: str, service: interfaces.Service, fields: dict[str, Any], once: bool = False
    ) -> Any:
        """The response of a node, refusals included; with ``once`` it is never asked twice."""
        request = service.type.Request(**fields)
        return self._caller.ask(node, service, request, repeatable=not once)


def _agreed(answer: Any) -> Any:
    if not answer.success:
        raise Refused(answer.message)
    return answer
