# SPDX-License-Identifier: Apache-2.0
"""The pull of the mouse at an arm."""

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.pinocchio_terms import RigidTerms

# Acceleration in [m/s²] of what the mouse holds from one reach away
PULL = 2.0 * 9.81


class MousePull:
    """A spring from the mouse to a point that an arm carries.

    It accelerates what is held alike, be it light or heavy: a force along u meets the mass
    1/(uᵀ J M⁻¹ Jᵀ u) (Khatib, "Inertial properties in robotic manipulation", Int. J. Robotics
    Research 14(1), 1995); near singularities, that of the arm.

    Attributes:
        frame: Frame that is pulled; None: the mouse holds nothing.
    """

    def __init__(self, model: ArmModel, rigid: RigidTerms) -> None:
        self._model, self._rigid = model, rigid
        self.frame: str | None = None
        self._point, self._mouse = np.zeros((2, 3))

    def pull(self, q: Array, frame: str, held: Array, mouse: Array) -> None:
        """Pull a frame where it was seized, in [m], towards the mouse; the arm is at q."""
        if frame != self.frame:
            position, rotation = self._rigid.motion(frame).placement(q)
            self.frame, self._point = frame, rotation.T @ (held - position)
        self._mouse = mouse

    def release(self) -> None:
        """End the pull."""
        self.frame = None

    def torque(self, q: Array) -> Array:
        """Torques of the pull, shape (n,)."""
        if self.frame is None:
            return np.zeros(self._model.n)
        held, J = self._rigid.motion(self.frame).of_point(q, self._point, np.zeros(3))
        way = self._mouse - held
        torque = way @ J[:3]
        mobility, whole = torque @ self._rigid.mobility(q) @ torque, self._model.total_mass
        mass = way @ way / mobility if whole * mobility > way @ way else whole
        return np.asarray(PULL * mass / self._model.reach * torque)
