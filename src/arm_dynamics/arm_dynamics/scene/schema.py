# SPDX-License-Identifier: Apache-2.0
"""The scene: one validated description of the physics, shared by every node.

The schema below is the scene file (see ``docs/scene-reference.md``). Physics
that is absent from it is not computed.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import (
    Field,
    StrictBool,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from arm_dynamics.exceptions import SceneError
from arm_dynamics.scene.complaints import complaint
from arm_dynamics.scene.constraint import (
    SCHEMAS,
    Bilateral,
    Constraint,
    Contact,
    Fraction,
    label,
)
from arm_dynamics.scene.drive import Actuator, Transmission
from arm_dynamics.scene.friction import KINDS, Friction
from arm_dynamics.scene.imperfections import Commands, Sensors
from arm_dynamics.scene.inertia import fault
from arm_dynamics.scene.servo import Servo
from arm_dynamics.scene.spring import JointSpring, PointSpring
from arm_dynamics.scene.types import (
    Finite,
    Inertia6,
    Limit,
    NonNegative,
    Part,
    Positive,
    Vector3,
)


class RobotChoice(Part):
    """Which robot, and which of its joints are held fast.

    Attributes:
        urdf: Path (relative to the scene file), ``package://`` URI, or the URDF text itself.
        lock: Names of joints that do not move; each stays at its initial position, else at zero.
    """

    urdf: str = Field(min_length=1)
    lock: tuple[str, ...] = ()


class Stop(Part):
    """What happens where a joint meets its position limits: a rigid stop, or a compliant one.

    Attributes:
        restitution: Speed of rebound from a rigid stop over speed of approach, 0 to 1.
        stiffness: Of a compliant stop in [N m/rad] or [N/m]; absent for a rigid one.
        damping: Of a compliant stop in [N m s/rad] or [N s/m].
    """

    restitution: Fraction | None = None
    stiffness: Positive | None = None
    damping: NonNegative | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> Stop:
        if self.stiffness is None and self.damping is not None:
            raise ValueError("damping belongs to a compliant stop, which needs its stiffness too")
        if self.stiffness is not None and self.restitution is not None:
            raise ValueError(
                "a stop is rigid, with restitution, or compliant, with stiffness and damping"
            )
        return self


class Limits(Part):
    """Limits of one joint that replace the URDF's ``<limit>``.

    Attributes:
        effort: Largest torque in [N m] or force in [N]; commands beyond it are saturated.
        velocity: Largest speed in [rad/s] or [m/s], for planning.
        lower: Lower position in [rad] or [m], for planning, and where a stop is.
        upper: Upper position in [rad] or [m], likewise.
        stop: What the stops at both are; absent or true: rigid, without rebound; false: there are
            none, and the limits are for planning only.
    """

    effort: Limit | None = None
    velocity: Limit | None = None
    lower: Finite | None = None
    upper: Finite | None = None
    stop: StrictBool | Stop | None = None

    @model_validator(mode="after")
    def _ordered(self) -> Limits:
        if self.lower is not None and self.upper is not None and self.lower >= self.upper:
            raise ValueError(
                f"lower = {self.lower} is not below upper = {self.upper}; "
                "robot.lock holds a joint where it is"
            )
        return self


class Joint(Part):
    """What the scene says of one joint, or of all (``"*"``).

    Attributes:
        friction: Friction coefficients.
        armature: Inertia of the drive seen at the joint in [kg m²] or [kg].
        actuator: Motor and gear; without one the command is the torque at the joint.
        transmission: What is flexible between gear and link.
        spring: A spring and a damper that act on the link.
        limits: Limits in place of the URDF's.
        servo: How it takes positions and velocities as commands.
    """

    friction: Friction = Friction()
    armature: NonNegative | None = None
    actuator: Actuator | None = None
    transmission: Transmission | None = None
    spring: JointSpring | None = None
    limits: Limits = Limits()
    servo: Servo = Servo()


class Payload(Part):
    """A rigid body welded to a frame.

    Attributes:
        frame: Link or joint frame of the URDF that carries it.
        mass: Mass in [kg].
        com: Centre of mass in the frame in [m].
        inertia: ixx, ixy, ixz, iyy, iyz, izz about the centre of mass, frame axes, in [kg m²]: as
            a rigid body can have them, see ``scene.inertia``.
    """

    frame: str
    mass: NonNegative
    com: Vector3 = (0.0, 0.0, 0.0)
    inertia: Inertia6 = (0.0,) * 6

    @field_validator("inertia")
    @classmethod
    def _of_a_body(cls, value: Inertia6, info: ValidationInfo) -> Inertia6:
        mass = info.data.get("mass")  # absent if it was refused itself
        if mass is not None and (trouble := fault(mass, value)):
            raise ValueError(trouble)
        return value


class Initial(Part):
    """Where the robot starts; a joint that is not named starts at zero, at rest.

    Where zero is beyond a joint's stops, it starts at the nearer one.

    Attributes:
        position: Joint positions by name in [rad] or [m].
        velocity: Joint velocities by name in [rad/s] or [m/s].
        hold: Names of joints that keep position and velocity when loops are closed at the start;
            the others give way.
    """

    position: dict[str, Finite] = {}
    velocity: dict[str, Finite] = {}
    hold: tuple[str, ...] = ()


class Sim(Part):
    """How the scene is integrated unless the caller says otherwise.

    Attributes:
        integrator: Name of the integration method, or ``auto``.
        dt: Length of one tick in [s].
        tolerance: Scaled error that a sub-step may have; turns on error control inside each tick.
    """

    integrator: str | None = None
    dt: Positive = 1.0e-3
    tolerance: Positive | None = None


class Scene(Part):
    """A whole scene, checked.

    Attributes:
        robot: The robot.
        gravity: Gravity in the world frame in [m/s²].
        joints: Joint settings by name; ``"*"`` speaks for all and gives way to a name.
        payloads: Bodies welded to frames.
        springs: Springs between points of two frames.
        constraints: What ties the robot to itself or to the world.
        initial: Start of the motion.
        sim: Integration.
        sensors: What a controller is told of the motion; absent: the motion itself, at once.
        commands: How commands get to the arm; absent: all of them, at once.
        tunable: What may differ between arms of a rollout or change while the simulator runs;
            costs a little. ``external`` are joint torques from outside, zero at first.
    """

    robot: RobotChoice
    gravity: Vector3 = (0.0, 0.0, -9.81)
    joints: dict[str, Joint] = {}
    payloads: tuple[Payload, ...] = ()
    springs: tuple[PointSpring, ...] = ()
    constraints: tuple[Constraint, ...] = ()
    initial: Initial = Initial()
    sim: Sim = Sim()
    sensors: Sensors | None = None
    commands: Commands | None = None
    tunable: tuple[Literal["gravity", "payload", "friction", "external"], ...] = ()

    @field_validator("tunable")
    @classmethod
    def _there_to_be_tuned(cls, value: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        if "payload" in value and not info.data.get("payloads", True):
            raise ValueError("'payload' is tunable, but there are no 'payloads'; one is expected")
        return value

    @property
    def bilateral(self) -> dict[int, Bilateral]:
        """The constraints that are no contacts, by their places in the list."""
        return {i: c for i, c in enumerate(self.constraints) if not isinstance(c, Contact)}

    @property
    def contacts(self) -> tuple[tuple[str, Contact], ...]:
        """The constraints that are contacts, with their names."""
        numbered = enumerate(self.constraints)
        return tuple((label(c, i), c) for i, c in numbered if isinstance(c, Contact))

    def joint(self, name: str) -> Joint:
        """What the scene says of the joint ``name``: its own entry laid over that of ``"*"``."""
        common, own = self.joints.get("*"), self.joints.get(name)
        if common is None or own is None:
            return own or common or Joint()
        return Joint.model_validate(_overlay(_given(common), _given(own)))


def _given(part: Part) -> dict[str, Any]:
    return part.model_dump(exclude_unset=True, exclude_none=True)


def _overlay(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    merged = dict(below)
    for key, value in above.items():
        both = isinstance(value, dict) and isinstance(merged.get(key), dict)
        merged[key] = _overlay(merged[key], value) if both else value
    return merged


def validated(data: dict[str, Any], context: dict[str, Any] | None = None) -> Scene:
    """Check a scene given as a dictionary.

    Args:
        data: The content of a scene file.
        context: ``AS_CHECKED`` for what comes from a scene that was checked, else None.

    Returns:
        The scene.

    Raises:
        SceneError: Naming each offending key, its value and what is allowed.
    """
    try:
        return Scene.model_validate(data, context=context)
    except ValidationError as error:
        said = [complaint(e, Scene, SCHEMAS, KINDS) for e in error.errors()]
        raise SceneError("\n".join(dict.fromkeys(said))) from None
