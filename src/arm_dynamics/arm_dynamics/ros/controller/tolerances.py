# SPDX-License-Identifier: Apache-2.0
"""Tolerances of the execution of a trajectory, and their monitoring.

The rules are those of joint_trajectory_controller (ros2_controllers, Jazzy): during the motion,
positions and velocities stay within tolerances of the reference; after the last point, positions
reach their tolerances and joints stop within a given time.
"""

import math
from collections.abc import Sequence
from ctypes import Structure, byref
from dataclasses import dataclass
from enum import Enum, auto
from functools import cached_property

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.control.controller import ArmState
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.ros.controller.controller_library import HEADER, library
from arm_dynamics.trajectory.reference import Reference

NONE = math.inf  # tolerance that is never exceeded


def effective(name: str, requested: float, default: float) -> float:
    """The effective tolerance: positive ones unchanged, inf and -1 none, 0 the default.

    Source: comments of control_msgs/JointTolerance; -1 up to the rounding of a float32. Other
    negative numbers and NaN are refused by ``InvalidInput``, which has the ``name``.
    """
    if requested > 0.0:
        return requested
    if requested == 0.0:
        return default
    if abs(requested + 1.0) < np.finfo(np.float32).eps:
        return NONE
    raise InvalidInput(f"{name} is {requested}; allowed: 0 (default), -1 (none) and positive ones")


class CTolerance(Structure):
    """``tolerance_t`` of answers.h, where the fields are explained, of arrays of shape (n,)."""

    _fields_ = HEADER.fields("tolerance_t")

    def __init__(self, position: Array, velocity: Array, turning: Array) -> None:
        self._arrays = position, velocity, turning  # kept alive
        super().__init__(*(array.ctypes.data for array in self._arrays))


def motion_of(state: ArmState, reference: Reference) -> Array:
    """A state and its reference as C reads them: q, v, and the reference's q, v, a; (5n,)."""
    return np.concatenate((state.q, state.v, reference.q, reference.v, reference.a))


@dataclass(frozen=True)
class StateTolerance:
    """Largest errors of each joint in [rad] or [m], and per second; inf for any."""

    position: tuple[float, ...]
    velocity: tuple[float, ...]

    @cached_property
    def is_none(self) -> bool:
        """Whether nothing can exceed it."""
        return min(*self.position, *self.velocity) == NONE


class Verdict(Enum):
    """Outcome of a trajectory."""

    REACHED = auto()
    LEFT_PATH = auto()
    MISSED_GOAL = auto()


@dataclass(frozen=True)
class Tolerances:
    """Tolerances of one trajectory.

    Attributes:
        path: Tolerances during the motion.
        goal: Tolerances from the last point on.
        goal_time: Time in [s] after the last point until the goal must be reached; inf for any.
        turning: Indices of continuous joints, whose errors are the shortest rotations.
    """

    path: StateTolerance
    goal: StateTolerance
    goal_time: float = NONE
    turning: tuple[int, ...] = ()

    @cached_property
    def turns(self) -> Array:
        """Nonzero for the continuous joints, shape (n,)."""
        turning = np.zeros(len(self.path.position), np.int64)
        turning[list(self.turning)] = 1
        return turning

    def arrays_of(self, tolerance: StateTolerance) -> CTolerance:
        """A tolerance, ``path`` or ``goal``, for C."""
        return CTolerance(np.array(tolerance.position), np.array(tolerance.velocity), self.turns)

    def errors(self, reference: Reference, state: ArmState) -> tuple[list[float], list[float]]:
        """Errors of positions and velocities, reference less measured, each of shape (n,)."""
        motion, n = motion_of(state, reference), len(state.q)
        errors = np.zeros(2 * n)
        library().find_errors(motion.ctypes.data, n, self.turns.ctypes.data, errors.ctypes.data)
        return errors[:n].tolist(), errors[n:].tolist()

    def verdict(self, left: float, reference: Reference, state: ArmState) -> Verdict | None:
        """The outcome by one state; None while the trajectory is being followed.

        ``left`` is the time in [s] until the last point, negative after it.
        """
        tolerance = self.path if left > 0.0 else self.goal
        motion, allowed = motion_of(state, reference), self.arrays_of(tolerance)
        outside = not tolerance.is_none and not library().is_within(
            motion.ctypes.data, len(tolerance.position), byref(allowed)
        )
        if left > 0.0:
            return Verdict.LEFT_PATH if outside else None
        if not outside:
            return Verdict.REACHED
        return Verdict.MISSED_GOAL if -left > self.goal_time else None

    def worst(
        self, verdict: Verdict, names: Sequence[str], reference: Reference, state: ArmState
    ) -> str:
        """Message about the joint that is farthest outside, its error and tolerance."""
        tolerance = self.path if verdict is Verdict.LEFT_PATH else self.goal
        allowed = np.array((tolerance.position, tolerance.velocity))
        errors = np.array(self.errors(reference, state))
        kind, joint = divmod(int(np.argmax(np.abs(errors) / allowed)), len(names))
        return (
            f"{('position', 'velocity')[kind]} of joint '{names[joint]}' is off by "
            f"{errors[kind, joint]:.4g}; allowed: {allowed[kind, joint]:.4g}"
        )
