# SPDX-License-Identifier: Apache-2.0
"""The services of running nodes as functions: NumPy in, NumPy out, no spinning."""

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import fields
from types import MappingProxyType
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import sealed
from arm_dynamics.client.results import (
    ConstrainedMotion,
    ModelFacts,
    NotReached,
    Postures,
    TaskTerms,
    Terms,
)
from arm_dynamics.client.values import fields_of, fixed, flat, motion, rows, shaped, whole, words
from arm_dynamics.exceptions import Refused
from arm_dynamics.ros import interfaces
from arm_dynamics.ros.common.caller import Caller
from arm_dynamics.terms.table import OF_SERVICE, TASK_SPACE, Term

_U32 = 2**32 - 1


@sealed
class ArmClient(AbstractContextManager["ArmClient"]):
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

    def __exit__(self, *_: object) -> None:
        """Leave the ROS graph."""
        self.close()

    # --- the dynamics node ---------------------------------------------------------------------

    def model_info(self) -> ModelFacts:
        """Properties of the node's arm."""
        response = self._call(self._dynamics, interfaces.MODEL_INFO)
        values = {field.name: getattr(response, field.name) for field in fields(ModelFacts)}
        for name, value in values.items():
            if not isinstance(value, str | float):
                values[name] = tuple(value) if isinstance(value, list) else np.array(value, float)
        return ModelFacts(**values)

    def inverse_dynamics(
        self, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None,
        terms: int = Term.ALL, joint_names: Sequence[str] = (),
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
        options = {"terms": whole("terms", terms, Term.ALL)}
        response, shape = self._call_at(
            interfaces.INVERSE_DYNAMICS, q, joint_names, options, velocity=v, acceleration=a
        )
        return shaped(response.effort, shape)

    def forward_dynamics(
        self, q: ArrayLike, v: ArrayLike | None = None, tau: ArrayLike | None = None,
        joint_names: Sequence[str] = (),
    ) -> Array:  # fmt: skip
        """Accelerations that torques produce, shape of ``q``; see ``inverse_dynamics``."""
        response, shape = self._call_at(
            interfaces.FORWARD_DYNAMICS, q, joint_names, velocity=v, effort=tau
        )
        return shaped(response.acceleration, shape)

    def dynamics_terms(
        self, q: ArrayLike, v: ArrayLike | None = None, joint_names: Sequence[str] = ()
    ) -> Terms:
        """M, C, G, F, S and the energies; see ``inverse_dynamics`` for the arguments."""
        service = interfaces.DYNAMICS_TERMS
        response, (*batch, n) = self._call_at(service, q, joint_names, velocity=v)
        shapes = {name: shape for entry in OF_SERVICE for name, shape in entry.parts.items()}
        return Terms(tuple(response.joint_names), **fields_of(response, shapes, tuple(batch), n=n))

    def task_space(
        self, frame: str, q: ArrayLike, v: ArrayLike | None = None, *,
        reference: str = "local_world_aligned", axes: str | Sequence[str] = "pose",
        direction: ArrayLike = (), joint_names: Sequence[str] = (),
    ) -> TaskTerms:  # fmt: skip
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
        """
        options = {
            "frame": str(frame), "reference": str(reference), "axes": words("axes", axes),
            "direction": flat("direction", direction),
        }  # fmt: skip
        response, (*batch, n) = self._call_at(
            interfaces.TASK_SPACE, q, joint_names, options, velocity=v
        )
        names = {"axes": tuple(response.axes), "joint_names": tuple(response.joint_names)}
        shapes = TASK_SPACE | {"effective_mass": (), "effective_mass_bounded": ()}
        arrays = fields_of(response, shapes, tuple(batch), n=n, m=len(response.axes))
        return cast(TaskTerms, names | arrays)

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
        response = self._response(self._dynamics, interfaces.INVERSE_KINEMATICS, fields, once=True)
        if not len(response.reached):
            _accepted(response)
        names = tuple(response.joint_names)
        if seed is not None:
            rows("seed", seed, len(names))
        postures = Postures(
            names, shaped(response.position, (*batch, len(names))),
            np.array(response.reached, bool).reshape(batch),
            shaped(response.distance, batch), shaped(response.angle, batch),
        )  # fmt: skip
        if not response.success:
            raise NotReached(response.message, postures)
        return postures

    def constrained_dynamics(
        self, q: ArrayLike, v: ArrayLike | None = None, tau: ArrayLike | None = None,
        joint_names: Sequence[str] = (),
    ) -> ConstrainedMotion:  # fmt: skip
        """Accelerations and forces that torques produce under the scene's constraints.

        τ = M a + C v + G + S + F + Aᵀλ with A v = 0, for the initially active constraints.
        Arguments as for ``forward_dynamics``; the constraints should be satisfied at ``q``.
        """
        response, shape = self._call_at(
            interfaces.CONSTRAINED_DYNAMICS, q, joint_names, velocity=v, effort=tau
        )
        names = tuple(response.constraint_names)
        return ConstrainedMotion(
            tuple(response.joint_names), names, shaped(response.acceleration, shape),
            shaped(response.multipliers, (*shape[:-1], len(names))),
        )  # fmt: skip

    def constrained_inverse_dynamics(
        self, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None,
        multipliers: ArrayLike | None = None, joint_names: Sequence[str] = (),
    ) -> Array:  # fmt: skip
        """Torques for a motion and for forces on the scene's constraints.

        As ``inverse_dynamics``, with ``multipliers`` λ as ``constrained_dynamics`` gives them, in
        [N] or [N m], shape (m,), or (k, m); None for zeros.
        """
        response, shape = self._call_at(
            interfaces.CONSTRAINED_DYNAMICS, q, joint_names, {"inverse": True},
            velocity=v, acceleration=a, multipliers=multipliers,
        )  # fmt: skip
        return shaped(response.effort, shape)

    # --- the sim node --------------------------------------------------------------------------

    def reset(self) -> None:
        """Reset the simulation to its initial state and time zero."""
        self._call(self._sim, interfaces.RESET)

    def pause(self) -> None:
        """Pause the simulation."""
        self._call(self._sim, interfaces.PAUSE, data=True)

    def resume(self) -> None:
        """Resume the simulation."""
        self._call(self._sim, interfaces.PAUSE, data=False)

    def step(self, steps: int = 1) -> float:
        """Advance a paused simulation by whole ticks; return its time in [s]. Never repeated."""
        fields = {"steps": whole("steps", steps, _U32)}
        return float(_accepted(self._response(self._sim, interfaces.STEP, fields, once=True)).time)

    def set_joint_state(
        self, q: ArrayLike | None = None, v: ArrayLike | None = None,
        joint_names: Sequence[str] = (),
    ) -> None:  # fmt: skip
        """Set joint positions and velocities at once.

        Args:
            q: Positions in [rad] or [m], one for each joint; None keeps the current ones.
            v: Velocities, likewise; None for zeros.
            joint_names: Names of the joints; empty for all, in model order.
        """
        fields = motion(joint_names, position=q, velocity=v)
        self._call(self._sim, interfaces.SET_JOINT_STATE, **fields)

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
        self._call(
            self._sim, interfaces.SET_PAYLOAD, index=whole("index", index, _U32), mass=float(mass),
            com=fixed("com", com, 3), inertia=fixed("inertia", inertia, 6),
        )  # fmt: skip

    def set_friction(self, viscous: ArrayLike, joint_names: Sequence[str] = ()) -> None:
        """Change viscous friction that the scene declares tunable.

        Args:
            viscous: Coefficients in [N m s/rad] or [N s/m], shape (n,).
            joint_names: Names of the joints; empty for all, in model order.
        """
        self._call(self._sim, interfaces.SET_FRICTION, **motion(joint_names, viscous=viscous))

    def reset_counters(self) -> None:
        """Reset the counters of the loop and of its communication partners."""
        self._call(self._sim, interfaces.RESET_COUNTERS)

    def _call(self, node: str, service: interfaces.Service, **fields: Any) -> Any:
        """The response of a node; raises ``Refused`` if the request was declined."""
        return _accepted(self._response(node, service, fields))

    def _call_at(
        self, service: interfaces.Service, q: ArrayLike, joint_names: Sequence[str],
        options: Mapping[str, Any] = MappingProxyType({}), **vectors: ArrayLike | None,
    ) -> tuple[Any, tuple[int, ...]]:  # fmt: skip
        """The response of the dynamics node at points, and their shape: (n,) or (k, n)."""
        fields = motion(joint_names, position=q, **vectors)
        response = self._call(self._dynamics, service, **fields, **options)
        n = len(response.joint_names)
        return response, (*rows("position", q, n), n)

    def _response(
        self, node: str, service: interfaces.Service, fields: dict[str, Any], once: bool = False
    ) -> Any:
        """The response of a node, refusals included; with ``once``, the request is sent once."""
        request = service.type.Request(**fields)
        return self._caller.ask(node, service, request, repeatable=not once)


def _accepted(response: Any) -> Any:
    if not response.success:
        raise Refused(response.message)
    return response
