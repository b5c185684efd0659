# SPDX-License-Identifier: Apache-2.0
"""Text of a caller is repeated clipped and on one line, in every message."""

import pytest
from geometry_msgs.msg import PoseStamped
from harness import Ros
from rclpy.parameter import Parameter
from sim_by_hand import NAMES, by_hand, command
from std_msgs.msg import Header

import models
from arm_dynamics.ros import ControllerNode, DynamicsNode
from arm_dynamics.ros.interfaces import (
    INVERSE_DYNAMICS,
    SET_FRICTION,
    SET_JOINT_STATE,
    TASK_SPACE,
)

pytestmark = pytest.mark.ros

RUDE = "\n\u202eall is well\x1b[31m" + "x" * 100_000


def is_safe(text: str) -> None:
    assert text
    assert text.isprintable()
    assert len(text) < 2500


def test_requests_to_the_sim(ros: Ros) -> None:
    node = by_hand(ros)
    for service, request in (
        (SET_JOINT_STATE, SET_JOINT_STATE.type.Request(joint_names=[RUDE], position=[0.0])),
        (SET_FRICTION, SET_FRICTION.type.Request(joint_names=[RUDE], viscous=[0.0])),
    ):
        answer = node.requests.answer(service, request)
        assert not answer.success
        is_safe(answer.message)


def test_questions_to_the_dynamics_node(ros: Ros) -> None:
    node = ros.add(DynamicsNode, models.scene("two_link"))
    for service, request in (
        (INVERSE_DYNAMICS, {"joint_names": [RUDE, "elbow"]}),
        (TASK_SPACE, {"frame": RUDE}),
        (TASK_SPACE, {"frame": "tip", "reference": RUDE}),
        (TASK_SPACE, {"frame": "tip", "axes": [RUDE]}),
    ):
        asked = service.type.Request(position=[0.0, 0.0], **request)
        answer = node.answer(service, asked, service.type.Response())
        assert not answer.success
        is_safe(answer.message)


def test_parameters_and_goals_of_the_controller(ros: Ros) -> None:
    node = ros.add(ControllerNode, models.scene("two_link"))
    for name in ("controller", "task_frame", "task_axes", "cartesian_timing"):
        (result,) = node.set_parameters([Parameter(name, value=RUDE)])
        assert not result.successful
        is_safe(result.reason)
    goal = PoseStamped()
    goal.header.frame_id, goal.pose.orientation.w = RUDE, 1.0
    node.on_cartesian_goal(goal)
    ros.spin_until(lambda: not node.busy)
    is_safe(node.goals.outcome)


def test_sources_of_commands_in_the_diagnostics(ros: Ros) -> None:
    node = by_hand(ros)
    for _ in range(20):
        message = command(header=Header(frame_id=RUDE), name=NAMES, effort=[0.0, 0.0])
        node.inputs.on_joint_commands(message)
        node.tick()
    node.inputs.on_joint_commands(command(name=NAMES, effort=[0.0, 0.0]))
    is_safe(node.engine.arbiter.last_refusal)
    for finding in node.diagnostics():
        for value in finding.values.values():
            assert str(value).isprintable()
            assert len(str(value)) < 2500
