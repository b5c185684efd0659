# SPDX-License-Identifier: Apache-2.0
"""The numerical robot: a Pinocchio model, its joint order, and the map from q to its coordinates.

A vector of the suite has one entry per *independent* joint. Pinocchio's configuration may be
longer: a continuous joint is stored as cosine and sine, and a mimic joint is a joint of its own
there. Followers are covered by one affine map, ``q_full = E q + e``, which is exact because mimic
rules are linear; hence ``M = Eᵀ M_full E`` and ``τ = Eᵀ τ_full`` (principle of virtual work;
Featherstone, Rigid Body Dynamics Algorithms, 2008, section 3.2).
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Self

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.attributes import sealed, with_values
from arm_dynamics.exceptions import ModelError, SceneError, counted, known_names
from arm_dynamics.scene.constraint import WORLD
from arm_dynamics.scene.inertia import inertia_matrix
from arm_dynamics.scene.schema import Payload, Scene
from arm_dynamics.scene.urdf.description import JOINT, LINK, Mimic, Urdf, read_urdf
from arm_dynamics.scene.urdf.joint_names import JointNames

_SUFFIX = "\0"  # which no name in XML contains


@sealed
class Robot:
    """Links and joints of one scene: the rigid bodies, without drives.

    Attributes:
        scene: The scene that describes it.
        pin: Pinocchio's model with joints locked, payloads attached and gravity set.
        bare: Pinocchio's model as ``pin``, without the payloads.
        whole: Pinocchio's model of the unmodified description: no joint locked, no payload.
        joint_names: Independent joints, in the order of every vector; a tuple that knows others.
        joint_types: ``revolute``, ``continuous`` or ``prismatic`` for each.
        has_followers: Whether there are mimic joints.
        followers: Matrix E of shape (pin.nv, n).
        offsets: Vector e of shape (pin.nv,).
        locked: Positions of the joints that the scene locks, in [rad] or [m], by name.
        doubtful: Links whose inertia is not physically consistent, and why.

    Raises:
        ModelError: If Pinocchio cannot build the robot or no movable joint is left.
        SceneError: If no joint moves a payload.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        urdf = read_urdf(scene.description, scene.robot.lock)
        self.doubtful, self._limited = urdf.doubtful, urdf.limited
        try:
            self.whole = pin.buildModelFromXML(urdf.text)
        except (ValueError, RuntimeError) as error:
            raise ModelError(f"robot description: Pinocchio cannot build it: {error}") from None
        self._rules = _resolved_rules(urdf)
        self.locked = _locked_positions(scene, urdf, self._rules)
        self.pin = _reduced(self.whole, self.locked)
        self.pin.gravity.linear = np.array(scene.gravity)
        self.bare = self.pin.copy()
        self._frames = _frames(self.pin)
        for name in scene.links:
            if self.frame(f"{LINK}{name}").parentJoint == 0:
                raise SceneError(
                    f"scene: 'links.{name}': no joint moves that link, so its mass is without "
                    "effect"
                )
        self._weld()
        self._index = velocity_index(self.pin)
        moving = [name for name in self._index if name not in self._rules]
        if not moving:
            raise ModelError(
                "robot: no joint is left to move; lock fewer joints or check the description"
            )
        self.joint_names = JointNames(moving, self._rules, self.locked)
        self.joint_types = tuple(urdf.joints[name] for name in moving)
        self.followers, self.offsets = _follower_map(self._index, self.joint_names, self._rules)
        self.has_followers = len(self._index) != len(moving)
        self._continuous = _continuous(self.pin)

    def under(self, gravity: Array, payloads: Sequence[Payload]) -> Self:
        """Copy of the robot with other gravity, in [m/s²], shape (3,), and other payloads.

        Raises:
            SceneError: If no joint moves a payload.
        """
        changes = {"gravity": tuple(gravity.tolist()), "payloads": tuple(payloads)}
        bare = self.bare.copy()
        bare.gravity.linear = gravity
        scene = self.scene.model_copy(update=changes)
        other = with_values(self, scene=scene, bare=bare, pin=bare.copy())
        other.pin.armature = self.pin.armature
        other._weld()
        return other

    def __repr__(self) -> str:
        """Joints of the robot."""
        joints = f"{counted(self.n, 'joint')}: {known_names(self.joint_names, 8)}"
        locked = f"; locked: {known_names(self.locked, 8)}" if self.locked else ""
        return f"<{type(self).__name__} of {self.pin.name}, {joints}{locked}>"

    @property
    def n(self) -> int:
        """Degrees of freedom."""
        return len(self.joint_names)

    @property
    def turning(self) -> NDArray[np.bool_]:
        """Which joints turn, the others slide, booleans of shape (n,)."""
        return np.array([kind != "prismatic" for kind in self.joint_types])

    def units(self, turning: str, sliding: str) -> tuple[str, ...]:
        """The unit of each joint: ``turning`` or ``sliding``."""
        return tuple(turning if turns else sliding for turns in self.turning)

    def described_range(self, name: str) -> tuple[float, float]:
        """Position limits of any joint in the URDF; infinite where its <limit> gives none."""
        return self._limited.get(name, (-np.inf, np.inf))

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Frames that a payload, wrench or task may refer to, ``world`` first."""
        return tuple(dict.fromkeys(["world", *(frame.name for frame in self.pin.frames[1:])]))

    def has_frame(self, name: object) -> bool:
        """Whether ``frame_index`` knows a name."""
        return isinstance(name, str) and name in self._frames

    def frame_index(self, name: str) -> int:
        """Pinocchio's index of ``world``, a link or a joint; the link where both have the name.

        ``link:NAME`` and ``joint:NAME`` say which is meant.
        """
        return self._frames[name]

    def frame(self, name: str) -> pin.Frame:
        """Pinocchio's frame; see ``frame_index``."""
        return self.pin.frames[self.frame_index(name)]

    @property
    def total_mass(self) -> float:
        """Mass of everything that moves, in [kg]."""
        return float(sum(inertia.mass for inertia in list(self.pin.inertias)[1:]))

    @cached_property
    def reach(self) -> float:
        """Size in [m]: the largest distance of a joint, frame or centre of mass along the chain.

        1 if all are zero.
        """
        model = self.bare
        span = np.zeros(model.njoints)
        for i in range(1, model.njoints):
            span[i] = span[model.parents[i]] + np.linalg.norm(model.jointPlacements[i].translation)
        ends = [
            span[frame.parentJoint] + np.linalg.norm(frame.placement.translation)
            for frame in model.frames
        ]
        bodies = [span[i] + np.linalg.norm(model.inertias[i].lever) for i in range(1, len(span))]
        return float(max([*ends, *bodies])) or 1.0

    @property
    def massless(self) -> bool:
        """Whether nothing that moves has mass or inertia, drives included."""
        bodies = list(self.pin.inertias)[1:]
        return not self.pin.armature.any() and not any(
            body.mass or body.inertia.any() for body in bodies
        )

    @property
    def coordinates_are_joints(self) -> bool:
        """Whether Pinocchio's vectors are those of the suite."""
        return not (self.has_followers or self._continuous)

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
        for v_index, q_index, is_cyclic in self._continuous:
            if is_cyclic:
                out[..., q_index] = np.cos(full[..., v_index])
                out[..., q_index + 1] = np.sin(full[..., v_index])
            else:
                out[..., q_index] = full[..., v_index]
        return out

    def spread(self, v: Array) -> Array:
        """Velocities or accelerations of all joints of Pinocchio's model, shape (…, pin.nv)."""
        return v @ self.followers.T if self.has_followers else v

    def expanded(self, q: Array, *rates: Array) -> tuple[Array, ...]:
        """Pinocchio's configuration, and velocities or accelerations of all its joints."""
        return self.configuration(q), *map(self.spread, rates)

    def gather(self, tau: Array) -> Array:
        """Torques on the independent joints equivalent to torques on all, shape (…, n)."""
        return tau @ self.followers if self.has_followers else tau

    def gather_matrix(self, matrix: Array) -> Array:
        """``Eᵀ X E`` of shape (…, n, n)."""
        return self.followers.T @ matrix @ self.followers if self.has_followers else matrix

    def _weld(self) -> None:
        """Attach the scene's payloads."""
        for i, payload in enumerate(self.scene.payloads):
            frame = self.frame(payload.frame)
            if frame.parentJoint == 0:
                raise SceneError(
                    f"scene: 'payloads.{i}.frame' = '{payload.frame}': no joint moves that frame, "
                    "so the payload is without effect"
                )
            body = pin.Inertia(payload.mass, np.array(payload.com), np.zeros((3, 3)))
            body.inertia = inertia_matrix(payload.inertia)  # validated by the scene, to rounding
            self.pin.appendBodyToJoint(frame.parentJoint, body, frame.placement)


def _resolved_rules(urdf: Urdf) -> dict[str, Mimic]:
    """Mimic rules with chains resolved to the independent joint."""
    resolved: dict[str, Mimic] = {}
    for name, rule in urdf.mimics.items():
        visited = {name}
        while rule.leader in urdf.mimics:
            if rule.leader in visited:
                raise ModelError(
                    f"joint '{name}': its mimic rule leads back to itself by '{rule.leader}'"
                )
            visited.add(rule.leader)
            outer = urdf.mimics[rule.leader]
            factor = rule.multiplier * outer.multiplier
            rule = Mimic(outer.leader, factor, rule.multiplier * outer.offset + rule.offset)
        resolved[name] = rule
    return resolved


def _locked_positions(scene: Scene, urdf: Urdf, rules: dict[str, Mimic]) -> dict[str, float]:
    """Positions of locked joints, including mimic joints of locked ones.

    Floating and planar ones, which are fixed, have none.
    """
    initial, moving = scene.initial.position, set(urdf.moving) - rules.keys()
    locked = {name: initial.get(name, 0.0) for name in scene.robot.lock if name in moving}
    for name, rule in rules.items():
        if rule.leader in locked:
            locked[name] = rule.multiplier * locked[rule.leader] + rule.offset
    return locked


def _reduced(whole: pin.Model, locked: dict[str, float]) -> pin.Model:
    model = whole.copy()
    if not locked:
        return model
    # Pinocchio looks the locked joints up among all frames, where a link may have their name.
    for frame in _bodies(model):
        frame.name += _SUFFIX
    reference = configuration_of(whole, locked)
    reduced = pin.buildReducedModel(model, [whole.getJointId(name) for name in locked], reference)
    for frame in _bodies(reduced):
        frame.name = frame.name.removesuffix(_SUFFIX)
    return reduced


def _bodies(model: pin.Model) -> Iterator[pin.Frame]:
    return (frame for frame in model.frames if frame.type == pin.FrameType.BODY)


def configuration_of(model: pin.Model, positions: Mapping[str, float]) -> Array:
    """Pinocchio's neutral configuration with some joints, in [rad] or [m], replaced."""
    q = pin.neutral(model)
    for name, position in positions.items():
        joint = model.joints[model.getJointId(name)]
        is_cyclic = joint.nq == 2
        q[joint.idx_q] = np.cos(position) if is_cyclic else position
        if is_cyclic:
            q[joint.idx_q + 1] = np.sin(position)
    return np.asarray(q)


def _frames(model: pin.Model) -> dict[str, int]:
    """Indices of the frames by name, and by name with the kind in front."""
    kinds = {pin.FrameType.BODY: LINK}
    numbered = [(kinds.get(f.type, JOINT), f.name, i) for i, f in enumerate(model.frames)]
    joints = {name: i for kind, name, i in numbered if kind == JOINT}
    links = {name: i for kind, name, i in numbered if kind == LINK}
    qualified = {f"{kind}{name}": i for kind, name, i in numbered}
    return {**qualified, **joints, **links, WORLD: 0}


def velocity_index(model: pin.Model) -> dict[str, int]:
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
    return read_only(E), read_only(e)


def _continuous(model: pin.Model) -> list[tuple[int, int, bool]]:
    """Velocity index, configuration index and whether it wraps, for each joint.

    A joint that wraps is stored as cosine and sine; the list is empty if none does.
    """
    joints = [(joint.idx_v, joint.idx_q, joint.nq == 2) for joint in list(model.joints)[1:]]
    return joints if any(is_cyclic for *_, is_cyclic in joints) else []
