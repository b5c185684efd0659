# SPDX-License-Identifier: Apache-2.0
"""Terms of the equation of motion at one state, from Pinocchio.

Arguments are not validated here: controllers call these functions at every tick.
"""

import math
from functools import cached_property

import numpy as np
import pinocchio as pin

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import ArmError, InvalidInput, ModelError
from arm_dynamics.model.constraint_rows import ConstraintRows
from arm_dynamics.model.frame_motion import FrameMotion
from arm_dynamics.model.robot import Robot
from arm_dynamics.model.springs import SpringTerms


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
        self._armature, self._spring_terms = np.array(robot.pin.armature), SpringTerms(robot)
        self.springs = self._spring_terms.springs
        self._coordinates_are_joints = robot.coordinates_are_joints
        self._has_springs, self._has_armature = bool(self.springs), bool(self._armature.any())
        self._frames = dict[str, FrameMotion]()

    def inverse(self, q: Array, v: Array, a: Array, weight: float = 1.0) -> Array:
        """M a + C v + G in [N m] or [N], shape (n,); ``weight``: 0 for no gravity."""
        model = self._pin if weight else self._weightless
        if self._coordinates_are_joints:
            return np.array(pin.rnea(model, self._data, q, v, a))
        tau = pin.rnea(model, self._data, *self.robot.expanded(q, v, a))
        return np.array(self.robot.gather(tau))

    def frictionless(self, q: Array, v: Array, a: Array) -> Array:
        """M a + C v + G + S in [N m] or [N], shape (n,)."""
        tau = self.inverse(q, v, a)
        return tau + self.spring(q, v) if self._has_springs else tau

    def forward(self, q: Array, v: Array, tau: Array) -> Array:
        """M⁻¹ (tau - C v - G) in [rad/s²] or [m/s²], shape (n,).

        Raises:
            ModelError: If a joint moves no mass.
            InvalidInput: If the result overflows.
        """
        if self.robot.has_followers:
            try:
                return np.linalg.solve(self.mass(q), tau - self.bias(q, v))
            except np.linalg.LinAlgError:
                raise self._singular_error(q) from None
        full = self.robot.expanded(q, v)
        # In the axes of each body: in those of the world, far from whose origin the bodies are,
        # ten to a hundred times as much is lost to rounding.
        a: Array = pin.aba(self._pin, self._data, *full, tau, pin.Convention.LOCAL)
        if not math.isfinite(np.vdot(a, a)) and not np.isfinite(a).all():
            raise self._singular_error(q)
        return a.copy()

    def bias(self, q: Array, v: Array) -> Array:
        """C v + G in [N m] or [N], shape (n,)."""
        tau = pin.nonLinearEffects(self._pin, self._data, *self.robot.expanded(q, v))
        return np.array(self.robot.gather(tau))

    def gravity(self, q: Array) -> Array:
        """G in [N m] or [N], shape (n,)."""
        tau = pin.computeGeneralizedGravity(self._pin, self._data, self.robot.configuration(q))
        return np.array(self.robot.gather(tau))

    def spring(self, q: Array, v: Array) -> Array:
        """S in [N m] or [N], shape (n,)."""
        return self._spring_terms.torque(q, v)

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
        full = self.robot.expanded(q, v)
        return self._square(pin.computeCoriolisMatrix(self._pin, self._data, *full))

    def energies(self, q: Array, v: Array) -> Array:
        """Kinetic energy, armature included, and potential energy in [J], shape (2,).

        The potential energy is that of gravity and springs.
        """
        full, v = self.robot.expanded(q, v)
        kinetic = pin.computeKineticEnergy(self._driveless, self._data, full, v)
        potential = pin.computePotentialEnergy(self._pin, self._data, full)
        if self._has_armature:  # Pinocchio 4.1 omits that of some axes
            kinetic += 0.5 * np.vdot(self._armature * v, v)
        if self._has_springs:
            potential += self._spring_terms.energy(q)
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
        if not isinstance(frame, str) or frame not in self._frames:  # or refused, if unknown
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

    def _singular_error(self, q: Array) -> ArmError:
        inertia = np.diag(self.mass(q))
        if inertia.min() > 0.0:
            return InvalidInput("the acceleration overflows: velocities or torques are too large")
        return ModelError(
            f"joint '{self.robot.joint_names[int(np.argmin(inertia))]}' moves no mass, so no "
            "torque determines its acceleration; give a link inertia, the joint an armature, or "
            "lock it"
        )
