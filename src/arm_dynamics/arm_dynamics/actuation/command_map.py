# SPDX-License-Identifier: Apache-2.0
"""From the torque that a joint is to get to the command that its drive takes."""

from __future__ import annotations

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.equations import motor, spring
from arm_dynamics.equations.elementary import Quantity
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.drive import JointDrive
from arm_dynamics.model.tree_builder import gravity_of, tree_of
from arm_dynamics.scene.imperfections import Commands
from arm_dynamics.scene.schema import Scene


class CommandMap:
    """Commands that make the drives of an arm give required torques, as if they were rigid.

    A torque stays what it is; a current is i = τ / (N K_t), a voltage u = R i + N K_e v, with the
    torque of the poles taken off first. What a drive needs time for is left out: the current
    that an inductance delays, the twist of a flexible transmission. Nothing is cut at limits.
    Where the scene's commands are ``gravity_compensated``, the arm carries its own weight, and
    commands are what comes on top.

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
        self._idle = not (scaled or self._back_emf.any() or self._poles or self._weight)
        soft = [drive if drive and drive.coupling else None for drive in drives]
        self.rotor_inertia: Array = np.array([d.rotor_inertia if d else 0.0 for d in soft])
        """Of rotors on flexible transmissions, which M does not hold, at the joint, shape (n,)."""
        self.rotor_damping: Array = np.array([d.rotor_damping if d else 0.0 for d in soft])
        """Of the same rotors, which F does not hold."""

    def __call__(self, q: Quantity, v: Quantity, tau: Quantity) -> Quantity:
        """Commands for torques.

        Args:
            q: Joint positions in [rad] or [m], shape (n,) or (k, n), or an expression.
            v: Joint velocities in [rad/s] or [m/s], likewise.
            tau: Wanted torques in [N m] or [N], likewise.

        Returns:
            Commands in the units of ``ArmModel.command_unit``, of the same shape.
        """
        if self._idle:
            return tau
        symbolic = isinstance(tau, ca.SX)
        required = ca.SX(tau) if symbolic else np.array(tau, dtype=float)
        if self._weight is not None:
            carried = self._weight(q if symbolic else np.asarray(q).T)
            required -= carried if symbolic else np.array(carried).T.reshape(required.shape)
        for joint, m in self._poles:
            assert m.cogging is not None
            i = joint if symbolic else (..., joint)
            required[i] -= m.gear_ratio * motor.cogging_torque(m.gear_ratio * q[i], m.cogging)
        like = ca.DM if symbolic else np.asarray
        return like(self._gain) * required + like(self._back_emf) * v

    @property
    def factors(self) -> tuple[Array, ...] | None:
        """Factors of torque and velocity whose products add up to commands, each of shape (n,).

        They are empty if every command is the torque itself, and None if commands also depend on
        positions.
        """
        if self._idle:
            return ()
        by_position = self._poles or self._weight is not None
        return None if by_position else (self._gain, self._back_emf)

    def compensation(self, q: ca.SX) -> ca.SX | float:
        """What the arm adds to commands by itself, an expression of shape (n,), or zero."""
        return 0.0 if self._weight is None else ca.DM(self._gain) * self._weight(q)


def gravity_compensated(scene: Scene) -> bool:
    """Whether commands come on top of what carries the arm's own weight."""
    return scene.commands is not None and scene.commands.gravity_compensated


def compensating(scene: Scene) -> Scene:
    """The same scene with commands that are ``gravity_compensated``."""
    if gravity_compensated(scene):
        return scene
    commands = (scene.commands or Commands()).model_copy(update={"gravity_compensated": True})
    return scene.model_copy(update={"commands": commands})


def _weight(model: ArmModel) -> ca.Function:
    """Torques that carry the weight, with the springs' help, (q) -> shape (n,)."""
    q, still = ca.SX.sym("q", model.n), ca.SX(model.n, 1)
    carried = spring.frictionless(
        model.springs, tree_of(model), q, still, still, gravity=gravity_of(model)
    )
    return ca.Function("weight", [q], [ca.densify(carried)], {"cse": True})


def rigid_twin(scene: Scene) -> Scene:
    """The same arm with rigid transmissions: what a controller that sees only its joints knows.

    Its M holds the rotors. A scene without transmissions is returned as it is.
    """
    if not any(joint.transmission for joint in scene.joints.values()):
        return scene
    joints = {
        name: joint.model_copy(update={"transmission": None})
        for name, joint in scene.joints.items()
    }
    return scene.model_copy(update={"joints": joints})


def _gain(drive: JointDrive) -> float:
    """Command per torque of a drive at rest."""
    if drive.motor.command == "torque":
        return 1.0
    resistance = drive.motor.resistance if drive.motor.command == "voltage" else None
    return (resistance or 1.0) / drive.torque_constant
