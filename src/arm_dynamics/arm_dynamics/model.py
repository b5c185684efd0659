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

from arm_dynamics.exceptions import ModelError, SceneError
from arm_dynamics.scene import Joint, Scene, inertia_matrix
from arm_dynamics.urdf import Mimic, Urdf, read_urdf

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
        viscous: Viscous friction in [N m s/rad] or [N s/m], shape (n,).
        coulomb: Dry friction in sliding in [N m] or [N], shape (n,).
        static: Dry friction at rest in [N m] or [N], at least ``coulomb``, shape (n,).
        stribeck_excess: Dry friction at creeping speed beyond ``coulomb`` in [N m] or [N]; zero
            where it falls from ``static`` at once.
        stribeck_velocity: Speed of that fall in [rad/s] or [m/s]; 1 where there is none.
        armature: Drive inertia in [kg m²] or [kg], shape (n,).
        effort_limit: Torque limits in [N m] or [N], inf where there is none, shape (n,).
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
    def sliding(self) -> tuple[Array, Array, Array]:
        """Arguments of ``laws.friction.dry`` after the direction."""
        return self.coulomb, self.stribeck_excess, self.stribeck_velocity

    @property
    def has_dry_friction(self) -> bool:
        """Whether a joint can stick."""
        return bool(self.static.any())

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
        from arm_dynamics.closure import Closure  # which needs a model itself

        closure = Closure(self)
        self.q0, self.v0 = map(_frozen, closure.closed(self.q0, self.v0))
        self.constraint_rows = closure.independent_rows()

    def _set_drives(self, settings: list[Joint], index: dict[str, int], whole: pin.Model) -> None:
        """Friction and armature from the scene, else from the URDF.

        Those of a follower act through its leader.
        """
        E = self.followers
        urdf = [index[name] for name in self._index]
        damping = [whole.damping[i] for i in urdf]
        dry = [whole.upperDryFrictionLimit[i] for i in urdf]
        viscous = [_or(s.friction.viscous, d) for s, d in zip(settings, damping, strict=True)]
        coulomb = [_or(s.friction.coulomb, d) for s, d in zip(settings, dry, strict=True)]
        armature = np.array([s.armature or 0.0 for s in settings])
        self.pin.armature = armature
        self.viscous = _frozen(np.array(viscous) @ E**2)
        self.coulomb = _frozen(np.array(coulomb) @ abs(E))
        self._set_break_away(settings, coulomb)
        self.armature = _frozen(armature @ E**2)

    def _set_break_away(self, settings: list[Joint], coulomb: list[float]) -> None:
        static, speed = [], []
        for name, s, level in zip(self._index, settings, coulomb, strict=True):
            own = s.friction
            if own.static is not None and own.static < level:
                raise SceneError(
                    f"scene: 'joints.{name}.friction.static' = {own.static}: "
                    f"at least coulomb, {level}, is wanted"
                )
            if name not in self.joint_names and own.static is not None:
                raise SceneError(
                    f"scene: 'joints.{name}.friction.static': a mimic joint has none of its own"
                )
            static.append(_or(own.static, level))
            speed.append(own.stribeck_velocity or 0.0)
        free = [list(self._index).index(name) for name in self.joint_names]
        self.static = _frozen(np.array(static) @ abs(self.followers))
        falls = np.array(speed)[free]
        self.stribeck_excess = _frozen(np.where(falls > 0.0, self.static - self.coulomb, 0.0))
        self.stribeck_velocity = _frozen(np.where(falls > 0.0, falls, 1.0))

    def _set_limits(self, settings: list[Joint], index: dict[str, int], whole: pin.Model) -> None:
        lower, upper = _position_limits(whole)
        chosen = dict(zip(self._index, settings, strict=True))
        mine = [(chosen[name].limits, index[name], name) for name in self.joint_names]
        self.effort_limit = _frozen(
            [_or(x.effort, _bound(whole.upperEffortLimit[i])) for x, i, _ in mine]
        )
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
        body = pin.Inertia(payload.mass, np.array(payload.com), inertia_matrix(payload.inertia))
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
