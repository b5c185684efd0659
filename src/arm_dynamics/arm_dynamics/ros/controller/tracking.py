# SPDX-License-Identifier: Apache-2.0
"""The controller's topic ``~/state``: reference, feedback, error and command."""

from collections.abc import Sequence
from ctypes import addressof, byref

import numpy as np
from arm_msgs.msg import TrackingState
from rclpy.node import Node

from arm_dynamics.arrays import Array
from arm_dynamics.cdr import CdrReader
from arm_dynamics.codegen.addresses import address
from arm_dynamics.control.controller import ArmState
from arm_dynamics.ros.common.convert import as_bytes, to_array
from arm_dynamics.ros.common.endpoints import advertise
from arm_dynamics.ros.controller.controller_library import HEADER, library
from arm_dynamics.ros.controller.goals import Goals
from arm_dynamics.ros.controller.tolerances import motion_of
from arm_dynamics.ros.interfaces import CONTROLLER_STATE
from arm_dynamics.trajectory.reference import Reference

_FIELDS = (
    "reference_position", "reference_velocity", "reference_acceleration", "feedback_position",
    "feedback_velocity", "position_error", "velocity_error", "effort",
)  # fmt: skip
_ARRAYS = HEADER.constants["ARRAYS"]  # in a TrackingState; the number ``remaining`` follows


class TrackingTopic:
    """Publishes the tracking state every few ticks while it has subscribers.

    Python and C do that by the same function, each for the states that it answers.

    Attributes:
        address: Address of ``report_t``.
    """

    def __init__(self, node: Node, names: Sequence[str]) -> None:
        """Advertise the topic of a controller of the joints ``names``."""
        self._publisher, self._names = advertise(node, CONTROLLER_STATE), list(names)
        self._shared = HEADER.structure("report_t")(publisher=self._publisher.handle.pointer)
        self.address = addressof(self._shared)
        self._raw, self._outcome = bytearray(), ""

    def restart(self) -> None:
        """Publish at the next state."""
        self._shared.due = 0

    def publish(
        self, stamp: int, period: float, goals: Goals, reference: Reference, state: ArmState,
        tau: Array,
    ) -> None:  # fmt: skip
        """Publish the state of ``stamp`` in [ns] and its answer ``tau`` if a message is due.

        ``period`` is the shortest time between two messages in [s].
        """
        self.prepare(period, goals)
        motion = motion_of(state, reference)
        arguments = byref(self._shared), stamp, tau.size, motion.ctypes.data
        if library().report_publish(*arguments, np.ascontiguousarray(tau).ctypes.data):
            self._publisher.publish(bytes(self._raw))  # again: it gives the reason

    def prepare(self, period: float, goals: Goals) -> None:
        """Let C publish the next messages, ``period`` in [s] apart, about the newest goal."""
        shared = self._shared
        start, motion = goals.follower.newest
        shared.period, shared.start, shared.duration = round(1e9 * period), start, motion.duration
        if not self._raw or goals.outcome != self._outcome:
            self._outcome = goals.outcome
            self._serialize(self._outcome)

    def _serialize(self, outcome: str) -> None:
        """Pass C a message with the ``outcome`` of a goal, serialized."""
        shared, message = self._shared, TrackingState(joint_names=self._names, goal=outcome)
        for name in _FIELDS:
            setattr(message, name, to_array(np.zeros(len(self._names))))
        raw = as_bytes(message)
        cdr = CdrReader(raw)
        cdr.nanoseconds()  # header.stamp
        cdr.text()  # header.frame_id
        cdr.texts()  # joint_names
        for k in range(_ARRAYS):
            size = 8 * cdr.count()
            shared.at[k] = cdr.skip(size, 8)
        shared.at[_ARRAYS] = cdr.skip(8, 8)
        self._raw = bytearray(raw)
        shared.raw, shared.size = address(self._raw), len(raw)
