# SPDX-License-Identifier: Apache-2.0
"""Names of joints in vectors, and values by name, where mimic joints may be named, too."""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput, choices, known_names
from arm_dynamics.scene.urdf.description import Mimic

# Deviation, relative to the larger of it and 1, up to which the value of a mimic joint agrees
TOLERANCE = 1e-3
FIELDS = ("position", "velocity", "acceleration")


class MimicJoint(NamedTuple):
    """A mimic joint among named joints.

    Attributes:
        name: The joint.
        joint: Its index among the named ones.
        leader: Index of its leader there.
        rule: How it follows.
    """

    name: str
    joint: int
    leader: int
    rule: Mimic

    def factor_and_offset(self, field: str) -> tuple[float, float]:
        """Factor and offset of its value over its leader's; zeros for efforts: it has none."""
        offset = self.rule.offset if field == "position" else 0.0
        return (self.rule.multiplier, offset) if field in FIELDS else (0.0, 0.0)

    def check(self, title: str, field: str, values: ArrayLike) -> None:
        """Refuse a value that contradicts the leader's.

        Args:
            title: Name of the values, for the message.
            field: See ``factor_and_offset``.
            values: Those of all named joints, shape (k,).

        Raises:
            InvalidInput: Naming both joints and what is expected.
        """
        row, (factor, offset) = np.asarray(values, float), self.factor_and_offset(field)
        own = float(row[self.joint])
        expected = factor * float(row[self.leader]) + offset if factor else offset
        if not abs(own - expected) <= TOLERANCE * max(1.0, abs(expected)) and not np.isnan(own):
            message = f"{title}: {self.name} follows {self.rule.leader}; command that one"
            if not np.isnan(expected):
                message = (
                    f"{title}: {self.name} is {own:.6g}, but {self.name} follows "
                    f"{self.rule.leader}, so {expected:.6g} is expected; command that one only"
                )
            raise InvalidInput(message)


class JointNames(tuple[str, ...]):
    """Names of the independent joints, in the order of every vector, that know the others.

    Attributes:
        rules: How mimic joints follow independent or locked ones, which do not move.
        locked: Joints that the scene locks.
    """

    rules: Mapping[str, Mimic]
    locked: Collection[str]

    def __new__(
        cls, names: Iterable[str], rules: Mapping[str, Mimic] = MappingProxyType({}),
        locked: Collection[str] = (),
    ) -> Self:  # fmt: skip
        """Names, with rules and locks of the other joints."""
        joints = super().__new__(cls, names)
        joints.rules, joints.locked = rules, locked
        return joints

    def check(self, names: Sequence[str], unknown_joints: str = "unknown joints") -> None:
        """Refuse names that are unknown or locked, or follow others that are not named.

        ``unknown_joints`` begins the message, if a name is unknown.
        """
        others = [name for name in names if name not in self]
        for name in others:
            if name in self.locked:
                raise InvalidInput(f"joint '{name}' is locked by the scene; leave it out")
            if name in self.rules and (leader := self.rules[name].leader) not in names:
                raise InvalidInput(f"{name} follows {leader}; command that one")
        if unknown := [name for name in others if name not in self.rules]:
            raise InvalidInput(
                f"{unknown_joints} {known_names(unknown)}; allowed: {choices(unknown[0], self)}"
            )

    def mimic_joints(self, names: Sequence[str]) -> list[MimicJoint]:
        """The mimic joints among names that have passed ``check``."""
        rules = self.rules
        return [
            MimicJoint(name, i, names.index(rules[name].leader), rules[name])
            for i, name in enumerate(names)
            if name not in self
        ]


def check_finite(title: str, names: Iterable[str], values: Iterable[float]) -> None:
    """Refuse by ``InvalidInput`` a value of a named joint that is not finite."""
    for name, x in zip(names, values, strict=False):
        if not math.isfinite(x):
            raise InvalidInput(f"{title}, joint '{name}', is {x}; allowed: finite numbers")


class NamedJoints:
    """The joints that a message names: those of the arm, and mimic joints that agree with them.

    Attributes:
        joints: Indices of the arm's joints, in the order of the message.
    """

    def __init__(self, names: Sequence[str], arm: JointNames) -> None:
        """Check the names, each at most once; none mean all joints of the arm."""
        names = list(names) or list(arm)
        arm.check(names)
        if len(set(names)) != len(names):
            raise InvalidInput(
                f"joints {known_names(names)} are not all different; allowed: each once"
            )
        self._names, self._mimics = names, arm.mimic_joints(names)
        self._own = [i for i, name in enumerate(names) if name in arm]
        self.joints = np.array([arm.index(names[i]) for i in self._own], np.intp)

    def spread(self, title: str, field: str, values: Sequence[float], rest: Array) -> Array:
        """Insert values of the named joints into a vector of all.

        Args:
            title: Name of the values, for messages.
            field: ``position``, ``velocity``, ``acceleration``, or another quantity, of which
                mimic joints have none.
            values: One for each name.
            rest: Values of the other joints, shape (n,).

        Raises:
            InvalidInput: If the length does not fit, a value of the arm is not finite, or those of
                mimic joints contradict.
        """
        if len(values) != len(self._names):
            raise InvalidInput(f"{title} has {len(values)} numbers; allowed: {len(self._names)}")
        check_finite(title, [self._names[i] for i in self._own], [values[i] for i in self._own])
        for mimic in self._mimics:
            mimic.check(title, field, values)
        full = np.array(rest)
        full[self.joints] = np.asarray(values)[self._own] if self._mimics else values
        return full
