# SPDX-License-Identifier: Apache-2.0
"""End stops of the joints: their positions and contact parameters."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.scene.schema import Stop
from arm_dynamics.scene.urdf.plain import NO_LIMIT

# Tolerance within which a position is at a stop, relative to the larger of it and 1: limits are
# often written with fewer digits.
ROUNDING = 1e-9

type Flags = NDArray[np.bool_]


class Range(NamedTuple):
    """Range of one joint of the robot description.

    Attributes:
        name: The joint.
        lower: Its lower limit in [rad] or [m], -inf for none.
        upper: Its upper limit, inf for none.
        stop: The scene's keys for its stops.
        leader: Index of the joint in a vector; of a mimic joint, that of its leader.
        ratio: Its speed over that of the leader; 1 for an independent joint.
        offset: Its position in [rad] or [m] where the leader is at zero.
    """

    name: str
    lower: float
    upper: float
    stop: Stop | bool | None
    leader: int
    ratio: float
    offset: float


@dataclass(frozen=True)
class Stops:
    """Stops of n joints; those of a mimic joint limit its leader. Arrays of shape (2, n).

    The first row holds the lower stops, the second the upper ones.

    Attributes:
        limit: Range for planning in [rad] or [m], infinite where there is none.
        place: Positions of the stops, infinite where there is none.
        restitution: Coefficient of restitution of rigid stops.
        stiffness: Stiffness of compliant stops in [N m/rad] or [N/m], zero for others.
        damping: Damping of compliant stops in [N m s/rad] or [N s/m].
        contradicting: Mimic joints whose limits are ignored, since combined with those of their
            leaders they would allow no motion at all, as in some published robots.
    """

    limit: Array
    place: Array
    restitution: Array
    stiffness: Array
    damping: Array
    contradicting: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        """Whether any joint has a stop."""
        return bool(np.isfinite(self.place).any())

    @cached_property
    def compliant(self) -> Flags:
        """Which stops are compliant, booleans."""
        return np.asarray(self.stiffness > 0.0)

    @cached_property
    def rigid(self) -> Flags:
        """Which stops are rigid, booleans."""
        return np.asarray(np.isfinite(self.place) & ~self.compliant)

    @cached_property
    def bounds(self) -> Array:
        """Range that rigid stops allow in [rad] or [m], infinite where there is none."""
        wide = np.array([[-np.inf], [np.inf]])
        return read_only(np.where(self.rigid, self.place, wide))

    def beyond(self, q: Array) -> Array:
        """Penetration of rigid stops, negative inside the range, shape as ``q``, (…, n)."""
        lower, upper = self.bounds
        return np.asarray(np.maximum(lower - q, q - upper))

    def touched(self, q: Array) -> Flags:
        """Which joints are at or beyond a stop of either kind, booleans, shape as ``q``."""
        return np.asarray((q <= self.place[0]) | (q >= self.place[1]))

    def within(self, q: Array) -> Array:
        """Positions clipped to the range that the rigid stops allow, shape as ``q``."""
        return np.asarray(np.clip(q, *self.bounds))

    def refusal(self, q: Array, names: tuple[str, ...]) -> str:
        """Error message for positions of shape (n,); empty if the rigid stops allow them."""
        beyond, (lower, upper) = self.beyond(q), self.bounds
        beyond = beyond - ROUNDING * np.maximum(1.0, abs(q))
        i = int(np.argmax(beyond))
        if not beyond[i] > 0.0:
            return ""
        return (
            f"joint '{names[i]}' at {q[i]:.6g} is beyond its stops; allowed: {lower[i]:.6g} to "
            f"{upper[i]:.6g}, or a scene with joints.{names[i]}.limits.stop: false"
        )


def stops_of(ranges: Iterable[Range], names: tuple[str, ...]) -> Stops:
    """The nearest stop on each side of each independent joint.

    Args:
        ranges: Ranges of all moving joints of the robot, mimic joints included.
        names: Names of the independent joints.
    """
    shape, contradicting = (2, len(names)), []
    limit = np.array([[-np.inf] * len(names), [np.inf] * len(names)])
    place, (restitution, stiffness, damping) = limit.copy(), np.zeros((3, *shape))
    for joint in sorted(ranges, key=lambda joint: joint.name != names[joint.leader]):
        ends, i = _ends(joint), joint.leader
        lower, upper = np.fmax(limit[0, i], ends[0]), np.fmin(limit[1, i], ends[1])
        if lower >= upper:
            contradicting.append(joint.name)
            continue
        limit[:, i] = lower, upper
        stop = Stop() if joint.stop in (None, True) else joint.stop
        for side, nearer in enumerate((ends[0] > place[0, i], ends[1] < place[1, i])):
            if not isinstance(stop, Stop) or not nearer:
                continue
            place[side, i], restitution[side, i] = ends[side], stop.restitution or 0.0
            stiffness[side, i] = (stop.stiffness or 0.0) * joint.ratio**2
            damping[side, i] = (stop.damping or 0.0) * joint.ratio**2
    arrays = limit, place, restitution, stiffness, damping
    limit, place, restitution, stiffness, damping = map(read_only, arrays)
    return Stops(limit, place, restitution, stiffness, damping, tuple(contradicting))


def _ends(joint: Range) -> tuple[float, float]:
    """Range of the leader in which ``joint`` stays within its own range."""
    if joint.ratio == 0.0:
        return -np.inf, np.inf
    lower, upper = (
        (value - joint.offset) / joint.ratio
        if abs(value) <= NO_LIMIT
        else np.copysign(np.inf, value * joint.ratio)
        for value in (joint.lower, joint.upper)
    )
    return (lower, upper) if joint.ratio > 0.0 else (upper, lower)
