# SPDX-License-Identifier: Apache-2.0
"""What a client can order a sim node to do."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from arm_dynamics.client.connection import Connection
from arm_dynamics.client.values import fixed, motion, whole

_U32 = 2**32 - 1


class Orders(Connection):
    """Orders to a sim node."""

    def reset(self) -> None:
        """Put the simulation back to its initial state and time zero."""
        self._ordered(self._services.RESET)

    def pause(self) -> None:
        """Stop the simulation's time."""
        self._ordered(self._services.PAUSE, data=True)

    def resume(self) -> None:
        """Let the simulation's time go on."""
        self._ordered(self._services.PAUSE, data=False)

    def step(self, steps: int = 1) -> float:
        """Advance a paused simulation by whole ticks; return its time in [s]. Asked only once."""
        answer = self._ordered(self._services.STEP, steps=whole("steps", steps, _U32))
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
        self._ordered(self._services.SET_JOINT_STATE, **fields)

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
        self._ordered(
            self._services.SET_PAYLOAD, index=whole("index", index, _U32), mass=float(mass),
            com=fixed("com", com, 3), inertia=fixed("inertia", inertia, 6),
        )  # fmt: skip

    def set_friction(self, viscous: ArrayLike, joint_names: Sequence[str] = ()) -> None:
        """Change viscous friction that the scene declares tunable, in [N m s/rad] or [N s/m]."""
        self._ordered(self._services.SET_FRICTION, **motion(joint_names, viscous=viscous))

    def reset_counters(self) -> None:
        """Have the loop's and the partners' counters begin afresh."""
        self._ordered(self._services.RESET_COUNTERS)
