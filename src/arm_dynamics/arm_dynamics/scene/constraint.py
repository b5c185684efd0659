# SPDX-License-Identifier: Apache-2.0
"""Constraints of a scene: closed chains, an arm that touches the world, coupled joints.

A frame is a link or joint of the URDF, or ``world``. Components are given in the axes of the
*second* frame.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Annotated, ClassVar, Literal, NamedTuple, get_args

import numpy as np
from pydantic import AfterValidator, Field, StrictBool, model_validator

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import SceneError, choices, known_names
from arm_dynamics.scene.types import Direction, Finite, NonNegative, Part, Positive, Vector3
from arm_dynamics.scene.urdf.description import Urdf

WORLD = "world"


def _check_difference(value: tuple[str, str]) -> tuple[str, str]:
    if value[0] == value[1]:
        raise ValueError("two different names are expected")
    return value


Pair = Annotated[tuple[str, str], AfterValidator(_check_difference)]
ORIGIN = (0.0, 0.0, 0.0)
UPWARD = (0.0, 0.0, 1.0)
Fraction = Annotated[Finite, Field(ge=0.0, le=1.0)]


class WorldContact(NamedTuple):
    """A point at which an arm touches the world.

    Attributes:
        frame: Link or joint frame of the URDF.
        point: In that frame, in [m].
        offset: Vector from there to the contact point, in the world's axes, in [m].
    """

    frame: str
    point: Vector3
    offset: Vector3 = ORIGIN


class _Constraint(Part):
    """Keys common to all constraints.

    Attributes:
        name: Name in messages and in ``Simulator.set_constraint``; by default type and place, as
            ``point_0``.
        switchable: Whether ``Simulator.set_constraint`` may switch it while the simulator runs.
        active: Whether it is active at the start; only a switchable one may be inactive.
    """

    name: str | None = Field(default=None, min_length=1)
    switchable: StrictBool = False
    active: StrictBool = True

    @model_validator(mode="after")
    def _check_switch(self) -> _Constraint:
        if not self.active and not self.switchable:
            raise ValueError("active: false is for a constraint with switchable: true")
        return self


class _BetweenFrames(_Constraint):
    """A constraint between two frames.

    Attributes:
        frames: The first and the second frame: links or joints of the URDF, or ``world``.
        points: A point of each frame, in its own axes, in [m].
    """

    frames: Pair
    points: tuple[Vector3, Vector3] = (ORIGIN, ORIGIN)

    @property
    def at_world(self) -> WorldContact | None:
        """Its point that is connected to the world; None if neither frame is the world."""
        if WORLD not in self.frames:
            return None
        own = self.frames.index(WORLD) ^ 1
        return WorldContact(self.frames[own], self.points[own])

    def check_names(self, place: int, urdf: Urdf, locked: set[str]) -> None:
        """Refuse frames that the robot does not have; arguments as of ``check_constraints``."""
        check_frames(f"constraints.{place}.frames", self.frames, urdf)


class PointConstraint(_BetweenFrames):
    """The two points coincide: a ball joint, or in the plane a hinge."""

    type: Literal["point"]


class FrameConstraint(_BetweenFrames):
    """The frames are welded together.

    Attributes:
        rpy: Roll, pitch and yaw of the first frame in the second in [rad].
    """

    type: Literal["frame"]
    rpy: Vector3 = ORIGIN


class LineConstraint(_BetweenFrames):
    """The first point stays on a line through the second one.

    Attributes:
        direction: Direction of the line in the second frame; any length but zero.
    """

    type: Literal["line"]
    direction: Direction


class PlaneConstraint(_BetweenFrames):
    """The first point stays on a plane through the second one.

    Attributes:
        normal: Normal of the plane in the second frame; any length but zero.
        height: Height of the first point above the plane in [m].
    """

    type: Literal["plane"]
    normal: Direction = UPWARD
    height: Finite = 0.0


class DistanceConstraint(_BetweenFrames):
    """The points keep their distance, as if a massless rod held them.

    Attributes:
        distance: Distance of the points in [m].
    """

    type: Literal["distance"]
    distance: Positive


class RollingConstraint(_BetweenFrames):
    """The first frame is the centre of a wheel or a ball that rolls on a plane without slipping.

    The material contact point does not move along the plane. The height of the centre is not
    constrained; a ``plane`` constraint does that.

    Attributes:
        radius: Radius in [m].
        normal: Normal of the plane in the second frame, towards the wheel.
        axle: Axis of the wheel in the first frame; without one it is a ball.
    """

    type: Literal["rolling"]
    radius: Positive
    normal: Direction = UPWARD
    axle: Direction | None = None


class CouplingConstraint(_Constraint):
    """Two joints move together: position of the first = ratio * that of the second + offset.

    Attributes:
        joints: The first and the second joint.
        ratio: Position of the first over that of the second; negative where they turn in opposite
            directions.
        offset: Offset of the first in [rad] or [m].
    """

    type: Literal["coupling"]
    joints: Pair
    ratio: Finite
    offset: Finite = 0.0

    at_world: ClassVar[None] = None

    def check_names(self, place: int, urdf: Urdf, locked: set[str]) -> None:
        """Refuse joints that are not free; arguments as of ``check_constraints``."""
        key, free = f"constraints.{place}.joints", urdf.free(locked)
        check_joints(key, self.joints, free, urdf, locked)


class Plane(Part):
    """A plane of the world or of a link; what touches it is on the side of its normal.

    Attributes:
        frame: ``world``, or the link or joint frame of the URDF that carries it.
        point: Any point of it, in that frame, in [m].
        normal: Its normal in that frame, towards the side of contact; any length but zero.
    """

    frame: str = WORLD
    point: Vector3 = ORIGIN
    normal: Direction = UPWARD


class Contact(Part):
    """A point or ball of the arm that a plane stops, with Coulomb friction and restitution.

    Attributes:
        frame: Link or joint of the URDF that carries the point or ball.
        point: The point, or the centre of the ball, in that frame in [m].
        radius: Radius of the ball in [m]; 0 for a point.
        plane: The plane that it may touch.
        friction: Coefficient µ of sliding friction.
        static_friction: Coefficient of static friction, at least µ; by default µ.
        restitution: Newton's coefficient of restitution: speed of rebound over speed of approach.
        name: Name in messages; by default type and place, as ``contact_0``.
    """

    switchable: ClassVar[bool] = False
    active: ClassVar[bool] = True

    type: Literal["contact"]
    frame: str
    point: Vector3 = ORIGIN
    radius: NonNegative = 0.0
    plane: Plane = Plane()
    friction: NonNegative = 0.0
    static_friction: NonNegative | None = None
    restitution: Fraction = 0.0
    name: str | None = Field(default=None, min_length=1)

    @model_validator(mode="after")
    def _check_static(self) -> Contact:
        if self.sticking < self.friction:
            raise ValueError(
                f"static_friction = {self.sticking:g} is less than friction = {self.friction:g}; "
                "at least as much is expected"
            )
        return self

    @property
    def sticking(self) -> float:
        """The coefficient of static friction."""
        return self.friction if self.static_friction is None else self.static_friction

    @property
    def at_world(self) -> WorldContact | None:
        """Its point that may touch the world; None if its plane is on a link."""
        if self.plane.frame != WORLD:
            return None
        x, y, z = (-self.radius * n for n in self.plane.normal)
        return WorldContact(self.frame, self.point, (x, y, z))

    def check_names(self, place: int, urdf: Urdf, locked: set[str]) -> None:
        """Refuse frames that the robot does not have; arguments as of ``check_constraints``."""
        check_frame(f"constraints.{place}.frame", self.frame, urdf)
        check_frame(f"constraints.{place}.plane.frame", self.plane.frame, urdf, WORLD)


FrameBased = (
    PointConstraint
    | FrameConstraint
    | LineConstraint
    | PlaneConstraint
    | DistanceConstraint
    | RollingConstraint
)
# A constraint that holds in both directions
Bilateral = FrameBased | CouplingConstraint
Constraint = Annotated[Bilateral | Contact, Field(discriminator="type")]
"""A constraint of any type; the key ``type`` says which."""
# The types of constraints by the value of the key ``type``
SCHEMAS: dict[str, type[Part]] = {
    get_args(kind.model_fields["type"].annotation)[0]: kind
    for kind in get_args(Bilateral | Contact)
}


def switchable(constraints: tuple[Constraint, ...]) -> list[int]:
    """Indices of the constraints that can be switched on and off."""
    return [i for i, constraint in enumerate(constraints) if constraint.switchable]


def switches(constraints: tuple[Constraint, ...]) -> Array:
    """1 or 0 for each switchable constraint: whether it is active at the start."""
    return np.array([float(constraints[i].active) for i in switchable(constraints)])


def label(constraint: Constraint, place: int) -> str:
    """Name of a constraint; without one, its type and index in the scene's list."""
    return constraint.name or f"{constraint.type}_{place}"


def check_constraints(constraints: tuple[Constraint, ...], urdf: Urdf, locked: set[str]) -> None:
    """Check that frames and joints of constraints exist and can move as needed."""
    labels = [label(constraint, i) for i, constraint in enumerate(constraints)]
    for i, constraint in enumerate(constraints):
        check_unique("constraints", labels, i)
        constraint.check_names(i, urdf, locked)


def check_unique(kind: str, names: Sequence[str], place: int) -> None:
    """Refuse a repeated name; ``kind`` describes the named items, for the message."""
    if names[place] in names[:place]:
        raise SceneError(f"scene: two {kind} are called '{names[place]}'; names must differ")


def check_frame(key: str, frame: str, urdf: Urdf, *further: str) -> None:
    """Refuse a frame, the value of a key, that is neither the robot's nor among ``further``."""
    if frame not in further and not urdf.has_frame(frame):
        allowed = choices(frame, [*further, *urdf.frames])
        raise SceneError(f"scene: '{key}' = '{frame}' does not exist; allowed: {allowed}")


def check_frames(key: str, frames: Iterable[str], urdf: Urdf) -> None:
    """Refuse frames that are neither the robot's nor the world; ``key`` names them."""
    for i, frame in enumerate(frames):
        check_frame(f"{key}.{i}", frame, urdf, WORLD)


def check_joints(
    key: str, joints: Sequence[str], allowed: list[str], urdf: Urdf, locked: Collection[str] = ()
) -> None:
    """Refuse joints that are not allowed, or named twice; ``key`` names them."""
    for i, name in enumerate(joints):
        if name in joints[:i]:
            raise SceneError(f"scene: '{key}' names joint '{name}' twice; once is expected")
        if name in allowed:
            continue
        state, listed = "is fixed", known_names(allowed)
        if name in locked:
            state = "is locked"
        elif name in urdf.mimics:
            state = f"follows '{urdf.mimics[name].leader}'"
        elif name not in urdf.joints:
            state, listed = "does not exist", choices(name, allowed)
        raise SceneError(f"scene: '{key}' names joint '{name}', which {state}; allowed: {listed}")
