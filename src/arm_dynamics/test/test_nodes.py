# SPDX-License-Identifier: Apache-2.0
"""The nodes start from the installed package; nothing is sent to another process."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import rclpy
from arm_msgs.srv import ModelInfo
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from arm_dynamics.ros import ControllerNode, DynamicsNode

ROOM = 87  # a separate domain without other nodes


@pytest.fixture
def context(monkeypatch: pytest.MonkeyPatch) -> Iterator[Context]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = Context()
    rclpy.init(args=[], context=context, domain_id=ROOM)
    yield context
    context.try_shutdown()


def test_the_dynamics_node_answers(context: Context, pendulum: Any) -> None:
    node = DynamicsNode(pendulum.urdf, context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        client = node.create_client(ModelInfo, "~/model_info")
        future = client.call_async(ModelInfo.Request())
        executor.spin_until_future_complete(future, timeout_sec=10.0)
        answer = future.result()
        assert answer.success
        assert list(answer.joint_names) == ["swing"]
        assert answer.total_mass == pendulum.mass
    finally:
        executor.shutdown()
        node.destroy_node()


def test_the_controller_node_holds_the_arm_where_it_sees_it(
    context: Context, pendulum: Any
) -> None:
    node = ControllerNode(pendulum.urdf, context=context)
    try:
        state = JointState(name=["swing"], position=[0.7], velocity=[0.0])
        command = deserialize_message(node.on_joint_states(serialize_message(state)), JointState)
        np.testing.assert_allclose(command.effort, [pendulum.weight * np.sin(0.7)], rtol=1e-9)
    finally:
        node.destroy_node()
