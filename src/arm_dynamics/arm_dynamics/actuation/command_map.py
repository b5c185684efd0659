# SPDX-License-Identifier: Apache-2.0
"""Conversion of desired joint torques to commands of the drives."""

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import sealed
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.equations import motor
from arm_dynamics.equations.elementary import Quantity
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.drive import JointDrive
from arm_dynamics.model.rigid_expressions import RigidExpressions
from arm_dynamics.scene.imperfections import Commands
from arm_dynamics.scene.schema import Scene


@sealed
class CommandMap:
    """Commands with which the drives of an arm produce desired torques, drives taken as rigid.

    A torque is unchanged; a current is i = τ / (N K_t), a voltage u = R i + N K_e v, after
    subtracting the cogging torque. The drives' own dynamics are neglected: the current that an
    inductance delays, the twist of a flexible transmission. Nothing is clipped to limits. Where
    the scene's commands are ``gravity_compensated``, the arm compensates gravity itself, and
    commands are added to that.

    Args:
        model: The arm; without drives every command is the torque itself.
    """

    def __init__(self, model: ArmModel) -> None:
        drives = model.drives
        self._gain = np.array([_gain(drive) if drive else 1.0 for drive in drives])
        by_voltage = [d if d and d.motor.command == "voltage" else None for d in drives]
        self._back_emf = np.array([d.back_emf_constant if d else 0.0 for d in by_voltage])
        self._poles = [(i, d.motor) for i, d in enumerate(drives) if d and d.motor.cogging]
        scaled = bool((self._gain != 1.0).any())
        self._weight = _weight(model) if gravity_compensated(model.scene) else None
        self._is_identity = not (scaled or self._back_emf.any() or self._poles or self._weight)
        flexible = [drive if drive and drive.coupling else None for drive in drives]
        self.rotor_inertia: Array = np.array([d.rotor_inertia if d else 0.0 for d in flexible])
        """Inertia of rotors on flexible transmissions, not included in M, at the joint, shape
        (n,)."""
        self.rotor_damping: Array = np.array([d.rotor_damping if d else 0.0 for d in flexible])
        """Damping of rotors on flexible transmissions, not included in F, at the joint."""

    def __call__(self, q: Quantity, v: Quantity, tau: Quantity) -> Quantity:
        """Commands for torques.

        Args:
            q: Joint positions in [rad] or [m], shape (n,) or (k, n), or an expression.
            v: Joint velocities in [rad/s] or [m/s], likewise.
            tau: Desired torques in [N m] or [N], likewise.

        Returns:
            Commands in the units of ``ArmModel.command_unit``, of the same shape.
        """
        if self._is_identity:
            return tau
        is_symbolic = isinstance(tau, ca.SX)
        required = self._without_cogging(q, tau)
        if self._weight is not None:
            weight = self._weight(q if is_symbolic else np.asarray(q).T)
            required -= weight if is_symbolic else np.array(weight).T.reshape(required.shape)
        like = ca.DM if is_symbolic else np.asarray
        return like(self._gain) * required + like(self._back_emf) * v

    def of_motors(self, q: Array, v: Array, a: Array, tau: Array) -> Array:
        """Torques of the motors' currents, at the joints, in a motion, drives taken as rigid.

        They also accelerate rotors on flexible transmissions, and overcome their damping and
        cogging. Without motors, they are the joint torques.

        Args:
            q: Joint positions in [rad] or [m], shape (n,) or (k, n).
            v: Joint velocities in [rad/s] or [m/s], likewise.
            a: Joint accelerations in [rad/s²] or [m/s²], likewise.
            tau: Joint torques in [N m] or [N], likewise.
        """
        rotors = self.rotor_inertia * a + self.rotor_damping * v
        return np.asarray(self._without_cogging(q, tau + rotors))

    def _without_cogging(self, q: Quantity, tau: Quantity) -> Quantity:
        """Torques less those of cogging; a copy."""
        is_symbolic = isinstance(tau, ca.SX)
        required = ca.SX(tau) if is_symbolic else np.array(tau, dtype=float)
        for joint, m in self._poles:
            assert m.cogging is not None
            i = joint if is_symbolic else (..., joint)
            required[i] -= m.gear_ratio * motor.cogging_torque(m.gear_ratio * q[i], m.cogging)
        return required

    @property
    def factors(self) -> tuple[Array, ...] | None:
        """Factors of torque and velocity whose products sum to the commands, each of shape (n,).

        They are empty if every command is the torque itself, and None if commands also depend on
        positions.
        """
        if self._is_identity:
            return ()
        by_position = self._poles or self._weight is not None
        return None if by_position else (self._gain, self._back_emf)

    def compensation(self, q: ca.SX) -> ca.SX | float:
        """Gravity compensation that the arm adds to commands: an expression (n,), or zero."""
        return 0.0 if self._weight is None else ca.DM(self._gain) * self._weight(q)


def gravity_compensated(scene: Scene) -> bool:
    """Whether commands are added to the arm's own gravity compensation."""
    return scene.commands is not None and scene.commands.gravity_compensated


def with_compensation(scene: Scene) -> Scene:
    """Copy of the scene with ``gravity_compensated`` commands."""
    if gravity_compensated(scene):
        return scene
    commands = (scene.commands or Commands()).model_copy(update={"gravity_compensated": True})
    return scene.model_copy(update={"commands": commands})


@one_at_a_time
def _weight(model: ArmModel) -> ca.Function:
    """Torques that balance gravity and springs, (q) -> shape (n,)."""
    q = ca.SX.sym("q", model.n)
    weight = RigidExpressions(model).standing(q)
    return ca.Function("weight", [q], [ca.densify(weight)], {"cse": True})


def rigid_twin(scene: Scene) -> Scene:
    """Copy of a scene with rigid transmissions, for a controller that measures only joints.

    Its M includes the rotors. A scene without transmissions is returned unchanged.
    """
    if not any(joint.transmission for joint in scene.joints.values()):
        return scene
    rigid = {"transmission": None}
    joints = {name: joint.model_copy(update=rigid) for name, joint in scene.joints.items()}
    return scene.model_copy(update={"joints": joints})


def _gain(drive: JointDrive) -> float:
    """Command per torque of a drive at rest."""
    if drive.motor.command == "torque":
        return 1.0
    resistance = drive.motor.resistance if drive.motor.command == "voltage" else None
    return (resistance or 1.0) / drive.torque_constant
