# SPDX-License-Identifier: Apache-2.0
"""Entities of the simulation by name: the robot, and its links as ``robot/link``."""

from dataclasses import dataclass
from typing import Any

import pinocchio as pin

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import plain
from arm_sim.ros.standard.patterns import Pattern
from arm_sim.ros.standard.results import NOT_FOUND, UNSUPPORTED, Refusal
from arm_sim.simulation.simulator import Simulator

OBJECT, ROBOT = 0, 1  # EntityCategory.msg
_ANY, _ALL = 0, 1  # TagsFilter.msg
_EMPTY = 0  # Bounds.msg


@dataclass(frozen=True)
class Entity:
    """The robot, or one of its links."""

    name: str
    category: int  # as in ``EntityCategory``
    description: str
    tags: tuple[str, ...]  # ``arm``, or ``link`` and whether it moves
    frame: int  # in the simulated model


class Entities:
    """Entities of a simulation."""

    def __init__(self, simulator: Simulator) -> None:
        self._model = model = simulator.model
        self._data = pin.Data(model.pin)
        frames = model.pin.frames
        bodies = [i for i, frame in enumerate(frames) if frame.type == pin.FrameType.BODY]
        robot, joints = model.whole.name or "robot", ", ".join(model.joint_names)
        about = f"an arm of {model.n} joints: {joints}"
        self._all = {robot: Entity(robot, ROBOT, about, ("arm",), bodies[0])}
        for i in bodies:
            joint = frames[i].parentJoint
            moves = f"moved by {model.pin.names[joint]}" if joint else "fixed to the world"
            tags = ("link", "moving" if joint else "fixed")
            link = f"{robot}/{frames[i].name}"
            self._all[link] = Entity(link, OBJECT, f"a link, {moves}", tags, i)

    def named(self, name: str) -> Entity:
        """The entity of a name.

        Raises:
            Refusal: If there is none.
        """
        if name not in self._all:
            robot = next(iter(self._all))
            allowed = f"allowed: '{robot}' and its links, as '{robot}/link'"
            raise Refusal(NOT_FOUND, f"no entity '{plain(name, 80)}'; {allowed}")
        return self._all[name]

    def matching(self, filters: Any) -> list[Entity]:
        """The entities that match ``EntityFilters``.

        Raises:
            Refusal: If bounds are requested.
            InvalidInput: If a filter is invalid.
        """
        bounds = filters.bounds
        if bounds.type != _EMPTY or bounds.points:
            requested = f"bounds of type {bounds.type} with {len(bounds.points)} points"
            allowed = f"allowed: empty bounds (type {_EMPTY}, without points)"
            raise Refusal(UNSUPPORTED, f"{requested}: bounds are not supported; {allowed}")
        mode, tags = filters.tags.filter_mode, set(filters.tags.tags)
        if mode not in (_ANY, _ALL):
            raise InvalidInput(f"filter_mode is {mode}; allowed: 0 (any) or 1 (all)")
        kinds = {category.category for category in filters.categories}
        pattern = Pattern(filters.filter) if filters.filter else None

        def fits(entity: Entity) -> bool:
            tagged = tags <= set(entity.tags) if mode == _ALL else tags & set(entity.tags)
            return bool(
                (not kinds or entity.category in kinds)
                and (not tags or tagged)
                and (pattern is None or pattern.finds(entity.name))
            )

        return [entity for entity in self._all.values() if fits(entity)]

    def update_kinematics(self, q: Array, v: Array) -> None:
        """Set joint positions and velocities, each of shape (n,), for ``pose`` and ``twist``."""
        model = self._model
        pin.forwardKinematics(model.pin, self._data, model.configuration(q), model.spread(v))
        pin.updateFramePlacements(model.pin, self._data)

    def pose(self, entity: Entity) -> list[float]:
        """Pose in the world after ``update_kinematics``: x y z [m] and quaternion x y z w."""
        return pin.SE3ToXYZQUAT(self._data.oMf[entity.frame]).tolist()

    def twist(self, entity: Entity) -> list[float]:
        """Velocity of the origin [m/s] and angular velocity [rad/s] in the axes of the world."""
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        velocity = pin.getFrameVelocity(self._model.pin, self._data, entity.frame, axes)
        return velocity.vector.tolist()
