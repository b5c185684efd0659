# SPDX-License-Identifier: Apache-2.0
"""The services of running nodes as functions: numpy in, numpy out, no spinning.

Needs ROS 2 and the built workspace, which are imported when a client is made.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.client_values import (
    Array,
    ModelFacts,
    Terms,
    fixed,
    flat,
    points,
    shaped,
    task_shapes,
    vectors,
    whole,
)
from arm_dynamics.exceptions import Refused

ALL_TERMS = 15  # as arm_dynamics.Term.ALL, which would import Pinocchio
_U32 = 2**32 - 1


class ArmClient:
    """Asks a dynamics node and commands a sim node; one instance for each thread.

    Every method waits for the node and for its answer, each at most ``timeout``. The reply to a
    first call may get lost while the two ends find each other, so a first call is repeated where
    that does no harm. Errors: ``NoAnswer`` when no node is there or answers, ``Refused`` with the
    node's words when it will not do it, ``InvalidInput`` for arguments that cannot be sent.

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
        self._services: Any = import_module("arm_dynamics.ros.interfaces")
        self._caller: Any = import_module("arm_dynamics.ros.caller").Caller(timeout, domain)
        self._dynamics, self._sim = dynamics, sim

    def close(self) -> None:
        """Leave the ROS graph; calling it again does no harm."""
        self._caller.close()

    def __enter__(self) -> ArmClient:
        """Use it in a ``with`` statement."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leave the ROS graph."""
        self.close()

    # --- questions -----------------------------------------------------------------------------

    def model_info(self) -> ModelFacts:
        """What the node knows about its arm."""
        answer = self._asked(self._services.MODEL_INFO)
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
        """Torques that produce a motion: the chosen terms of M a + C v + G + F.

        Args:
            q: Positions in [rad] or [m], shape (n,), or (k, n) for k points in one call.
            v: Velocities, of the same shape; None for zeros.
            a: Accelerations, likewise.
            terms: Sum of INERTIA 1, CORIOLIS 2, GRAVITY 4 and FRICTION 8.
            joint_names: Order of all vectors; none for the model's.

        Returns:
            Torques in [N m] or [N], shape of ``q``.
        """
        fields = vectors(position=q, velocity=v, acceleration=a)
        answer = self._asked(
            self._services.INVERSE_DYNAMICS, terms=whole("terms", terms, ALL_TERMS),
            joint_names=list(joint_names), **fields,
        )  # fmt: skip
        return shaped(answer.effort, points(answer, q))

    def forward_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike | None = None,
        tau: ArrayLike | None = None,
        joint_names: Sequence[str] = (),
    ) -> Array:
        """Accelerations that torques produce, shape of ``q``; see ``inverse_dynamics``."""
        fields = vectors(position=q, velocity=v, effort=tau)
        answer = self._asked(
            self._services.FORWARD_DYNAMICS, joint_names=list(joint_names), **fields
        )
        return shaped(answer.acceleration, points(answer, q))

    def dynamics_terms(
        self, q: ArrayLike, v: ArrayLike | None = None, joint_names: Sequence[str] = ()
    ) -> Terms:
        """M, C, G, F and the energies; see ``inverse_dynamics`` for the arguments."""
        fields = vectors(position=q, velocity=v)
        answer = self._asked(
            self._services.DYNAMICS_TERMS, joint_names=list(joint_names), **fields
        )
        shape = points(answer, q)
        squares = (*shape, shape[-1])
        return Terms(
            tuple(answer.joint_names),
            shaped(answer.mass_matrix, squares), shaped(answer.coriolis_matrix, squares),
            shaped(answer.gravity, shape), shaped(answer.friction, shape),
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
        axes: Sequence[str] = ("pose",),
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
        answer = self._asked(
            self._services.TASK_SPACE, frame=str(frame), reference=str(reference), axes=list(axes),
            direction=flat("direction", direction), joint_names=list(joint_names),
            **vectors(position=q, velocity=v),
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

    # --- commands to the simulation ------------------------------------------------------------

    def reset(self) -> None:
        """Put the simulation back to its initial state and time zero."""
        self._commanded(self._services.RESET)

    def pause(self) -> None:
        """Stop the simulation's time."""
        self._commanded(self._services.PAUSE, data=True)

    def resume(self) -> None:
        """Let the simulation's time go on."""
        self._commanded(self._services.PAUSE, data=False)

    def step(self, steps: int = 1) -> float:
        """Advance a paused simulation by whole ticks; return its time in [s]. Asked only once."""
        answer = self._commanded(self._services.STEP, steps=whole("steps", steps, _U32))
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
        self._commanded(
            self._services.SET_JOINT_STATE, joint_names=list(joint_names),
            **vectors(position=q, velocity=v),
        )  # fmt: skip

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
        self._commanded(
            self._services.SET_PAYLOAD, index=whole("index", index, _U32), mass=float(mass),
            com=fixed("com", com, 3), inertia=fixed("inertia", inertia, 6),
        )  # fmt: skip

    def set_friction(self, viscous: ArrayLike, joint_names: Sequence[str] = ()) -> None:
        """Change viscous friction that the scene declares tunable, in [N m s/rad] or [N s/m]."""
        self._commanded(
            self._services.SET_FRICTION, joint_names=list(joint_names),
            viscous=flat("viscous", viscous),
        )  # fmt: skip

    def reset_counters(self) -> None:
        """Have the loop's and the partners' counters begin afresh."""
        self._commanded(self._services.RESET_COUNTERS)

    def _asked(self, service: Any, **fields: Any) -> Any:
        return self._answer(self._dynamics, service, True, fields)

    def _commanded(self, service: Any, **fields: Any) -> Any:
        repeatable = service is not self._services.STEP
        return self._answer(self._sim, service, repeatable, fields)

    def _answer(self, node: str, service: Any, repeatable: bool, fields: dict[str, Any]) -> Any:
        request = service.type.Request(**fields)
        answer = self._caller.ask(node, service, request, repeatable)
        if not answer.success:
            raise Refused(answer.message)
        return answer
