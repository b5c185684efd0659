# SPDX-License-Identifier: Apache-2.0
"""The controller's topic ``~/state``: reference, feedback, error and command."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from ctypes import Structure
from pathlib import Path

import numpy as np
from arm_msgs.msg import TrackingState
from rclpy.node import Node

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.header import Header
from arm_dynamics.codegen.kernel import ENTRY
from arm_dynamics.control.computed_torque import Moving
from arm_dynamics.ros.common.cdr import CdrReader, as_bytes
from arm_dynamics.ros.common.convert import to_array, to_time
from arm_dynamics.ros.common.direct import advertise
from arm_dynamics.ros.controller.goals import Goals
from arm_dynamics.ros.interfaces import CONTROLLER_STATE
from arm_dynamics.ros.joint_state import HEADER as JOINT_STATE
from arm_dynamics.ros.joint_state import address
from arm_dynamics.trajectory.reference import Reference

SOURCE = Path(__file__).with_name("native") / "answers.c"
HEADER = Header(SOURCE.with_suffix(".h"), ENTRY, JOINT_STATE)
_ARRAYS = HEADER.constants["ARRAYS"]  # in a TrackingState; the number ``remaining`` follows


class _Report(Structure):
    """``report_t`` of answers.h, where the fields are explained."""

    _fields_ = HEADER.fields("report_t")


class TrackingTopic:
    """Publishes the tracking state every few ticks while it has subscribers.

    Both Python and C do that, each for the states that it answers; they share the stamp from which
    the next message is due.
    """

    def __init__(self, node: Node, names: Sequence[str]) -> None:
        """Advertise the topic of a controller of the joints ``names``."""
        self._publisher, self._names = advertise(node, CONTROLLER_STATE), list(names)
        self._shared = _Report(publisher=self._publisher.handle.pointer)
        self._raw, self._outcome = bytearray(), ""

    @property
    def place(self) -> int:
        """Address of ``report_t``."""
        return ctypes.addressof(self._shared)

    def restart(self) -> None:
        """Publish at the next state."""
        self._shared.due = 0

    def publish(
        self, stamp: int, period: float, goals: Goals, reference: Reference, state: Moving,
        tau: Array,
    ) -> None:  # fmt: skip
        """Publish a message if one is due.

        Args:
            stamp: Of the state in [ns].
            period: Shortest time between two messages in [s].
            goals: What is followed.
            reference: At this stamp.
            state: Its positions and velocities.
            tau: The answer in [N m, N], shape (n,).
        """
        if stamp < self._shared.due:
            return
        self._shared.due = stamp + round(1e9 * period)
        if self._publisher.get_subscription_count():
            message = tracking_state(stamp, self._names, reference, state, tau)
            message.goal = goals.outcome
            message.remaining = goals.follower.remaining(stamp)
            self._publisher.publish(message)

    def prepare(self, period: float, goals: Goals) -> None:
        """Let C publish the next messages; arguments as of ``publish``."""
        shared = self._shared
        start, motion = goals.follower.newest
        shared.period, shared.start, shared.duration = round(1e9 * period), start, motion.duration
        if not self._raw or goals.outcome != self._outcome:
            self._outcome = goals.outcome
            self._lay_out()

    def _lay_out(self) -> None:
        """Serialize a message for C, and find its numbers."""
        none = np.zeros(len(self._names))
        nothing = Reference(none, none, none)
        message = tracking_state(0, self._names, nothing, nothing, none)
        message.goal = self._outcome
        raw, shared = as_bytes(message), self._shared
        cdr = CdrReader(raw)
        cdr.nanoseconds()
        cdr.text()
        cdr.texts()
        for k in range(_ARRAYS):
            size = 8 * cdr.count()
            shared.at[k] = cdr.skip(size, 8)
        shared.at[_ARRAYS] = cdr.skip(8, 8)
        self._raw = bytearray(raw)
        shared.raw, shared.size = address(self._raw), len(raw)


def tracking_state(
    stamp: int, names: Sequence[str], reference: Reference, state: Moving, tau: Array
) -> TrackingState:
    """Compose a message without goal; ``stamp`` in [ns], ``tau`` in [N m, N]."""
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
