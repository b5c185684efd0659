# SPDX-License-Identifier: Apache-2.0
"""Terms of one state without checks: what controllers call at every tick.

The same numbers as ``Dynamics`` gives, for callers that have checked their vectors already.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_dynamics.model.robot import Robot


class RigidTerms:
    """Mass, bias and torques of a model for single states of shape (n,), friction left out.

    Args:
        model: The model; used from one thread only.
        weightless: Whether gravity is left out.
    """

    def __init__(self, model: Robot, weightless: bool = False) -> None:
        self.model = model
        self._pin = model.pin.copy() if weightless else model.pin
        if weightless:
            self._pin.gravity.linear = np.zeros(3)
        self._data = self._pin.createData()
        self._plain = not model.has_followers

    def inverse(self, q: Array, v: Array, a: Array) -> Array:
        """M a + C v + G in [N m] or [N], shape (n,)."""
        model = self.model
        full = model.configuration(q), model.spread(v), model.spread(a)
        return np.array(model.gather(pin.rnea(self._pin, self._data, *full)))

    def bias(self, q: Array, v: Array) -> Array:
        """C v + G in [N m] or [N], shape (n,)."""
        model = self.model
        full = model.configuration(q), model.spread(v)
        return np.array(model.gather(pin.nonLinearEffects(self._pin, self._data, *full)))

    def gravity(self, q: Array) -> Array:
        """G in [N m] or [N], shape (n,)."""
        full = self.model.configuration(q)
        tau = pin.computeGeneralizedGravity(self._pin, self._data, full)
        return np.array(self.model.gather(tau))

    def mass(self, q: Array) -> Array:
        """M in [kg m²] or [kg], shape (n, n)."""
        full = self.model.configuration(q)
        return self._square(pin.crba(self._pin, self._data, full))

    def mobility(self, q: Array) -> Array:
        """M⁻¹ in [1/(kg m²)] or [1/kg], shape (n, n); not finite where a joint moves no mass."""
        if self._plain:
            full = self.model.configuration(q)
            W = pin.computeMinverse(self._pin, self._data, full)
            return np.array(W).reshape(self.model.n, -1)
        try:
            return np.linalg.inv(self.mass(q))
        except np.linalg.LinAlgError:
            return np.full((self.model.n, self.model.n), np.nan)

    def coriolis(self, q: Array, v: Array) -> Array:
        """C with dM/dt - 2 C skew-symmetric, shape (n, n)."""
        full = self.model.configuration(q), self.model.spread(v)
        return self._square(pin.computeCoriolisMatrix(self._pin, self._data, *full))

    def _square(self, matrix: Array) -> Array:
        # Pinocchio hands a single number out as a vector.
        whole = np.array(matrix).reshape(self._pin.nv, -1)
        return self.model.gather_matrix(whole)


class FrameMotion:
    """Placement, Jacobian and its rate of one frame, for single states of shape (n,).

    Args:
        model: The model; used from one thread only.
        frame: Name of a frame that moves.
        reference: ``local``, ``world`` or ``local_world_aligned``, as Pinocchio means them.

    Raises:
        InvalidInput: If there is no such frame or reference, or the frame does not move.
    """

    def __init__(self, model: Robot, frame: str, reference: str) -> None:
        self._model, self._pin = model, model.pin
        self._data = model.pin.createData()
        self._frame = _frame_index(model, frame)
        self._reference = _reference(reference)

    def placement(self, q: Array) -> tuple[Array, Array]:
        """Position in [m], shape (3,), and rotation, shape (3, 3), of the frame in the world."""
        pin.forwardKinematics(self._pin, self._data, self._model.configuration(q))
        return self._placed()

    def jacobian(self, q: Array) -> Array:
        """J of shape (6, n), linear rows first: velocity of the frame is J v."""
        pin.computeJointJacobians(self._pin, self._data, self._model.configuration(q))
        return self._jacobian()

    def moving(self, q: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        """Position, rotation, J and J̇, shapes (3,), (3, 3), (6, n) and (6, n)."""
        full = self._model.configuration(q), self._model.spread(v)
        pin.computeJointJacobiansTimeVariation(self._pin, self._data, *full)
        J_dot = pin.getFrameJacobianTimeVariation(
            self._pin, self._data, self._frame, self._reference
        )
        return *self._placed(), self._jacobian(), self._gathered(J_dot)

    def accelerated(self, q: Array, v: Array, a: Array) -> tuple[Array, Array, Array, Array]:
        """Position, rotation, velocity and acceleration, shapes (3,), (3, 3), (6,) and (6,).

        The last two are J v and J a + J̇ v, axes of the world at the frame's origin.
        """
        model, data, index, axes = self._pin, self._data, self._frame, _ALIGNED
        full = self._model.configuration(q), self._model.spread(v), self._model.spread(a)
        pin.forwardKinematics(model, data, *full)
        velocity = pin.getFrameVelocity(model, data, index, axes).vector
        acceleration = pin.getFrameClassicalAcceleration(model, data, index, axes).vector
        return *self._placed(), velocity, acceleration

    def _placed(self) -> tuple[Array, Array]:
        placement = pin.updateFramePlacement(self._pin, self._data, self._frame)
        return placement.translation.copy(), placement.rotation.copy()

    def _jacobian(self) -> Array:
        return self._gathered(
            pin.getFrameJacobian(self._pin, self._data, self._frame, self._reference)
        )

    def _gathered(self, J: Array) -> Array:
        # Pinocchio hands a single column out as a vector.
        J = J.reshape(6, -1)
        return J @ self._model.followers if self._model.has_followers else J


_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
_REFERENCES = {
    "local": pin.ReferenceFrame.LOCAL,
    "world": pin.ReferenceFrame.WORLD,
    "local_world_aligned": pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
}


def _reference(name: str) -> pin.ReferenceFrame:
    if name not in _REFERENCES:
        raise InvalidInput(f"reference = {name!r}; allowed: {known_names(_REFERENCES)}")
    return _REFERENCES[name]


def _frame_index(model: Robot, frame: str) -> int:
    movable = [f.name for f in model.pin.frames if f.parentJoint > 0]
    if frame not in model.frame_names:
        raise InvalidInput(f"frame '{frame}' does not exist; allowed: {known_names(movable)}")
    index = model.frame_names.index(frame)
    if model.pin.frames[index].parentJoint == 0:
        raise InvalidInput(f"frame '{frame}' does not move; allowed: {known_names(movable)}")
    return index
