# SPDX-License-Identifier: Apache-2.0
"""The robot as numbers: a Pinocchio model, the order of its joints, and the map from q to them.

A vector of the suite has one entry per *independent* joint. Pinocchio's configuration may be
longer: a continuous joint is stored as cosine and sine, and a mimic joint is a joint of its own
there. Followers are covered by one affine map, ``q_full = E q + e``, which is exact because mimic
rules are linear; hence ``M = Eᵀ M_full E`` and ``τ = Eᵀ τ_full`` (principle of virtual work;
Featherstone, Rigid Body Dynamics Algorithms, 2008, section 3.2).
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from arm_dynamics.exceptions import ModelError
from arm_dynamics.model.drive import command_limits, command_units, drives_of, torque_limits
from arm_dynamics.model.friction_settings import Settings, resolve
from arm_dynamics.scene.schema import Joint, Scene, inertia_matrix
from arm_dynamics.scene.urdf import Mimic, Urdf, read_urdf

Array = NDArray[np.float64]


class ArmModel:
    """Inertias, joints, limits and friction coefficients of one scene; nothing in it changes.

    Attributes:
        scene: The scene it was made from.
        pin: Pinocchio's model: joints locked, payloads welded on, gravity and armature set.
        bare: The same without the payloads.
        joint_names: Independent joints, in the order of every vector.
        joint_types: ``revolute``, ``continuous`` or ``prismatic`` for each.
        has_followers: Whether a mimic joint follows another one.
        followers: Matrix E of shape (pin.nv, n).
        offsets: Vector e of shape (pin.nv,).
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
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.constraint_rows: dict[int, tuple[int, ...]] = {}
        urdf = read_urdf(scene.robot.urdf)
        whole = _parse(scene.robot.urdf)
        rules = _resolved(urdf)
        self.pin = _locked(whole, scene, rules)
        self.pin.gravity.linear = np.array(scene.gravity)
        self.bare = self.pin.copy()
        _weld(self.pin, scene)
        self._index = _velocity_index(self.pin)
        moving = [name for name in self._index if name not in rules]
        if not moving:
            raise ModelError(
                "robot: no joint is left to move; lock fewer joints or check the description"
            )
        self.joint_names: tuple[str, ...] = tuple(moving)
        self.joint_types = tuple(urdf.joints[name] for name in moving)
        self.followers, self.offsets = _follower_map(self._index, self.joint_names, rules)
        self.has_followers = len(self._index) != len(moving)
        settings = [scene.joint(name) for name in self._index]
        self.drives = tuple(drives_of(scene, moving, rules))
        self._set_drives(settings, _velocity_index(whole), whole)
        self._set_limits(settings, _velocity_index(whole), whole)
        self.q0 = _frozen([scene.initial.position.get(name, 0.0) for name in moving])
        self.v0 = _frozen([scene.initial.velocity.get(name, 0.0) for name in moving])
        self._continuous = _continuous(self.pin)
        if scene.bilateral:
            self._close()

    @property
    def n(self) -> int:
        """Degrees of freedom."""
        return len(self.joint_names)

    @property
    def has_dry_friction(self) -> bool:
        """Whether a joint can stick."""
        return self.friction.has_dry

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Frames that a payload, wrench or task may refer to."""
        return tuple(frame.name for frame in self.pin.frames)

    @property
    def total_mass(self) -> float:
        """Mass of everything that moves, in [kg]."""
        return float(sum(inertia.mass for inertia in list(self.pin.inertias)[1:]))

    def configuration(self, q: Array) -> Array:
        """Pinocchio's configuration for joint positions.

        Args:
            q: Joint positions in [rad] or [m], shape (n,) or (k, n).

        Returns:
            Configuration of shape (pin.nq,) or (k, pin.nq).
        """
        full = q @ self.followers.T + self.offsets if self.has_followers else q
        if not self._continuous:
            return full
        out = np.empty((*q.shape[:-1], self.pin.nq))
        for v_index, q_index, wraps in self._continuous:
            if wraps:
                out[..., q_index] = np.cos(full[..., v_index])
                out[..., q_index + 1] = np.sin(full[..., v_index])
            else:
                out[..., q_index] = full[..., v_index]
        return out

    def spread(self, v: Array) -> Array:
        """Velocities or accelerations of all of Pinocchio's joints, shape (…, pin.nv)."""
        return v @ self.followers.T if self.has_followers else v

    def gather(self, tau: Array) -> Array:
        """Torques on the independent joints from torques on all, shape (…, n)."""
        return tau @ self.followers if self.has_followers else tau

    def gather_matrix(self, matrix: Array) -> Array:
        """``Eᵀ X E`` of shape (…, n, n)."""
        return self.followers.T @ matrix @ self.followers if self.has_followers else matrix

    def _close(self) -> None:
        """Let the robot start where its constraints hold, and find out which of them matter."""
        from arm_dynamics.model.loop_closure import Closure  # which needs a model itself

        closure = Closure(self)
        self.q0, self.v0 = map(_frozen, closure.closed(self.q0, self.v0))
        self.constraint_rows = closure.independent_rows()

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
        self.armature = _frozen(armature @ E**2)
        said = [
            Settings(name, s.friction, whole.damping[i], whole.upperDryFrictionLimit[i], *drive)
            for name, s, i, *drive in zip(
                self._index, settings, urdf, more, efficiency, strict=True
            )
        ]
        self.friction = resolve(said, self.joint_names, E)
        self.viscous = _frozen(self.friction.viscous)
        self.coulomb = _frozen(self.friction.coulomb)
        self.static = _frozen(self.friction.static)

    def _set_limits(self, settings: list[Joint], index: dict[str, int], whole: pin.Model) -> None:
        lower, upper = _position_limits(whole)
        chosen = dict(zip(self._index, settings, strict=True))
        mine = [(chosen[name].limits, index[name], name) for name in self.joint_names]
        efforts = [_or(x.effort, _bound(whole.upperEffortLimit[i])) for x, i, _ in mine]
        self.effort_limit = _frozen(torque_limits(self.drives, efforts))
        self.command_unit = command_units(self.drives, self.joint_types)
        self.command_limit = _frozen(command_limits(self.drives, self.effort_limit))
        self.velocity_limit = _frozen(
            [_or(x.velocity, _bound(whole.upperVelocityLimit[i])) for x, i, _ in mine]
        )
        self.position_lower = _frozen([_or(x.lower, lower[name]) for x, _, name in mine])
        self.position_upper = _frozen([_or(x.upper, upper[name]) for x, _, name in mine])


def _parse(text: str) -> pin.Model:
    try:
        return pin.buildModelFromXML(text)
    except (ValueError, RuntimeError) as error:
        raise ModelError(f"robot description: Pinocchio cannot build it: {error}") from None


def _resolved(urdf: Urdf) -> dict[str, Mimic]:
    """Mimic rules with chains followed to the joint that really is free."""
    resolved: dict[str, Mimic] = {}
    for name, rule in urdf.mimics.items():
        seen = {name}
        while rule.leader in urdf.mimics:
            if rule.leader in seen:
                raise ModelError(
                    f"joint '{name}': its mimic rule leads back to itself by '{rule.leader}'"
                )
            seen.add(rule.leader)
            above = urdf.mimics[rule.leader]
            factor = rule.multiplier * above.multiplier
            rule = Mimic(above.leader, factor, rule.multiplier * above.offset + rule.offset)
        resolved[name] = rule
    return resolved


def _locked(whole: pin.Model, scene: Scene, rules: dict[str, Mimic]) -> pin.Model:
    given = scene.initial.position
    held = {name: given.get(name, 0.0) for name in scene.robot.lock if name not in rules}
    for name, rule in rules.items():
        if rule.leader in held:
            held[name] = rule.multiplier * held[rule.leader] + rule.offset
    if not held:
        return whole.copy()
    reference = pin.neutral(whole)
    for name, position in held.items():
        joint = whole.joints[whole.getJointId(name)]
        wraps = joint.nq == 2
        reference[joint.idx_q] = np.cos(position) if wraps else position
        if wraps:
            reference[joint.idx_q + 1] = np.sin(position)
    return pin.buildReducedModel(whole, [whole.getJointId(name) for name in held], reference)


def _weld(model: pin.Model, scene: Scene) -> None:
    for payload in scene.payloads:
        frame = model.frames[model.getFrameId(payload.frame)]
        body = pin.Inertia(payload.mass, np.array(payload.com), np.zeros((3, 3)))
        body.inertia = inertia_matrix(payload.inertia)  # the scene has checked it, to rounding
        model.appendBodyToJoint(frame.parentJoint, body, frame.placement)


def _velocity_index(model: pin.Model) -> dict[str, int]:
    """Index of every moving joint in Pinocchio's velocity vector, in model order."""
    return {name: model.joints[i].idx_v for i, name in enumerate(model.names) if i > 0}


def _follower_map(
    index: dict[str, int], free: tuple[str, ...], rules: dict[str, Mimic]
) -> tuple[Array, Array]:
    E, e = np.zeros((len(index), len(free))), np.zeros(len(index))
    for name, row in index.items():
        rule = rules.get(name, Mimic(name, 1.0, 0.0))
        E[row, free.index(rule.leader)] = rule.multiplier
        e[row] = rule.offset
    return _frozen(E), _frozen(e)


def _continuous(model: pin.Model) -> list[tuple[int, int, bool]]:
    """Velocity index, configuration index and whether it wraps, for each joint.

    A joint that wraps is stored as cosine and sine; the list is empty if none does.
    """
    joints = [(joint.idx_v, joint.idx_q, joint.nq == 2) for joint in list(model.joints)[1:]]
    return joints if any(wraps for *_, wraps in joints) else []


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


def _frozen(values: object) -> Array:
    array = np.array(values, dtype=float)
    array.setflags(write=False)
    return array
