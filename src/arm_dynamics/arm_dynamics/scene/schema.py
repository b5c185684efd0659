# SPDX-License-Identifier: Apache-2.0
"""The scene: one validated description of the physics, shared by every node.

The schema below is the scene file (see ``docs/reference/scene.md``). Physics
that is absent from it is not computed.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import (
    BeforeValidator,
    Field,
    StrictBool,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from arm_dynamics.exceptions import SceneError
from arm_dynamics.scene.complaints import Schema, complaints
from arm_dynamics.scene.constraint import SCHEMAS, Bilateral, Constraint, Contact, Fraction, label
from arm_dynamics.scene.drive import Actuator, Servo, Transmission
from arm_dynamics.scene.friction import IN_TABLE, KINDS, Friction
from arm_dynamics.scene.imperfections import Commands, Sensors
from arm_dynamics.scene.inertia import Body, LinkBody
from arm_dynamics.scene.spring import JointSpring, PointSpring
from arm_dynamics.scene.types import Finite, Limit, NonNegative, Part, Positive, Vector3
from arm_dynamics.scene.urdf.inertial import with_bodies


def _argument(value: object) -> object:
    """The text of an argument of xacro."""
    if isinstance(value, bool):
        return str(value).lower()
    if not isinstance(value, str | int | float):
        raise ValueError("text, a number, or true or false is expected")
    return str(value)


class RobotChoice(Part):
    """The robot, and the joints of it that do not move.

    Attributes:
        urdf: Path (relative to the scene file), ``package://`` or ``file://`` URI, or the URDF
            text itself. A file ending in ``.xacro`` is expanded, where xacro is installed.
            Required, unless ``xacro`` is given.
        xacro: The same for a file in xacro of any name, in place of ``urdf``.
        arguments: Arguments of xacro by name, for those that the file declares.
        lock: Joints that do not move; each stays at its initial position, or at zero. Floating
            and planar joints must be locked, and stay at their origin.
    """

    urdf: str = Field(min_length=1)
    xacro: str | None = None
    arguments: dict[str, Annotated[str, BeforeValidator(_argument)]] = {}
    lock: tuple[str, ...] = ()

    @model_validator(mode="before")
    @classmethod
    def _source(cls, value: object) -> object:
        if not isinstance(value, dict) or value.get("xacro") is None:
            return value
        if value.get("urdf") is not None:
            raise ValueError("'urdf' or 'xacro' is expected, not both")
        return {**value, "urdf": value["xacro"]}


class Stop(Part):
    """The stops at a joint's position limits: rigid or compliant.

    Attributes:
        restitution: Speed of rebound over speed of approach at a rigid stop, 0 to 1; 0 unless
            given.
        stiffness: Stiffness of a compliant stop in [N m/rad] or [N/m]; without it the stop is
            rigid.
        damping: Damping of a compliant stop in [N m s/rad] or [N s/m].
    """

    restitution: Fraction | None = None
    stiffness: Positive | None = None
    damping: NonNegative | None = None

    @model_validator(mode="after")
    def _check_kind(self) -> Stop:
        if self.stiffness is None and self.damping is not None:
            raise ValueError("damping belongs to a compliant stop, which also needs its stiffness")
        if self.stiffness is not None and self.restitution is not None:
            raise ValueError(
                "a stop is rigid, with restitution, or compliant, with stiffness and damping"
            )
        return self


class Limits(Part):
    """Limits of one joint that replace the URDF's ``<limit>``.

    Attributes:
        effort: Largest torque in [N m] or force in [N], or ``inf``; larger commands are clipped,
            with a warning. Default: the URDF's.
        velocity: Largest speed in [rad/s] or [m/s], or ``inf``: for planning, and for servos. The
            simulation itself does not enforce it. Default: the URDF's.
        lower: Lower position limit in [rad] or [m]: for planning, and where the stop is. Default:
            the URDF's.
        upper: Upper position limit in [rad] or [m], likewise.
        stop: The stops at both limits. ``true``, the default: rigid, without rebound. ``false``:
            none; the limits are for planning only.
    """

    effort: Limit | None = None
    velocity: Limit | None = None
    lower: Finite | None = None
    upper: Finite | None = None
    stop: StrictBool | Stop | None = None

    @model_validator(mode="after")
    def _check_order(self) -> Limits:
        if self.lower is not None and self.upper is not None and self.lower >= self.upper:
            raise ValueError(
                f"lower = {self.lower} is not below upper = {self.upper}; "
                "robot.lock holds a joint where it is"
            )
        return self


class Joint(Part):
    """Settings of one joint, or of all joints (``"*"``).

    Attributes:
        friction: Friction.
        armature: Inertia of the drive, reflected to the joint, in [kg m²] or [kg]; that of an
            actuator's rotor is added.
        actuator: Motor and gear; without one, the command is the torque at the joint.
        transmission: A flexible element between gear and link; needs an actuator with
            ``rotor_inertia``.
        spring: A spring and damper beside the joint, acting on the link.
        limits: Limits in place of those of the URDF.
        servo: Servo that tracks commanded positions and velocities.
    """

    friction: Friction = Friction()
    armature: NonNegative | None = None
    actuator: Actuator | None = None
    transmission: Transmission | None = None
    spring: JointSpring | None = None
    limits: Limits = Limits()
    servo: Servo = Servo()


class Payload(Body):
    """A rigid body welded to a frame.

    Attributes:
        frame: Link or joint of the URDF that carries the body; ``link:NAME`` or ``joint:NAME``
            where both have the name and the joint may be meant.
    """

    frame: str


class Initial(Part):
    """Initial state of the robot; joints that are not named start at zero, at rest.

    Where zero is beyond a joint's stops, it starts at the nearer one.

    Attributes:
        position: Joint positions by name in [rad] or [m], also of locked joints. With constraints
            they are a guess, from which loops are closed.
        velocity: Joint velocities by name in [rad/s] or [m/s].
        hold: Joints that keep their position and velocity exactly when loops are closed at the
            start; the others are adjusted.
    """

    position: dict[str, Finite] = {}
    velocity: dict[str, Finite] = {}
    hold: tuple[str, ...] = ()


class Sim(Part):
    """Integration of the scene; defaults that callers may override.

    Attributes:
        integrator: ``euler``, ``semi_implicit_euler``, ``midpoint``, ``heun``, ``rk4``,
            ``nystrom4``, ``dopri5``, ``dop853``, ``implicit``, or ``auto``, the default.
        dt: Length of a tick in [s], 1e-9 to 10; a command is held for a tick.
        tolerance: Scaled error |e| / (1 + |x|) allowed in each sub-step, 1e-14 to 0.1. Turns on
            error control inside each tick; needs ``dopri5``, ``dop853``, ``implicit`` or ``auto``.
        accuracy: Largest error of a motion that is trusted, relative to 1 + |x| of positions and
            velocities, and after the first second for each second. ``auto`` is led by it.
    """

    integrator: str | None = None
    dt: Positive = 1.0e-3
    tolerance: Positive | None = None
    accuracy: Positive = 1.0e-6


# What a scene may declare tunable, in the order in which its numbers are stored
Tunable = Literal["gravity", "payload", "friction", "coulomb", "external"]


class Scene(Part):
    """A scene; everything but the robot is optional, and what is absent is not computed.

    Attributes:
        robot: The robot.
        gravity: Gravity in the world frame in [m/s²].
        joints: Settings of joints by name; ``"*"`` applies to all, and a joint's own entry
            overrides it, number by number, and tables as a whole: a table replaces the
            coefficients that it contains, and they replace a table.
        links: Inertias of links by name, in place of those of the URDF.
        payloads: Rigid bodies attached to frames.
        springs: Springs between points of two frames.
        constraints: Closed loops, ties to the world, couplings, and contacts.
        initial: The state at the start.
        sim: Integration.
        sensors: Measurements of the motion for controllers; by default the exact state, without
            delay.
        commands: Transmission of commands; by default without delay or loss.
        tunable: Quantities that may change while the simulator runs, or differ between the arms of
            a rollout: ``friction`` is the viscous one, ``coulomb`` the dry one, ``external`` are
            external joint torques, initially zero.
    """

    robot: RobotChoice
    gravity: Vector3 = (0.0, 0.0, -9.81)
    joints: dict[str, Joint] = {}
    links: dict[str, LinkBody] = {}
    payloads: tuple[Payload, ...] = ()
    springs: tuple[PointSpring, ...] = ()
    constraints: tuple[Constraint, ...] = ()
    initial: Initial = Initial()
    sim: Sim = Sim()
    sensors: Sensors | None = None
    commands: Commands | None = None
    tunable: tuple[Tunable, ...] = ()

    @field_validator("tunable")
    @classmethod
    def _check_tunable(cls, value: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        if "payload" in value and not info.data.get("payloads", True):
            raise ValueError("'payload' is tunable, but there are no 'payloads'; one is expected")
        if duplicates := [name for i, name in enumerate(value) if name in value[:i]]:
            raise ValueError(f"'{duplicates[0]}' is given twice; once is expected")
        return value

    @property
    def description(self) -> str:
        """The text of the URDF with the inertias of ``links``."""
        return with_bodies(self.robot.urdf, self.links)

    @property
    def delay(self) -> float:
        """Delay of states and commands together in [s]."""
        return sum(line.delay for line in (self.sensors, self.commands) if line is not None)

    @property
    def bilateral(self) -> dict[int, Bilateral]:
        """The constraints that are not contacts, by their indices in the list."""
        return {i: c for i, c in enumerate(self.constraints) if not isinstance(c, Contact)}

    @property
    def contacts(self) -> tuple[tuple[str, Contact], ...]:
        """The constraints that are contacts, with their names."""
        numbered = enumerate(self.constraints)
        return tuple((label(c, i), c) for i, c in numbered if isinstance(c, Contact))

    def joint(self, name: str) -> Joint:
        """Settings of the joint ``name``: its own entry merged with that of ``"*"``.

        Raises:
            SceneError: If the two cannot be merged, such as two kinds of stops.
        """
        common, own = self.joints.get("*"), self.joints.get(name)
        if common is None or own is None:
            return own or common or Joint()
        try:
            below, above = (
                x.model_dump(exclude_unset=True, exclude_none=True) for x in (common, own)
            )
            return Joint.model_validate(_merge(below, above))
        except ValidationError as error:
            raise _scene_error(error, ("joints", name)) from None


# Keys of a joint's friction and spring that are tables, whose points belong together
_TABLES = ("table", "position", "load")
# Keys beside a table of friction or of a spring in place of which it is
_IN_TABLES = {*IN_TABLE, "stiffness"}


def _merge(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """The keys of both, number by number; those ``above`` win, and a table replaces others."""
    merged = dict(below)
    for key in below:
        if ("table" in above and key in _IN_TABLES) or (
            key == "table" and _IN_TABLES & set(above)
        ):
            del merged[key]
    for key, value in above.items():
        is_part = isinstance(value, dict) and isinstance(merged.get(key), dict)
        merged[key] = _merge(merged[key], value) if is_part and key not in _TABLES else value
    return merged


def validated(data: dict[str, Any], context: dict[str, Any] | None = None) -> Scene:
    """Check a scene in a dictionary.

    Args:
        data: The content of a scene file.
        context: ``AS_CHECKED`` for the content of a scene that was checked before, else None.

    Returns:
        The scene.

    Raises:
        SceneError: Naming each offending key, its value and what is allowed.
    """
    try:
        return Scene.model_validate(data, context=context)
    except ValidationError as error:
        raise _scene_error(error) from None


def _scene_error(error: ValidationError, place: tuple[str, ...] = ()) -> SceneError:
    """The error to raise for content at a place of the scene that the schema refuses."""
    errors = error.errors()
    for item in errors:
        item["loc"] = (*place, *item["loc"])
    return SceneError("\n".join(complaints(errors, Schema(Scene, SCHEMAS, KINDS))))
