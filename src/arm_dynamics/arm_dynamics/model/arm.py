# SPDX-License-Identifier: Apache-2.0
"""The numerical arm model: a robot with friction, drives, limits and a closed initial state."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.attributes import sealed, with_values
from arm_dynamics.exceptions import SceneError
from arm_dynamics.model.drive import JointDrive, drives_of
from arm_dynamics.model.friction.joint_friction import JointFriction
from arm_dynamics.model.friction.source import FrictionSource, friction_of
from arm_dynamics.model.initial_state import initial_state
from arm_dynamics.model.robot import Robot, velocity_index
from arm_dynamics.model.springs import springs_of
from arm_dynamics.model.stops import Range, stops_of
from arm_dynamics.scene.schema import Joint, Scene
from arm_dynamics.scene.urdf.description import Mimic


@sealed
class ArmModel(Robot):
    """Inertias, joints, limits and friction coefficients of one scene; immutable.

    Attributes:
        friction: Friction of the joints.
        springs: Springs of joints and between points.
        armature: Drive inertia in [kg m²] or [kg], including rotors on rigid gears, shape (n,).
        drives: Drive of each joint, None where the command acts on the link directly.
        effort_limit: Torque limits at rest in [N m] or [N], inf if unlimited, shape (n,).
        command_unit: Unit of each joint's command: ``N m``, ``N``, ``A`` or ``V``.
        command_limit: Command limits in those units, inf if unlimited, shape (n,).
        standing_limit: Command limits of joints at rest, where a voltage bounds motors, too.
        velocity_limit: Speed limits in [rad/s] or [m/s], inf if unlimited, shape (n,).
        stops: Ranges of the joints and the stops at their ends.
        position_lower: Lower limits in [rad] or [m], shape (n,).
        position_upper: Upper limits in [rad] or [m], shape (n,).
        held_at_start: Indices of joints that keep their initial state when loops are closed.
        q0: Initial positions, shape (n,).
        v0: Initial velocities, shape (n,).
        constraint_rows: Independent rows of each bilateral constraint, by the constraint's index
            in the scene.

    Raises:
        ModelError: If Pinocchio cannot build the robot, no movable joint is left, or the robot has
            constraints and a singular mass matrix.
        SceneError: If drives, friction, springs or constraints of the scene contradict one
            another.
    """

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        joints = {name: scene.joint(name) for name in self._index}
        self.drives = tuple(drives_of(scene, self.joint_names, self._rules))
        self.pin.armature, friction = self._armature_and_friction(joints)
        # With this the robot is complete, to which all that follows refers.
        self.armature = read_only(self.pin.armature @ self.followers**2)
        self.friction = friction_of(scene, friction, self.joint_names, self.followers)
        self.springs = springs_of(self)

        own = [joints[name].limits for name in self.joint_names]
        rows = [velocity_index(self.whole)[name] for name in self.joint_names]
        speeds, efforts = self.whole.upperVelocityLimit[rows], self.whole.upperEffortLimit[rows]
        self.velocity_limit = _limits([x.velocity for x in own], speeds)
        efforts = _limits([x.effort for x in own], efforts)
        torques = [drive.torque_limit if drive else np.inf for drive in self.drives]
        self.effort_limit = read_only(np.minimum(torques, efforts))
        self.command_limit = _command_limits(self.drives, efforts)
        self.standing_limit = _command_limits(self.drives, self.effort_limit)
        units = zip(self.drives, self.units("N m", "N"), strict=True)
        self.command_unit = tuple(x.command_unit(unit) if x else unit for x, unit in units)

        self.stops = stops_of(self._ranges(joints), self.joint_names)
        self.position_lower, self.position_upper = self.stops.limit
        self.held_at_start = tuple(map(self.joint_names.index, scene.initial.hold))
        self.q0, self.v0, self.constraint_rows = initial_state(self, self.stops)

    @property
    def viscous(self) -> Array:
        """Viscous friction in [N m s/rad] or [N s/m], the mean of both directions, shape (n,)."""
        return self.friction.viscous.mean

    @property
    def has_dry_friction(self) -> bool:
        """Whether any joint can stick."""
        return self.friction.has_dry

    @property
    def placeholder_limits(self) -> tuple[str, ...]:
        """Joints whose effort limit of 1 in the URDF is probably no figure of the robot.

        Programs that write URDFs give that.
        """
        joints = {name: self.scene.joint(name) for name in self.joint_names}
        return tuple(
            name
            for (name, own), effort in zip(joints.items(), self.effort_limit, strict=True)
            if effort == 1.0 and own.limits.effort is None and own.actuator is None
        )

    def with_friction(self, friction: JointFriction) -> ArmModel:
        """Copy with other friction."""
        return with_values(self, friction=friction)

    def _armature_and_friction(
        self, joints: Mapping[str, Joint]
    ) -> tuple[Array, list[FrictionSource]]:
        """Armature and friction of all moving joints, from the scene, else from the URDF.

        A follower's act through its leader.
        """
        drives, whole = dict(zip(self.joint_names, self.drives, strict=True)), self.whole
        armature, friction, index = [], list[FrictionSource](), velocity_index(whole)
        for name, joint in joints.items():
            drive, i = drives.get(name), index[name]
            armature.append((joint.armature or 0.0) + (drive.armature if drive else 0.0))
            friction.append(
                FrictionSource(
                    name,
                    joint.friction,
                    self.scene.joints.get(name, Joint()).friction,
                    damping=float(whole.damping[i]),
                    dry=float(whole.upperDryFrictionLimit[i]),
                    drive_viscous=drive.viscous if drive else 0.0,
                    efficiency=drive.motor.efficiency if drive else 1.0,
                )
            )
        return np.array(armature), friction

    def _ranges(self, joints: Mapping[str, Joint]) -> list[Range]:
        """Ranges of all moving joints, from the scene, else from the URDF."""
        ranges = []
        for name, joint in joints.items():
            limits, (lower, upper) = joint.limits, self.described_range(name)
            lower = lower if limits.lower is None else limits.lower
            upper = upper if limits.upper is None else limits.upper
            if (limits.lower, limits.upper) != (None, None) and lower >= upper:
                raise SceneError(
                    f"scene: 'joints.{name}.limits': with that of the robot description, lower = "
                    f"{lower:g} is not below upper = {upper:g}; give both, or robot.lock"
                )
            rule = self._rules.get(name, Mimic(name, 1.0, 0.0))
            leader = self.joint_names.index(rule.leader)
            mimic = leader, rule.multiplier, rule.offset
            ranges.append(Range(name, lower, upper, limits.stop, *mimic))
        return ranges


def postures(model: ArmModel, count: int) -> Array:
    """Deterministic positions within the joint limits, or one revolution, shape (count, n)."""
    low = np.where(np.isfinite(model.position_lower), model.position_lower, -np.pi)
    high = np.where(np.isfinite(model.position_upper), model.position_upper, np.pi)
    return np.random.default_rng(0).uniform(low, high, (count, model.n))


def _limits(of_scene: Sequence[float | None], described: Array) -> Array:
    """Limits of the scene, else of the URDF, where zero or an absurd value means none, inf."""
    bounded = np.where((described > 0.0) & (described < 1e300), described, np.inf)
    pairs = zip(of_scene, bounded, strict=True)
    return read_only([limit if own is None else own for own, limit in pairs])


def _command_limits(drives: Iterable[JointDrive | None], efforts: Array) -> Array:
    """Limits of commands, for limits of the joints' torques."""
    pairs = zip(drives, efforts.tolist(), strict=True)
    return read_only([drive.command_limit(effort) if drive else effort for drive, effort in pairs])
