# SPDX-License-Identifier: Apache-2.0
"""The format of the JointStates that a reader accepts."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from sensor_msgs.msg import JointState

from arm_dynamics.exceptions import InvalidInput, known_names
from arm_dynamics.scene.urdf.joint_names import JointNames, MimicJoint


class MissingNumbers(InvalidInput):
    """A required field is empty, or has NaN, which drivers send where they measure nothing."""

    def __init__(self, field: str, text: str) -> None:
        super().__init__(text)
        self.field = field


@dataclass(frozen=True)
class JointStateFormat:
    """Joints and fields of messages.

    Attributes:
        joints: Joints, in the order of the numbers read. As ``JointNames`` of an arm they include
            its mimic joints, which messages may name with numbers that agree with their leaders'.
        fields: The required ones of position, velocity and effort.
        may_lack_joints: Whether joints may be absent.
        ignores_extra: Whether further joints are ignored.
        may_have_gaps: Whether numbers, or whole fields, may be missing.
    """

    joints: Sequence[str]
    fields: Sequence[str]
    may_lack_joints: bool = False
    ignores_extra: bool = False
    may_have_gaps: bool = False

    @cached_property
    def _arm(self) -> JointNames:
        return self.joints if isinstance(self.joints, JointNames) else JointNames(self.joints)

    def indices(self, message: JointState) -> list[int]:
        """Index of each joint in a message, -1 if absent.

        Raises:
            InvalidInput: If joints are missing, unknown or repeated, or a length does not fit.
        """
        names, count = list(message.name), len(message.name)
        if len(set(names)) != count:
            raise InvalidInput(f"joints {names} are not all different; allowed: each joint once")
        for field in self.fields:
            length = len(getattr(message, field))
            if length != count and not (self.may_have_gaps and length == 0):
                text = (
                    f"{field} has {length} numbers for {count} joints; allowed: one for each name"
                )
                raise InvalidInput(text) if length else MissingNumbers(field, text)
        if not names:
            raise InvalidInput(f"it names no joints; allowed: {known_names(self.joints)}")
        missing = [joint for joint in self.joints if joint not in names]
        if not self.ignores_extra:
            self._arm.check(names)
        if missing and (len(missing) == len(self.joints) or not self.may_lack_joints):
            raise InvalidInput(f"joints {known_names(missing)} are missing")
        return [names.index(joint) if joint in names else -1 for joint in self.joints]

    def mimic_joints(self, message: JointState) -> list[MimicJoint]:
        """Mimic joints whose numbers must agree with their leaders'."""
        return [] if self.ignores_extra else self._arm.mimic_joints(list(message.name))

    def check_numbers(self, message: JointState) -> None:
        """Refuse numbers that are not finite, or contradict a leader's, by ``InvalidInput``."""
        for field in self.fields:
            if values := getattr(message, field):
                self._check_finite(field, dict(zip(message.name, values, strict=True)))
                for mimic in self.mimic_joints(message):
                    mimic.check(field, field, values)

    def _check_finite(self, field: str, numbers: dict[str, float]) -> None:
        for joint in self.joints:
            x = numbers.get(joint, 0.0)
            if not (math.isfinite(x) or (self.may_have_gaps and math.isnan(x))):
                text = f"{field} of joint '{joint}' is {x}; allowed: finite numbers"
                raise MissingNumbers(field, text) if math.isnan(x) else InvalidInput(text)
