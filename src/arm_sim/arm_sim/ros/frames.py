# SPDX-License-Identifier: Apache-2.0
"""Frames of the links on ``/tf`` and ``/tf_static``."""

from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Header

from arm_dynamics.arrays import Array
from arm_dynamics.model.description import Links
from arm_dynamics.ros.common.convert import to_time
from arm_dynamics.ros.common.endpoints import advertise
from arm_dynamics.ros.interfaces import LATCHED, Topic

_RSP = "robot_state_publisher"


class Frames:
    """Publishes transforms: the fixed ones once (latched), the others on request."""

    def __init__(self, node: Node, links: Links, names: Sequence[str], prefix: str) -> None:
        """Advertise, and publish the fixed ones; ``names`` are the joints of later positions.

        Raises:
            ImportError: Without tf2_msgs.
        """
        from tf2_msgs.msg import TFMessage

        moving_topic = Topic("/tf", TFMessage, publish=QoSProfile(depth=100))
        fixed_topic = Topic("/tf_static", TFMessage, publish=LATCHED)
        self._node, self._links, self._names = node, links, names
        self._publisher, static = advertise(node, moving_topic), advertise(node, fixed_topic)
        self._topic = node.resolve_topic_name(moving_topic.name)
        links.place({})
        fixed = moving_topic.type(transforms=_named(links.fixed, prefix))
        now = node.get_clock().now().to_msg()
        _fill(fixed.transforms, links.fixed_transforms(), now)
        static.publish(fixed)
        self._message = moving_topic.type(transforms=_named(links.moving, prefix))

    @property
    def has_subscribers(self) -> bool:
        """Whether there are subscribers."""
        return bool(self._publisher.get_subscription_count())

    def has_rivals(self) -> bool:
        """Whether a robot_state_publisher of the same namespace publishes frames."""
        here = self._node.get_namespace()
        publishers = self._node.get_publishers_info_by_topic(self._topic)
        return any(p.node_name == _RSP and p.node_namespace == here for p in publishers)

    def publish(self, stamp: int, positions: Array) -> None:
        """Publish the moving ones at positions of all joints, with a stamp in [ns]."""
        self._links.place(dict(zip(self._names, positions.tolist(), strict=True)))
        _fill(self._message.transforms, self._links.transforms(), to_time(stamp))
        self._publisher.publish(self._message)


def _named(pairs: Sequence[tuple[str, str]], prefix: str) -> list[TransformStamped]:
    return [
        TransformStamped(header=Header(frame_id=prefix + parent), child_frame_id=prefix + child)
        for parent, child in pairs
    ]


def _fill(transforms: Sequence[TransformStamped], numbers: Array, stamp: Any) -> None:
    for message, (x, y, z, qx, qy, qz, qw) in zip(transforms, numbers.tolist(), strict=True):
        message.header.stamp = stamp
        at, turn = message.transform.translation, message.transform.rotation
        at.x, at.y, at.z = x, y, z
        turn.x, turn.y, turn.z, turn.w = qx, qy, qz, qw
