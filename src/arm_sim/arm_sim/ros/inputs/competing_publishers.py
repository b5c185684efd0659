# SPDX-License-Identifier: Apache-2.0
"""Other publishers of the joint states of this arm: a second sim, or the driver of the robot."""

import time
from collections.abc import Callable
from contextlib import suppress

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.utilities import get_rmw_implementation_identifier

from arm_dynamics import InvalidInput
from arm_dynamics.ros.common.conflicts import Alarm, complaint_of_publishers, publishers
from arm_dynamics.ros.common.executor import steady_timer
from arm_dynamics.ros.common.polled_subscription import PolledSubscription
from arm_dynamics.ros.interfaces import JOINT_STATES
from arm_dynamics.ros.joint_state import FAILED, NONE, JointStateFormat, JointStateReader, parsed
from arm_sim.ros.outputs import Outputs
from arm_sim.ros.timing.round_trip import RoundTrip
from arm_sim.ros.timing.stamps import ROS

_PERIOD = 0.5  # [s] between checks
_DEPTH = 1000  # messages of others and of this sim between two checks
_EVERY_STATE = JOINT_STATES._replace(
    subscribe=QoSProfile(depth=_DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
)
_SILENCE = 1.0  # [s] after which a publisher is gone, although a killed one is listed for 20 s
_LEAVING = 2.0  # [s] that a predecessor may need to end


class CompetingPublishers:
    """Listens for others who publish states of the same joints.

    One controller would answer them all, and they all would obey. Who comes second refuses to
    start. Should two start at once, or a driver later, both go on, and this sim accepts commands
    only with stamps of its own states. Others are listened to until it is known whether they name
    the same joints; a sim without others does not listen.

    Attributes:
        alarm: On while others publish.
    """

    def __init__(
        self, node: Node, outputs: Outputs, trip: RoundTrip, on_change: Callable[[], None]
    ) -> None:
        """Prepare for states that ``outputs`` publishes; ``trip`` knows their stamps.

        ``on_change`` is called when the alarm goes on or off.
        """
        self._node, self._outputs, self._trip = node, outputs, trip
        self._topic = node.resolve_topic_name(JOINT_STATES.name)
        self._ignored = {outputs.states.sender}  # this sim, and publishers of other joints
        self._competitor, self._latest = b"", 0.0  # the last publisher of a state, and when
        self._reader = JointStateReader(JointStateFormat((), (), ignores_extra=True))
        self._subscription: PolledSubscription | None = None
        self._timer = None
        self.alarm, self._on_change = Alarm(node), on_change

    def refuse_if_any(self) -> None:
        """Make sure that nobody else publishes, before this sim does.

        On Fast RTPS, watch that from then on; elsewhere, messages do not tell this sim's own
        publisher from others.

        Raises:
            InvalidInput: If somebody does, and goes on for a while.
        """
        begin = time.monotonic()
        while self._hear_competitor(since=begin):
            if time.monotonic() - begin > _LEAVING:
                raise InvalidInput(self._message())
            time.sleep(0.02)
        if "fastrtps" in get_rmw_implementation_identifier():
            self._timer = steady_timer(self._node, _PERIOD, self.update)

    def update(self) -> None:
        """Look whether others published within the last second."""
        persists = self._hear_competitor()
        if persists != bool(self.alarm.message):
            self.alarm.set(self._message() if persists else "")
            self._on_change()

    def check(self, stamp: int) -> None:
        """Check that a command with a stamp in [ns] is for this sim.

        Raises:
            InvalidInput: If there are others, and it does not answer a state of this one.
        """
        ours = self._outputs.stamps.name == ROS and self._trip.awaits(stamp)
        if self.alarm.message and not ours:
            raise InvalidInput("it answers no state of this sim, but perhaps of another one")

    def close(self) -> None:
        """Stop listening."""
        if self._subscription is not None:
            self._reader.close()
            self._subscription.close()
            self._subscription = None

    def _hear_competitor(self, since: float = 0.0) -> bool:
        """Listen while others may publish; return whether one did so within the last second.

        Those that have not been heard yet count as heard at ``since`` in [s] of the monotonic
        clock.
        """
        node, topic = self._node, self._topic
        if node.count_publishers(topic) == 1 or publishers(node, topic).keys() <= self._ignored:
            self.close()
            return False
        self._take_states()
        return time.monotonic() - max(since, self._latest) < _SILENCE

    def _take_states(self) -> None:
        """Read what publishers have sent, and register them; the first time, subscribe."""
        if self._subscription is None:
            self._subscription = PolledSubscription(self._node, _EVERY_STATE)
            self._reader.open(self._subscription.pointer)
        for _ in range(_DEPTH):
            if self._reader.take() in (NONE, FAILED):
                break
            with suppress(InvalidInput):  # it is no JointState
                self._register_sender(self._reader.sender)

    def _register_sender(self, sender: bytes) -> None:
        """Register the publisher of the message that the reader has."""
        if sender in self._ignored:
            return
        mine = set(self._outputs.states.names)
        if sender != self._competitor and mine.isdisjoint(parsed(self._reader.raw).name):
            self._ignored.add(sender)
        else:
            self._competitor, self._latest = sender, time.monotonic()

    def _message(self) -> str:
        name = publishers(self._node, self._topic).get(self._competitor, "unknown")
        return complaint_of_publishers(self._topic, "this sim", f"'{name}'")
