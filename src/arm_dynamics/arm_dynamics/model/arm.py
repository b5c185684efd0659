# SPDX-License-Identifier: Apache-2.0
"""The arm as numbers: a robot with friction, drives, limits and a start where loops are closed."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np
import pinocchio as pin

from arm_dynamics.arrays import Array
from arm_dynamics.model.drive import command_limits, command_units, drives_of, torque_limits
from arm_dynamics.model.friction import Settings, resolve
from arm_dynamics.model.loop_closure import Closure
from arm_dynamics.model.robot import Robot, frozen, velocity_index
from arm_dynamics.scene.schema import Joint, Scene


class ArmModel(Robot):
    """Inertias, joints, limits and friction coefficients of one scene; nothing in it changes.

    Attributes:
        friction: Friction of the joints.
        viscous: Its viscous part in [N m s/rad] or [N s/m], shape (n,).
        coulomb: Dry friction in sliding, of joints without bristles, in [N m] or [N], shape (n,).
        static: Dry friction at rest, likewise, at least ``coulomb``.
        armature: Drive inertia in [kg m²] or [kg], that of rotors on rigid gears included, (n,).
        drives: Drive of each joint, None where the command acts on the link at once.
        effort_limit: Torque limits in [N m] or [N], inf where there is none, shape (n,).
        command_unit: What a command is for each joint: ``N m``, ``N``, ``A`` or ``V``.
        command_limit: Limits of the commands in their units, inf where there is none, shape (n,).
        velocity_limit: Speed limits in [rad/s] or [m/s], inf where there is none, shape (n,).
        position_lower: Lower limits in [rad] or [m], shape (n,).
        position_upper: Upper limits in [rad] or [m], shape (n,).
        q0: Initial positions, shape (n,).
        v0: Initial velocities, shape (n,).
        constraint_rows: Rows of each bilateral constraint that imply all others, by the
            constraint's place in the scene.

    Raises:
        ModelError: If Pinocchio cannot build the robot or no joint is left to move.
        SceneError: If drives, friction or constraints of the scene do not go together.
    """

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        settings = [scene.joint(name) for name in self._index]
        self.drives = tuple(drives_of(scene, self.joint_names, self._rules))
        index = velocity_index(self._whole)
        self._set_drives(settings, index, self._whole)
        self._set_limits(settings, index, self._whole)
        q0 = np.array([scene.initial.position.get(name, 0.0) for name in self.joint_names])
        v0 = np.array([scene.initial.velocity.get(name, 0.0) for name in self.joint_names])
        self.constraint_rows: dict[int, tuple[int, ...]] = {}
        if scene.bilateral:
            closure = Closure(self)
            q0, v0 = closure.closed(q0, v0)
            self.constraint_rows = closure.independent_rows(q0)
        self.q0, self.v0 = frozen(q0), frozen(v0)

    @property
    def has_dry_friction(self) -> bool:
        """Whether a joint can stick."""
        return self.friction.has_dry

    def with_viscous(self, viscous: Array) -> ArmModel:
        """The same arm with other viscous friction in [N m s/rad] or [N s/m], shape (n,)."""
        other = copy(self)
        other.viscous = frozen(viscous)
        other.friction = replace(self.friction, viscous=other.viscous)
        return other

    def _set_drives(self, settings: list[Joint], index: dict[str, int], whole: pin.Model) -> None:
        """Friction and armature from the scene, else from the URDF.

        Those of a follower act through its leader.
        """
        E = self.followers
        urdf = [index[name] for name in self._index]
        armature = np.array([s.armature or 0.0 for s in settings])
        more, efficiency = np.zeros(len(settings)), np.ones(len(settings))
        for name, drive in zip(self.joint_names, self.drives, strict=True):
            if drive is not None:
                more[list(self._index).index(name)] += drive.viscous
                efficiency[list(self._index).index(name)] = drive.motor.efficiency
                armature[list(self._index).index(name)] += drive.armature
        self.pin.armature = armature
        self.armature = frozen(armature @ E**2)
        said = [
            Settings(name, s.friction, whole.damping[i], whole.upperDryFrictionLimit[i], *drive)
            for name, s, i, *drive in zip(
                self._index, settings, urdf, more, efficiency, strict=True
            )
        ]
        self.friction = resolve(said, self.joint_names, E)
        self.viscous = frozen(self.friction.viscous)
        self.coulomb = frozen(self.friction.coulomb)
        self.static = frozen(self.friction.static)

    def _set_limits(self, settings: list[Joint], index: dict[str, int], whole: pin.Model) -> None:
        lower, upper = _position_limits(whole)
        chosen = dict(zip(self._index, settings, strict=True))
        mine = [(chosen[name].limits, index[name], name) for name in self.joint_names]
        efforts = [_or(x.effort, _bound(whole.upperEffortLimit[i])) for x, i, _ in mine]
        self.effort_limit = frozen(torque_limits(self.drives, efforts))
        self.command_unit = command_units(self.drives, self.joint_types)
        self.command_limit = frozen(command_limits(self.drives, self.effort_limit))
        self.velocity_limit = frozen(
            [_or(x.velocity, _bound(whole.upperVelocityLimit[i])) for x, i, _ in mine]
        )
        self.position_lower = frozen([_or(x.lower, lower[name]) for x, _, name in mine])
        self.position_upper = frozen([_or(x.upper, upper[name]) for x, _, name in mine])


def _position_limits(model: pin.Model) -> tuple[dict[str, float], dict[str, float]]:
    lower, upper = {}, {}
    for i, name in enumerate(model.names):
        if i > 0:
            joint = model.joints[i]
            free = joint.nq == 2
            lower[name] = -np.inf if free else float(model.lowerPositionLimit[joint.idx_q])
            upper[name] = np.inf if free else float(model.upperPositionLimit[joint.idx_q])
    return lower, upper


def _bound(value: float) -> float:
    """A limit as the URDF means it: zero or an absurdly large number is 'none'."""
    return float(value) if 0.0 < value < 1e300 else np.inf


def _or(value: float | None, otherwise: float) -> float:
    return float(otherwise) if value is None else float(value)
