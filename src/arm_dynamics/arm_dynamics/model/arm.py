# SPDX-License-Identifier: Apache-2.0
"""The numerical arm model: a robot with friction, drives, limits and a closed initial state."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from copy import copy

import numpy as np

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.attributes import sealed
from arm_dynamics.exceptions import ConstraintError, SceneError
from arm_dynamics.model.drive import drives_of
from arm_dynamics.model.friction import JointFriction
from arm_dynamics.model.friction_source import FrictionSource, friction_of
from arm_dynamics.model.loop_closure import Closure
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.model.regularity import check_regular
from arm_dynamics.model.robot import Robot, velocity_index
from arm_dynamics.model.springs import springs_of
from arm_dynamics.model.stops import ROUNDED, Range, stops_of
from arm_dynamics.scene.schema import Joint, Limits, Scene
from arm_dynamics.scene.urdf import Mimic

_log = logging.getLogger(__name__)


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
        standing_limit: The same of joints at rest, whose motors a voltage limit bounds as well.
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
        index = velocity_index(self.whole)
        self._set_drives(joints, index)
        self.springs = springs_of(self)
        self._set_limits([joints[name].limits for name in self.joint_names], index)
        self.stops = stops_of(self._ranges(), self.joint_names)
        self.position_lower, self.position_upper = self.stops.limit
        q0 = self._start()
        v0 = np.array([scene.initial.velocity.get(name, 0.0) for name in self.joint_names])
        self.held_at_start = tuple(map(self.joint_names.index, scene.initial.hold))
        self.constraint_rows: dict[int, tuple[int, ...]] = {}
        if scene.bilateral:
            check_regular(RigidTerms(self).mass(q0)[None], self.joint_names)
            closure = Closure(self, self.stops)
            q0, v0 = self._closed(closure, q0, v0)
            self._refuse(q0, "scene: when its constraints are closed, ")
            self.constraint_rows = closure.independent_rows(q0)
        self.q0, self.v0 = read_only(q0), read_only(v0)

    @property
    def viscous(self) -> Array:
        """Viscous friction in [N m s/rad] or [N s/m], the mean of both directions, shape (n,)."""
        return self.friction.viscous.mean

    @property
    def has_dry_friction(self) -> bool:
        """Whether any joint can stick."""
        return self.friction.has_dry

    @property
    def placeholders(self) -> dict[str, str]:
        """Joints whose effort limit in the URDF is probably no figure of the robot, and why.

        Programs that write URDFs give an effort of 1.
        """
        joints = {name: self.scene.joint(name) for name in self.joint_names}
        return {
            name: "effort 1"
            for (name, own), effort in zip(joints.items(), self.effort_limit, strict=True)
            if effort == 1.0 and own.limits.effort is None and own.actuator is None
        }

    def with_friction(self, friction: JointFriction) -> ArmModel:
        """Copy with other friction."""
        other = copy(self)
        vars(other)["friction"] = friction
        return other

    def _ranges(self) -> list[Range]:
        """Ranges of all moving joints, from the scene, else from the URDF."""
        ranges = []
        for name in self._index:
            limits, (lower, upper) = self.scene.joint(name).limits, self._described_range(name)
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

    def _described_range(self, name: str) -> tuple[float, float]:
        """Position limits of any joint in the URDF; infinite where its <limit> gives none."""
        whole = self.whole
        joint = whole.joints[whole.getJointId(name)]
        if joint.nq != 1:
            return -np.inf, np.inf
        lower, upper = whole.lowerPositionLimit[joint.idx_q], whole.upperPositionLimit[joint.idx_q]
        return (float(lower), float(upper)) if lower != upper else (-np.inf, np.inf)

    def _start(self) -> Array:
        """Initial positions before constraints are closed, shape (n,)."""
        initial = self.scene.initial.position
        for name in set(self.scene.robot.lock) & initial.keys():
            (lower, upper), at = self._described_range(name), initial[name]
            if max(lower - at, at - upper) > ROUNDED * max(1.0, abs(at)):
                raise SceneError(
                    f"scene: 'initial.position': locked joint '{name}' at {at:.6g} is "
                    f"beyond its limits; allowed: {lower:.6g} to {upper:.6g}"
                )
        q = np.array([initial.get(name, 0.0) for name in self.joint_names])
        nearest, named = self.stops.within(q), [name in initial for name in self.joint_names]
        self._refuse(np.where(named, q, nearest), "scene: 'initial.position': ")
        return nearest

    def _closed(self, closure: Closure, q: Array, v: Array) -> tuple[Array, Array]:
        """The start with its loops closed; offers another one if it is singular.

        Raises:
            ConstraintError: If they cannot be closed from here.
        """
        hold = self.held_at_start
        try:
            start, v = closure.closed(q, v, hold=hold)
        except ConstraintError as error:
            if (other := closure.other_start(q, hold)) is None:
                raise
            kind = "Here the start is singular; from" if closure.is_singular(q) else "From"
            offer = f"{kind} {self._written(other)} they can be closed"
            raise ConstraintError(f"{error} {offer}", error.residuals) from None
        if closure.is_singular(start) and (other := closure.other_start(start, hold)) is not None:
            _log.warning(
                "scene: the start is singular: the joints can move in more ways there than "
                "elsewhere, and the motion may branch; one that is not: %s", self._written(other),
            )  # fmt: skip
        return start, v

    def _written(self, q: Array) -> str:
        """Initial positions as a scene gives them."""
        pairs = zip(self.joint_names, q, strict=True)
        return f"initial: {{position: {{{', '.join(f'{name}: {x:.6g}' for name, x in pairs)}}}}}"

    def _refuse(self, q: Array, where: str) -> None:
        if refusal := self.stops.refusal(q, self.joint_names):
            raise SceneError(where + refusal)

    def _set_drives(self, joints: Mapping[str, Joint], index: Mapping[str, int]) -> None:
        """Friction and armature from the scene, else from the URDF.

        Those of a follower act through its leader.
        """
        drives, whole = dict(zip(self.joint_names, self.drives, strict=True)), self.whole
        armature, frictions = [], []
        for name, joint in joints.items():
            drive, i = drives.get(name), index[name]
            armature.append((joint.armature or 0.0) + (drive.armature if drive else 0.0))
            frictions.append(
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
        self.pin.armature = np.array(armature)
        self.armature = read_only(self.pin.armature @ self.followers**2)
        self.friction = friction_of(self.scene, frictions, self.joint_names, self.followers)

    def _set_limits(self, limits: Sequence[Limits], index: Mapping[str, int]) -> None:
        """Limits from the scene, else from the URDF, where zero or an absurd value means none."""
        whole = self.whole
        rows = [index[name] for name in self.joint_names]
        self.velocity_limit = _limits([x.velocity for x in limits], whole.upperVelocityLimit[rows])
        effort_limits = _limits([x.effort for x in limits], whole.upperEffortLimit[rows]).tolist()
        efforts, commands, standing, units = [], [], [], []
        for drive, effort, kind in zip(self.drives, effort_limits, self.joint_types, strict=True):
            unit = "N" if kind == "prismatic" else "N m"
            efforts.append(min(drive.torque_limit, effort) if drive else effort)
            commands.append(drive.command_limit(effort) if drive else effort)
            standing.append(drive.command_limit(efforts[-1]) if drive else effort)
            units.append(drive.command_unit(unit) if drive else unit)
        self.effort_limit, self.command_limit = read_only(efforts), read_only(commands)
        self.standing_limit = read_only(standing)
        self.command_unit = tuple(units)


def postures(model: ArmModel, count: int) -> Array:
    """Deterministic positions within the joint limits, or one revolution, shape (count, n)."""
    low = np.where(np.isfinite(model.position_lower), model.position_lower, -np.pi)
    high = np.where(np.isfinite(model.position_upper), model.position_upper, np.pi)
    return np.random.default_rng(0).uniform(low, high, (count, model.n))


def _limits(of_scene: Sequence[float | None], described: Array) -> Array:
    """Limits of the scene, else of the URDF; inf for none."""
    bounded = np.where((described > 0.0) & (described < 1e300), described, np.inf)
    pairs = zip(of_scene, bounded, strict=True)
    return read_only([limit if own is None else own for own, limit in pairs])
