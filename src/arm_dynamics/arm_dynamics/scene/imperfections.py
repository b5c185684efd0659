# SPDX-License-Identifier: Apache-2.0
"""Keys of sensors and of the communication between an arm and its controller.

The physics of the arm does not depend on these keys; ``arm_sim.imperfections`` implements them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Annotated, Literal

from pydantic import BeforeValidator, ConfigDict, Field, StrictBool, StrictInt, model_validator

from arm_dynamics.exceptions import SceneError
from arm_dynamics.scene.constraint import Fraction, check_joints
from arm_dynamics.scene.types import Finite, NonNegative, Part, Positive
from arm_dynamics.scene.urdf.description import Urdf

ALL = "*"


def _by_joint(value: object) -> object:
    """Expand one number to all joints."""
    if isinstance(value, Mapping):
        return value
    if isinstance(value, int | float | str):
        return {ALL: value}
    raise ValueError("a number, or numbers by joint name, is expected")


# Numbers of at least zero by joint name; ``"*"`` applies to joints that are not named
ByJoint = Annotated[dict[str, NonNegative], BeforeValidator(_by_joint)]
AnyByJoint = Annotated[dict[str, Finite], BeforeValidator(_by_joint)]
PositiveByJoint = Annotated[dict[str, Positive], BeforeValidator(_by_joint)]
Delay = Annotated[NonNegative, Field(le=10.0)]


class PositionSensor(Part):
    """An encoder at each joint.

    Attributes:
        resolution: Step of the encoder in [rad] or [m]; 0 for none.
        counts: The same for revolute joints, as steps per revolution; not both for one joint.
        noise: Standard deviation of each sample in [rad] or [m], before rounding.
        offset: Offset in [rad] or [m], before rounding.
    """

    resolution: ByJoint = {}
    counts: PositiveByJoint = {}
    noise: ByJoint = {}
    offset: AnyByJoint = {}

    @model_validator(mode="after")
    def _check_step(self) -> PositionSensor:
        if both := sorted(self.resolution.keys() & self.counts.keys()):
            raise ValueError(f"'{both[0]}' has resolution and counts; one of them is expected")
        return self


class VelocitySensor(Part):
    """The measurement of velocities.

    Attributes:
        source: ``motion``: the exact velocity. ``position``: differences of the encoder from tick
            to tick.
        cutoff: Cutoff frequency in [Hz] of a Butterworth low-pass filter, below half the rate of
            the ticks; without it there is no filter.
        order: Order of that filter.
        noise: Standard deviation of each sample in [rad/s] or [m/s], after the filter.
        offset: Offset in [rad/s] or [m/s], after the filter.
    """

    model_config = ConfigDict(serialize_by_alias=True)

    source: Annotated[Literal["position", "motion"], Field(alias="from")] = "motion"
    cutoff: PositiveByJoint = {}
    order: Literal[1, 2] = 1
    noise: ByJoint = {}
    offset: AnyByJoint = {}


class EffortSensor(Part):
    """The measurement of torques.

    Attributes:
        noise: Standard deviation of each sample in [N m] or [N].
        offset: Offset in [N m] or [N].
    """

    noise: ByJoint = {}
    offset: AnyByJoint = {}


class Line(Part):
    """Transmission of messages; overtaken messages are lost.

    Attributes:
        delay: Delay of each message in [s].
        jitter: Largest additional delay in [s], uniformly distributed from zero.
        loss: Fraction of messages that are lost.
    """

    delay: Delay = 0.0
    jitter: Delay = 0.0
    loss: Fraction = 0.0

    @property
    def perfect(self) -> bool:
        """Whether every message arrives without delay."""
        return not (self.delay or self.jitter or self.loss)


class Sensors(Line):
    """Measurements of the motion for controllers, and their transmission.

    Attributes:
        seed: Seed of all random numbers of sensors and lines.
        position: The encoders.
        velocity: The measurement of velocities.
        effort: The measurement of torques.
    """

    seed: Annotated[StrictInt, Field(ge=0, lt=2**63)] = 0
    position: PositionSensor = PositionSensor()
    velocity: VelocitySensor = VelocitySensor()
    effort: EffortSensor = EffortSensor()


class Commands(Line):
    """Meaning of commands, and their transmission.

    Attributes:
        gravity_compensated: Whether efforts are added to the arm's own gravity compensation.
    """

    gravity_compensated: StrictBool = False


def values(by_joint: Mapping[str, float], names: Sequence[str]) -> list[float]:
    """The number of each joint; zero where there is none."""
    common = by_joint.get(ALL, 0.0)
    return [by_joint.get(name, common) for name in names]


def check_sensors(sensors: Sensors, urdf: Urdf, locked: Collection[str]) -> None:
    """Check that joints of sensors move independently, and are revolute if they have counts."""
    free = urdf.free(locked)
    for kind in ("position", "velocity", "effort"):
        part: Part = getattr(sensors, kind)
        for key, by_joint in part:
            if isinstance(by_joint, dict):
                named = [name for name in by_joint if name != ALL]
                check_joints(f"sensors.{kind}.{key}", named, free, urdf, locked)
    counts = sensors.position.counts
    for name in free:
        if (name in counts or ALL in counts) and urdf.joints[name] == "prismatic":
            raise SceneError(
                f"scene: 'sensors.position.counts': joint '{name}' is prismatic, so it has no "
                "counts per revolution; allowed: a resolution in m"
            )
