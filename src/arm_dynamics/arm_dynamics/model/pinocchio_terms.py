# SPDX-License-Identifier: Apache-2.0
"""Terms of the equation of motion at one state, and the motion of one frame, from Pinocchio.

Arguments are not validated here: controllers call these functions at every tick.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import ArmError, InvalidInput, ModelError, choices, known_names, plain
from arm_dynamics.model.constraint_rows import ConstraintRows
from arm_dynamics.model.robot import Robot
from arm_dynamics.model.springs import SpringTerms


class MovingFrame(NamedTuple):
    """A frame at a position and velocity of the joints.

    Attributes:
        position: Of its origin in the world in [m], shape (3,).
        rotation: From its axes to the world's, shape (3, 3).
        jacobian: J, shape (6, n).
        jacobian_rate: J̇, shape (6, n).
    """

    position: Array
    rotation: Array
    jacobian: Array
    jacobian_rate: Array


class RigidTerms:
    """Terms of M a + C v + G + S for single states of shape (n,), friction left out.

    S is the torque of springs and their dampers; see ``model.springs``.

    Source of the algorithms: Featherstone, Rigid Body Dynamics Algorithms, 2008, as implemented by
    Pinocchio.

    Args:
        robot: The robot; used from one thread only.

    Attributes:
        robot: The robot.
        springs: Its springs.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot, self._pin = robot, robot.pin
        # Not model.createData(), which makes a copy and takes three times as long.
        self._data = pin.Data(robot.pin)
        self._springs, self._armature = SpringTerms(robot), np.array(robot.pin.armature)
        self.springs = self._springs.springs
        self._direct = robot.coordinates_are_joints
        self._sprung, self._driven = bool(self.springs), bool(self._armature.any())
        self._frames = dict[str, FrameMotion]()

    def inverse(self, q: Array, v: Array, a: Array, weight: float = 1.0) -> Array:
        """M a + C v + G in [N m] or [N], shape (n,); ``weight``: 0 for no gravity."""
        robot, model = self.robot, self._pin if weight else self._weightless
        if self._direct:
            return np.array(pin.rnea(model, self._data, q, v, a))
        full = robot.configuration(q), robot.spread(v), robot.spread(a)
        return np.array(robot.gather(pin.rnea(model, self._data, *full)))

    def frictionless(self, q: Array, v: Array, a: Array) -> Array:
        """M a + C v + G + S in [N m] or [N], shape (n,)."""
        tau = self.inverse(q, v, a)
        return tau + self.spring(q, v) if self._sprung else tau

    def forward(self, q: Array, v: Array, tau: Array) -> Array:
        """M⁻¹ (tau - C v - G) in [rad/s²] or [m/s²], shape (n,).

        Raises:
            ModelError: If a joint moves no mass.
            InvalidInput: If the result overflows.
        """
        robot = self.robot
        if robot.has_followers:
            try:
                return np.linalg.solve(self.mass(q), tau - self.bias(q, v))
            except np.linalg.LinAlgError:
                raise self._unsolvable(q) from None
        full = robot.configuration(q), robot.spread(v)
        # In the axes of each body: in those of the world, far from whose origin the bodies are,
        # ten to a hundred times as much is lost to rounding.
        a: Array = pin.aba(self._pin, self._data, *full, tau, pin.Convention.LOCAL)
        if not math.isfinite(np.vdot(a, a)) and not np.isfinite(a).all():
            raise self._unsolvable(q)
        return a.copy()

    def bias(self, q: Array, v: Array) -> Array:
        """C v + G in [N m] or [N], shape (n,)."""
        robot = self.robot
        full = robot.configuration(q), robot.spread(v)
        return np.array(robot.gather(pin.nonLinearEffects(self._pin, self._data, *full)))

    def gravity(self, q: Array) -> Array:
        """G in [N m] or [N], shape (n,)."""
        tau = pin.computeGeneralizedGravity(self._pin, self._data, self.robot.configuration(q))
        return np.array(self.robot.gather(tau))

    def spring(self, q: Array, v: Array) -> Array:
        """S in [N m] or [N], shape (n,)."""
        return self._springs.torque(q, v)

    def standing(self, q: Array) -> Array:
        """Holding torques G + S of an arm at rest, in [N m] or [N], shape (n,)."""
        return self.gravity(q) + self.spring(q, np.zeros(self.robot.n))

    def mass(self, q: Array) -> Array:
        """M in [kg m²] or [kg], shape (n, n)."""
        return self._square(pin.crba(self._pin, self._data, self.robot.configuration(q)))

    def mobility(self, q: Array) -> Array:
        """M⁻¹ in [1/(kg m²)] or [1/kg], shape (n, n); not finite where a joint moves no mass."""
        if not self.robot.has_followers:
            full = self.robot.configuration(q)
            W = pin.computeMinverse(self._pin, self._data, full)
            return np.array(W).reshape(self.robot.n, -1)
        try:
            return np.linalg.inv(self.mass(q))
        except np.linalg.LinAlgError:
            return np.full((self.robot.n, self.robot.n), np.nan)

    def coriolis(self, q: Array, v: Array) -> Array:
        """C with dM/dt - 2 C skew-symmetric, shape (n, n)."""
        full = self.robot.configuration(q), self.robot.spread(v)
        return self._square(pin.computeCoriolisMatrix(self._pin, self._data, *full))

    def energies(self, q: Array, v: Array) -> Array:
        """Kinetic energy, armature included, and potential energy in [J], shape (2,).

        The potential energy is that of gravity and springs.
        """
        full, v = self.robot.configuration(q), self.robot.spread(v)
        kinetic = pin.computeKineticEnergy(self._driveless, self._data, full, v)
        potential = pin.computePotentialEnergy(self._pin, self._data, full)
        if self._driven:  # Pinocchio 4.1 omits that of some axes
            kinetic += 0.5 * np.vdot(self._armature * v, v)
        if self._sprung:
            potential += self._springs.energy(q)
        return np.array([kinetic, potential])

    def constraint_rows(self, q: Array, v: Array, names: tuple[str, ...]) -> Array:
        """A and γ = Ȧ v of the named bilateral constraints side by side, shape (m, n + 1)."""
        row = self._rows.stacked(q, v, names)
        return np.column_stack([row.jacobian, row.drift])

    def pose(self, q: Array, frame: str) -> Array:
        """Homogeneous transformation from a frame's axes to the world's, shape (4, 4).

        Raises:
            InvalidInput: If there is no such frame; likewise below.
        """
        return self.motion(frame).pose(q)

    def jacobian(self, q: Array, frame: str) -> Array:
        """J of a frame in world axes at its origin, linear rows first, shape (6, n)."""
        return self.motion(frame).jacobian(q)

    def jacobian_derivative(self, q: Array, v: Array, frame: str) -> Array:
        """J̇ of the same J, shape (6, n)."""
        return self.motion(frame).moving(q, v).jacobian_rate

    def motion(self, frame: str) -> FrameMotion:
        """Motion of a frame, in world axes at its origin."""
        if not isinstance(frame, str) or frame not in self._frames:
            self._frames[frame] = FrameMotion(self.robot, frame, "local_world_aligned")
        return self._frames[frame]

    @cached_property
    def _weightless(self) -> pin.Model:
        model = self._pin.copy()
        model.gravity.linear = np.zeros(3)
        return model

    @cached_property
    def _driveless(self) -> pin.Model:
        model = self._pin.copy()
        model.armature = np.zeros(model.nv)
        return model

    @cached_property
    def _rows(self) -> ConstraintRows:
        return ConstraintRows(self.robot)

    def _square(self, matrix: Array) -> Array:
        # Pinocchio returns a single number as a vector.
        n = self.robot.pin.nv
        return self.robot.gather_matrix(matrix.copy().reshape(n, n))

    def _unsolvable(self, q: Array) -> ArmError:
        inertia = np.diag(self.mass(q))
        if inertia.min() > 0.0:
            return InvalidInput("the acceleration overflows: velocities or torques are too large")
        return ModelError(
            f"joint '{self.robot.joint_names[int(np.argmin(inertia))]}' moves no mass, so no "
            "torque determines its acceleration; give a link inertia, the joint an armature, or "
            "lock it"
        )


class FrameMotion:
    """Placement, Jacobian and its rate of one frame, for single states of shape (n,).

    Args:
        model: The model; used from one thread only.
        frame: Name of a frame; J of one that does not move is zero.
        reference: ``local``, ``world`` or ``local_world_aligned``, as in Pinocchio.

    Raises:
        InvalidInput: If the frame or reference is unknown.
    """

    def __init__(self, model: Robot, frame: str, reference: str) -> None:
        self._model, self._pin = model, model.pin
        self._data = pin.Data(model.pin)
        check_frame(model, frame, model.frame_names)
        self._frame = model.frame_index(frame)
        if reference not in _REFERENCES:
            allowed = choices(reference, _REFERENCES)
            raise InvalidInput(f"reference = {reference!r}; allowed: {allowed}")
        self._reference = _REFERENCES[reference]

    def placement(self, q: Array) -> tuple[Array, Array]:
        """Position in [m], shape (3,), and rotation, shape (3, 3), of the frame in the world."""
        pin.forwardKinematics(self._pin, self._data, self._model.configuration(q))
        return self._placed()

    def pose(self, q: Array) -> Array:
        """Homogeneous transformation from the frame's axes to the world's, shape (4, 4)."""
        pin.forwardKinematics(self._pin, self._data, self._model.configuration(q))
        placement = pin.updateFramePlacement(self._pin, self._data, self._frame)
        return np.asarray(placement.homogeneous)

    def of_point(self, q: Array, point: ArrayLike, offset: ArrayLike) -> tuple[Array, Array]:
        """Position of a point that the frame carries, shape (3,), and J there, shape (6, n).

        Args:
            q: Joint positions, shape (n,).
            point: The point in the frame's axes in [m], shape (3,).
            offset: Vector from there in the world's axes in [m], likewise.
        """
        p, R = self.placement(q)
        r, J = R @ np.asarray(point) + offset, self.jacobian(q)
        return p + r, np.vstack([J[:3] - pin.skew(r) @ J[3:], J[3:]])

    def jacobian(self, q: Array) -> Array:
        """J of shape (6, n), linear rows first: velocity of the frame is J v."""
        full = self._model.configuration(q)
        J = pin.computeFrameJacobian(self._pin, self._data, full, self._frame, self._reference)
        return self._gathered(J)

    def moving(self, q: Array, v: Array) -> MovingFrame:
        """The frame, its Jacobian and its rate."""
        model, data, frame = self._pin, self._data, (self._frame, self._reference)
        full = self._model.configuration(q), self._model.spread(v)
        pin.computeJointJacobiansTimeVariation(model, data, *full)
        J = self._gathered(pin.getFrameJacobian(model, data, *frame))
        J_dot = self._gathered(pin.getFrameJacobianTimeVariation(model, data, *frame))
        return MovingFrame(*self._placed(), J, J_dot)

    def accelerated(self, q: Array, v: Array, a: Array) -> tuple[Array, Array, Array, Array]:
        """Position, rotation, velocity and acceleration, shapes (3,), (3, 3), (6,) and (6,).

        The last two are J v and J a + J̇ v, in world axes at the frame's origin.
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

    def _gathered(self, J: Array) -> Array:
        # Pinocchio returns a single column as a vector.
        return self._model.gather(J if J.ndim == 2 else J.reshape(6, -1))


_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
_REFERENCES = {
    "local": pin.ReferenceFrame.LOCAL,
    "world": pin.ReferenceFrame.WORLD,
    "local_world_aligned": _ALIGNED,
}


def check_moving(model: Robot, frame: str) -> None:
    """Refuse a frame that is unknown, or that no joint moves."""
    movable = [name for name in model.frame_names if model.frame(name).parentJoint > 0]
    check_frame(model, frame, movable)
    if model.frame(frame).parentJoint == 0:
        raise InvalidInput(f"frame '{frame}' does not move; allowed: {known_names(movable)}")


def check_frame(model: Robot, frame: str, allowed: Sequence[str]) -> None:
    """Refuse a frame that does not exist, naming those that are ``allowed``."""
    if not model.has_frame(frame):
        names = choices(frame, allowed)
        raise InvalidInput(f"frame '{plain(frame, 80)}' does not exist; allowed: {names}")
