# SPDX-License-Identifier: Apache-2.0
"""The recorder of a sim node: where it writes, and which topics."""

from datetime import datetime
from pathlib import Path
from typing import Any

from rclpy.node import Node

from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.ros.common.convert import as_bytes
from arm_dynamics.ros.interfaces import JOINT_COMMANDS, JOINT_STATES, Topic
from arm_sim.ros.inputs.inputs import Inputs
from arm_sim.ros.interfaces import COMMANDS, ENERGY, MULTIPLIERS, WRENCH
from arm_sim.ros.outputs import Outputs
from arm_sim.ros.record.definitions import definition_of, kind_of
from arm_sim.ros.record.ticks import TickRecorder
from arm_sim.ros.tick_engine import TickEngine

_TOPICS = (JOINT_COMMANDS, COMMANDS, WRENCH, ENERGY, MULTIPLIERS)


def attach_recorder(
    node: Node, path: str, engine: TickEngine, inputs: Inputs, outputs: Outputs
) -> TickRecorder:
    """Let a new recorder of a node record its ticks, inputs and outputs from now on.

    ``{time}`` in the path is replaced by the date and time.

    Raises:
        InvalidInput: If it cannot be written.
    """
    name = path.replace("{time}", datetime.now().strftime("%Y%m%d-%H%M%S"))
    names = {topic.name: node.resolve_topic_name(topic.name) for topic in _TOPICS}
    kinds = {names[topic.name]: kind_of(topic.type) for topic in _TOPICS}
    topics = {name: (kind, definition_of(kind)) for name, kind in kinds.items()}
    try:
        recorder = TickRecorder(
            Path(name).expanduser(), engine, node.get_fully_qualified_name(),
            node.resolve_topic_name(JOINT_STATES.name), topics, node.get_logger().error,
        )  # fmt: skip
    except OSError as error:
        raise InvalidInput(f"parameter 'record' = '{path}': {error.strerror or error}") from error

    def record(topic: Topic, message: Any, stamp: int = 0) -> None:
        if topic is JOINT_STATES:
            recorder.add_state(stamp, message)
        else:
            recorder.add_message(names[topic.name], stamp, as_bytes(message))

    engine.ticks.commands = recorder.channels[names[JOINT_COMMANDS.name]]  # C records them
    inputs.tap = outputs.tap = record
    return recorder
