# SPDX-License-Identifier: Apache-2.0
"""Between messages and arrays: by joint name, with lengths and numbers checked."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from arm_msgs.msg import TrackingState
from builtin_interfaces.msg import Time
from numpy.typing import NDArray
from rclpy.impl.rcutils_logger import RcutilsLogger

from arm_dynamics.arrays import Array, all_finite
from arm_dynamics.control.computed_torque import Moving
from arm_dynamics.exceptions import ArmError, InvalidInput, known_names
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.ros.common.cdr import GIGA
from arm_dynamics.ros.controller.goal_bytes import TrajectoryBytes
from arm_dynamics.trajectory.reference import Reference, Waypoint


def to_time(stamp: int) -> Time:
    """Write a stamp in [ns] as a message."""
    seconds, nanoseconds = divmod(stamp, GIGA)
    return Time(sec=seconds, nanosec=nanoseconds)


def to_nanoseconds(message: Any) -> int:
    """Read a Time or Duration message in [ns]."""
    return int(message.sec) * GIGA + int(message.nanosec)


def to_array(values: Any) -> array[float]:
    """Write numbers as the type that message fields keep, row after row."""
    return array("d", np.ascontiguousarray(values, float).tobytes())


@contextmanager
def answering(response: Any, log: RcutilsLogger) -> Iterator[None]:
    """Answer a service with success, or with what was wrong; a node never dies of a request."""
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # refused by finite_answer
            yield
    except ArmError as error:
        response.success, response.message = False, str(error)
    except Exception as error:
        log.error(f"a service call failed unexpectedly: {error!r}")
        response.success, response.message = False, f"unexpected failure: {error!r}"
    else:
        response.success = True


_Order = NDArray[np.intp] | slice
_ALL = slice(None)  # the order of the model, as most requests have it


class Batch:
    """The vectors of one request: k points of n joints in the order that it names.

    Attributes:
        joint_names: Order of vectors in request and response.
        q: Positions, shape (k, n), in model order.
    """

    def __init__(
        self,
        names: Sequence[str],
        model_names: Sequence[str],
        position: Sequence[float],
        most: int,
    ) -> None:
        """Read what every request has.

        Args:
            names: The request's joint names; none means the model's order.
            model_names: Joints of the model.
            position: k·n numbers, point after point.
            most: How many points are allowed.

        Raises:
            InvalidInput: If joints are unknown, doubled or missing, or numbers do not fit.
        """
        self.joint_names = list(names) or list(model_names)
        self._order: _Order = _ALL
        self._back: _Order = _ALL
        if self.joint_names != list(model_names):
            self._order = _order(self.joint_names, model_names)
            self._back = np.argsort(self._order)
        n, size = len(model_names), len(position)
        if size == 0 or size % n:
            raise InvalidInput(f"position has {size} numbers; allowed is a multiple of {n}")
        if size > most * n:
            raise InvalidInput(
                f"position has {size // n} points; allowed are up to {most} in one call"
            )
        self.q = self._rows("position", position)

    def read(self, what: str, values: Sequence[float]) -> Array:
        """Read another vector, of as many numbers as the positions or of none, which means zeros.

        Returns:
            Shape (k, n), in model order.

        Raises:
            InvalidInput: If the length does not fit or a number is not finite.
        """
        if len(values) == 0:
            return np.zeros_like(self.q)
        if len(values) != self.q.size:
            raise InvalidInput(f"{what} has {len(values)} numbers; allowed is 0 or {self.q.size}")
        return self._rows(what, values)

    def vectors(self, rows: Array) -> array[float]:
        """Write (k, n) in model order as the flat vector of a response."""
        return to_array(finite_answer(rows)[:, self._order])

    def by_joint(self, values: Array, axis: int) -> Array:
        """Put an axis that counts joints in model order into the order of the request."""
        return values if self._order is _ALL else np.take(values, self._order, axis)

    def matrices(self, matrices: Array) -> array[float]:
        """Write (k, n, n) in model order as the flat vector of a response."""
        return to_array(finite_answer(matrices)[:, self._order][:, :, self._order])

    def _rows(self, what: str, values: Sequence[float]) -> Array:
        rows = np.array(values, float).reshape(-1, len(self.joint_names))
        if not all_finite(rows):
            point, joint = np.argwhere(~np.isfinite(rows))[0]
            raise InvalidInput(
                f"{what} of joint '{self.joint_names[joint]}' at point {point} is "
                f"{rows[point, joint]}; allowed are finite numbers"
            )
        return rows[:, self._back]


def _order(names: Sequence[str], model_names: Sequence[str]) -> NDArray[np.intp]:
    """Index into model order of each name, every joint once."""
    allowed = f"allowed is each of {known_names(model_names)} once"
    if len(names) > len(model_names):
        raise InvalidInput(f"{len(names)} joint names; {allowed}")
    unknown = [name for name in names if name not in model_names]
    if unknown:
        raise InvalidInput(f"unknown joints {known_names(unknown)}; {allowed}")
    if len(set(names)) != len(names) or len(names) != len(model_names):
        raise InvalidInput(f"joint names are {known_names(names)}; {allowed}")
    return np.array([model_names.index(name) for name in names], np.intp)


def finite_answer(answer: Array) -> Array:
    """Return the answer, or refuse it when the numbers asked for went out of range."""
    if not all_finite(answer):
        raise InvalidInput("the answer is not finite: the numbers given are too large")
    return answer


def joint_indices(names: Sequence[str], model_names: Sequence[str]) -> NDArray[np.intp]:
    """Find some joints of the model by name; no names mean all joints.

    Raises:
        InvalidInput: If joints are unknown or doubled.
    """
    known = set(names) <= set(model_names)
    if not known or len(set(names)) != len(names):
        raise InvalidInput(
            f"joint names are {known_names(names)}; allowed are some or all of "
            f"{known_names(model_names)}, each once"
        )
    return np.array([model_names.index(name) for name in names or model_names], np.intp)


def spread(what: str, values: Sequence[float], joints: NDArray[np.intp], rest: Array) -> Array:
    """Put numbers of some joints into a vector of all.

    Args:
        what: Name of the numbers, for messages.
        values: One for each of ``joints``.
        joints: Their indices.
        rest: What the other joints have, shape (n,).

    Raises:
        InvalidInput: If the length does not fit.
    """
    if len(values) != len(joints):
        raise InvalidInput(f"{what} has {len(values)} numbers; allowed is {len(joints)}")
    full = np.array(rest)
    full[joints] = values
    return full


def waypoints(
    message: TrajectoryBytes, model_names: Sequence[str], here: Reference
) -> list[Waypoint]:
    """Read a trajectory message.

    Args:
        message: Joints may be in any order; those it does not name stay where their reference is.
        model_names: Joints of the model.
        here: The present reference.

    Returns:
        Waypoints in model order.

    Raises:
        InvalidInput: If joints are unknown or doubled, lengths differ or positions are missing, or
            the message is damaged.
    """
    if not message.joint_names:
        raise InvalidInput(f"no joint names; allowed are some of {known_names(model_names)}")
    joints = joint_indices(message.joint_names, model_names)
    still = np.zeros_like(here.q)

    def derivative(what: str, values: Sequence[float]) -> Array | None:
        return spread(what, values, joints, still) if len(values) else None

    return [
        Waypoint(
            1e-9 * point.time,
            spread(f"positions of point {i}", point.positions, joints, here.q),
            derivative(f"velocities of point {i}", point.velocities),
            derivative(f"accelerations of point {i}", point.accelerations),
        )
        for i, point in enumerate(message.points())
    ]


def fill_model_info(response: Any, model: ArmModel) -> None:
    """Write what is known of an arm into a ``ModelInfo`` response."""
    response.joint_names = list(model.joint_names)
    response.joint_types = list(model.joint_types)
    response.position_lower = to_array(model.position_lower)
    response.position_upper = to_array(model.position_upper)
    response.velocity_limits = to_array(model.velocity_limit)
    response.effort_limits = to_array(model.effort_limit)
    response.frame_names = list(model.frame_names)
    response.total_mass = model.total_mass
    response.gravity = [float(g) for g in model.scene.gravity]
    response.summary = (
        f"{model.n} joints ({', '.join(sorted(set(model.joint_types)))}), "
        f"{len(model.frame_names)} frames, {model.total_mass:.3f} kg moving"
        + (f", commands in {', '.join(model.command_unit)}" if any(model.drives) else "")
    )


def tracking_state(
    stamp: int, names: Sequence[str], reference: Reference, state: Moving, tau: Array
) -> TrackingState:
    """Write what a controller follows, sees and commands at ``stamp`` in [ns]."""
    message = TrackingState(joint_names=list(names))
    message.header.stamp = to_time(stamp)
    message.reference_position = to_array(reference.q)
    message.reference_velocity = to_array(reference.v)
    message.reference_acceleration = to_array(reference.a)
    message.feedback_position = to_array(state.q)
    message.feedback_velocity = to_array(state.v)
    message.position_error = to_array(reference.q - state.q)
    message.velocity_error = to_array(reference.v - state.v)
    message.effort = to_array(tau)
    return message
