# SPDX-License-Identifier: Apache-2.0
"""Which JointStates are accepted, and why others are not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sensor_msgs.msg import JointState

from arm_dynamics.exceptions import InvalidInput, known_names
from arm_dynamics.scene.urdf.joint_names import JointNames, MimicJoint


@dataclass(frozen=True)
class Expected:
    """Joints and fields that messages have.

    Attributes:
        joints: Joints, in the order of the numbers read. Those of an arm know its mimic joints,
            which messages may name, too, with numbers that agree with their leaders'.
        fields: Those of position, velocity and effort that are required.
        partial: Whether joints may be absent.
        extra: Whether further joints are ignored.
        gaps: Whether numbers, or whole fields, may be missing.
    """

    joints: Sequence[str]
    fields: Sequence[str]
    partial: bool = False
    extra: bool = False
    gaps: bool = False

    @property
    def _arm(self) -> JointNames:
        return self.joints if isinstance(self.joints, JointNames) else JointNames(self.joints)

    def indices(self, message: JointState) -> list[int]:
        """Index of each joint in a message, -1 if absent.

        Raises:
            InvalidInput: If joints are missing, unknown or repeated, or a length does not fit.
        """
        names = list(message.name)
        if len(set(names)) != len(names):
            raise InvalidInput(f"joints {names} are not all different; allowed: each joint once")
        for field in self.fields:
            length = len(getattr(message, field))
            if length != len(names) and not (self.gaps and length == 0):
                raise InvalidInput(
                    f"{field} has {length} numbers for {len(names)} joints; "
                    "allowed: one for each name"
                )
        if not names:
            raise InvalidInput(f"it names no joints; allowed: {known_names(self.joints)}")
        missing = [joint for joint in self.joints if joint not in names]
        if not self.extra:
            self._arm.check(names)
        if missing and (len(missing) == len(self.joints) or not self.partial):
            raise InvalidInput(f"joints {known_names(missing)} are missing")
        return [names.index(joint) if joint in names else -1 for joint in self.joints]

    def mimic_joints(self, message: JointState) -> list[MimicJoint]:
        """Mimic joints whose numbers must agree with their leaders'."""
        return [] if self.extra else self._arm.mimic_joints(list(message.name))

    def check_numbers(self, message: JointState) -> None:
        """Refuse numbers that are not finite, or contradict a leader's, by ``InvalidInput``."""
        for field in self.fields:
            values = getattr(message, field)
            numbers = dict(zip(message.name, values, strict=False))
            for joint in self.joints:
                x = numbers.get(joint, 0.0)
                if not (math.isfinite(x) or (self.gaps and math.isnan(x))):
                    raise InvalidInput(
                        f"{field} of joint '{joint}' is {x}; allowed: finite numbers"
                    )
            for mimic in self.mimic_joints(message):
                if numbers:
                    mimic.check(field, field, values)
