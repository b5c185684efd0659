# SPDX-License-Identifier: Apache-2.0
"""Conflicts in the ROS graph: two nodes publish a topic of one, or have the same name."""

from rclpy.node import Node

_WAY_OUT = "or give it a namespace (--ros-args -r __ns:=/left) or a ROS_DOMAIN_ID of its own"


class Alarm:
    """A complaint of a node that is logged when it begins.

    Attributes:
        message: The complaint; empty while there is none.
    """

    def __init__(self, node: Node) -> None:
        self._log, self.message = node.get_logger(), ""

    def set(self, message: str) -> None:
        """Begin, go on, or end."""
        if message and not self.message:
            self._log.error(message)
        self.message = message


def publishers(node: Node, topic: str) -> dict[bytes, str]:
    """The nodes that publish a topic, by the identifiers of their publishers.

    One that was killed is among them for up to 20 s.
    """
    return {
        bytes(info.endpoint_gid): f"{info.node_namespace.rstrip('/')}/{info.node_name}"
        for info in node.get_publishers_info_by_topic(topic)
    }


def complaint_of_publishers(topic: str, one: str, other: str) -> str:
    """Complaint of two nodes that publish a topic of one."""
    return f"two nodes publish {topic}: {one}, and {other}; allowed: one. End one, {_WAY_OUT}"


def complaint_of_same_name(node: Node) -> str:
    """Complaint of another node that has the name of this one; empty if there is none."""
    own = node.get_name(), node.get_namespace()
    if node.get_node_names_and_namespaces().count(own) < 2:
        return ""
    return (
        f"two nodes are called {node.get_fully_qualified_name()}, and either answers requests to "
        "them; allowed: one (one that was killed counts for 20 s). End one, rename it (--ros-args "
        f"-r __node:=NAME), {_WAY_OUT}"
    )
