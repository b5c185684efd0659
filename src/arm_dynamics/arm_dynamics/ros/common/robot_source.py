# SPDX-License-Identifier: Apache-2.0
"""Source of a node's arm: a scene, or a robot description by parameter or topic."""

import time
from contextlib import closing
from dataclasses import dataclass
from typing import Any

from rclpy.node import Node
from rclpy.serialization import deserialize_message

from arm_dynamics.actuation.command_map import with_compensation
from arm_dynamics.exceptions import InvalidInput, ModelError
from arm_dynamics.ros.common.params import parameter
from arm_dynamics.ros.common.polled_subscription import PolledSubscription
from arm_dynamics.ros.interfaces import ROBOT_DESCRIPTION
from arm_dynamics.scene.load import load_scene, scene_from_urdf
from arm_dynamics.scene.schema import Scene

FROM_SCENE, FROM_PARAMETER, FROM_TOPIC = "scene", "parameter", "topic"
# Largest limit of ``max_joints``: Pinocchio's memory grows with the cube of the joints, and it
# needs 0.1 s and 0.1 GB for 128, 0.2 s and 0.3 GB for 200.
MOST_JOINTS = 200
_POLL = 0.02  # [s] between polls for a description


@dataclass(frozen=True)
class DescriptionLimits:
    """Parameters that limit robot descriptions, which may come from anybody.

    A scene file is the user's own and is not limited.
    """

    max_joints: int = parameter(
        128, "Largest number of joints that move in a robot description; one with more is refused",
        low=1, high=MOST_JOINTS,
    )  # fmt: skip
    max_description_size: int = parameter(
        2**19, "Largest size of a robot description [bytes]; a larger one is refused",
        low=1, high=2**22,
    )  # fmt: skip


@dataclass(frozen=True)
class DescriptionParams(DescriptionLimits):
    """Parameters of a node whose arm may come as a robot description."""

    robot_description: str = parameter(
        "", "URDF text, used without a scene; empty: from the topic"
    )
    description_timeout: float = parameter(
        5.0, "How long to wait for it on the topic robot_description [s]", low=0.0, high=3600.0
    )
    gravity_compensated: bool = parameter(
        False, "Commanded efforts are added to the arm's own gravity compensation, as by the "
        "scene's key commands.gravity_compensated; sim and controller must agree",
    )  # fmt: skip


def scene_for(
    node: Node, argument: Any, name: str, params: DescriptionParams
) -> tuple[Scene, str]:
    """The scene of a node that cannot start without one, and its source.

    The first match wins: the constructor's ``argument``, the ``name`` in the parameter ``scene``,
    the parameter ``robot_description``, the topic. A description is URDF text, never the name of a
    file, so no message makes a node read files.

    Raises:
        ArmError: If there is none, or it cannot be used.
    """
    if argument is not None or name:
        warn_unused(node, params.robot_description)
        scene, source = load_scene(argument if argument is not None else name), FROM_SCENE
    elif params.robot_description:
        scene, source = described_scene(params.robot_description, params), FROM_PARAMETER
    else:
        text = _description_from_topic(node, params.description_timeout)
        scene, source = described_scene(text, params), FROM_TOPIC
    return with_compensation(scene) if params.gravity_compensated else scene, source


def described_scene(text: str, limits: DescriptionLimits) -> Scene:
    """The scene of a robot description, which is URDF as XML.

    Raises:
        ModelError: If it exceeds them or cannot be used.
    """
    size = len(text.encode(errors="replace"))
    if size > limits.max_description_size:
        raise ModelError(
            f"robot description: {size} bytes; parameter 'max_description_size' allows "
            f"{limits.max_description_size}"
        )
    return scene_from_urdf(text, most_joints=limits.max_joints)


def warn_unused(node: Node, description: str) -> None:
    """Warn that a description given at start is not used, because there is a scene."""
    if description:
        node.get_logger().warning(
            "parameter 'robot_description' is not used: the node has its arm from a scene"
        )


def _description_from_topic(node: Node, timeout: float) -> str:
    topic = node.resolve_topic_name(ROBOT_DESCRIPTION.name)
    if timeout:
        node.get_logger().info(f"no scene: waiting for a robot description on {topic}")
        end = time.monotonic() + timeout
        with closing(PolledSubscription(node, ROBOT_DESCRIPTION)) as newest:
            while time.monotonic() < end:
                if (message := newest.take()) is not None:
                    raw, _ = message
                    return str(deserialize_message(raw, ROBOT_DESCRIPTION.type).data)
                time.sleep(_POLL)
    raise InvalidInput(
        "parameter 'scene' is empty; allowed: a scene file or a URDF, or a URDF in the "
        f"parameter 'robot_description' or on {topic}, where none arrived within {timeout:g} s"
    )
