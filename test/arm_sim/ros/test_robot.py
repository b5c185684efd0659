# SPDX-License-Identifier: Apache-2.0
"""What the sim publishes about its robot: description, all joints, frames."""

import importlib.util
import sys
import time
from functools import partial
from typing import Any

import numpy as np
import pytest
from harness import Ros
from rclpy.node import Node
from sensor_msgs.msg import JointState
from sim_by_hand import by_hand, command, ticks
from std_msgs.msg import String

import models
from arm_dynamics import ArmError
from arm_dynamics.ros import ControllerNode
from arm_dynamics.ros.interfaces import LATCHED
from arm_sim.ros import SimNode

pytestmark = pytest.mark.ros

URDF = models.scene("two_link").robot.urdf
FINGERS = ["panda_finger_joint1", "panda_finger_joint2"]
with_tf = pytest.mark.skipif(
    importlib.util.find_spec("tf2_msgs") is None, reason="tf2_msgs is not built"
)


def described(ros: Ros, text: str = URDF) -> None:
    """A robot_state_publisher, as far as the description goes."""
    ros.peer.create_publisher(String, "robot_description", LATCHED).publish(String(data=text))


@pytest.mark.parametrize("make", [SimNode, ControllerNode])
def test_a_description_will_do_in_place_of_a_scene(ros: Ros, make: Any) -> None:
    """By topic for one, by a parameter for the other."""
    if make is SimNode:
        described(ros)
        model = ros.add(make).simulator.model
    else:
        model = ros.add(make, robot_description=URDF).dynamics.model
    assert model.joint_names == models.dynamics("two_link").joint_names


def test_no_arm_is_an_error(ros: Ros) -> None:
    refused: tuple[tuple[dict[str, Any], str], ...] = (
        ({"description_timeout": 0.1}, "'scene' is empty.*none arrived within 0.1 s"),
        ({"robot_description": "/etc/passwd"}, "not well-formed XML"),
        ({"robot_description": URDF, "max_joints": 1}, "2 joints that move; at most 1 are"),
    )
    for given, complaint in refused:
        with pytest.raises(ArmError, match=complaint):
            ros.add(SimNode, **given)
    described(ros, "<robot")
    with pytest.raises(ArmError, match="not well-formed XML"):
        ros.add(SimNode)


def test_a_description_is_published_for_late_subscribers_unless_it_was_heard(ros: Ros) -> None:
    by_hand(ros)
    heard = ros.listen(String, "/robot_description", LATCHED)
    ros.spin_until(lambda: heard)
    assert heard[0].data == URDF
    ros.add(SimNode, realtime=False)
    ros.add(SimNode, models.scene("two_link"), realtime=False, publish_description=False)
    assert ros.peer.count_publishers("/robot_description") == 1


@pytest.mark.parametrize("every", [False, True])
def test_joint_states_are_of_the_arm_unless_all_joints_are_wanted(ros: Ros, every: bool) -> None:
    """Those for people are of all joints in any case."""
    node = by_hand(ros, "panda", publish_all_joints=every)
    shown, published = (
        ros.listen(JointState, topic) for topic in ("/sim/all_joint_states", "/joint_states")
    )
    node.inputs.on_joint_commands(command(name=["panda_joint1"], effort=[1.5]))
    ticks(node, 3)
    ros.spin_until(lambda: shown and shown[-1].header.stamp.nanosec == 3_000_000)
    ros.spin_until(lambda: published and published[-1].header.stamp == shown[-1].header.stamp)
    sim = node.simulator
    for message, fingers in (shown[-1], FINGERS), (published[-1], FINGERS if every else []):
        assert list(message.name) == [*sim.joint_names, *fingers]
        still = [0.0] * len(fingers)
        np.testing.assert_array_equal(message.position, [*sim.state.q, *still])
        np.testing.assert_array_equal(message.velocity, [*sim.state.v, *still])
        np.testing.assert_array_equal(message.effort, [*sim.effort, *still])
    for stamp in (7, 8):
        node.display._states.send(stamp)
    ros.spin_until(lambda: any(state.header.stamp.nanosec == 8 for state in shown))
    assert [state.header.stamp.nanosec for state in shown].count(7) == 1


def test_nothing_is_shown_at_rate_zero_or_without_tf_messages(
    ros: Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = by_hand(ros, display_rate=0.0)
    assert node.display is None
    assert "/sim/all_joint_states" not in dict(ros.peer.get_topic_names_and_types())
    monkeypatch.setitem(sys.modules, "tf2_msgs.msg", None)
    found = next(f for f in by_hand(ros).diagnostics() if f.part == "simulation")
    assert found.values["tf"] == "not published: tf2_msgs is not installed"


@with_tf
def test_frames_are_those_of_the_links(ros: Ros) -> None:
    from tf2_msgs.msg import TFMessage

    made = partial(SimNode, models.scene("panda"), namespace="left")
    node = ros.add(made, realtime=False, frame_prefix="left/")
    still = ros.listen(TFMessage, "/tf_static", LATCHED)
    moving = ros.listen(TFMessage, "/tf")
    ticks(node, 5)
    ros.spin_until(lambda: still and moving)
    stamps = {t.header.stamp.nanosec for t in moving[-1].transforms}
    assert stamps == {5_000_000}
    frames = {t.child_frame_id: t for t in (*still[0].transforms, *moving[-1].transforms)}
    links = {f"left/{f.name}" for f in node.simulator.model.whole.frames if f.type.name == "BODY"}
    assert {*frames, "left/panda_link0"} == links
    first = frames["left/panda_link1"]
    assert first.header.frame_id == "left/panda_link0"
    q = node.simulator.state.q[0]  # the first joint turns about z, 0.333 m above the base
    assert first.transform.translation.z == pytest.approx(0.333)
    assert first.transform.rotation.z == pytest.approx(np.sin(q / 2.0))
    assert first.transform.rotation.w == pytest.approx(np.cos(q / 2.0))


@with_tf
def test_frames_are_left_to_a_robot_state_publisher(ros: Ros) -> None:
    from tf2_msgs.msg import TFMessage

    ros.add(Node, "robot_state_publisher").create_publisher(TFMessage, "/tf", 10)
    node = by_hand(ros, "two_link", display_rate=50.0)
    heard = ros.listen(TFMessage, "/tf")
    ros.spin_until(lambda: node.display.frames == "left to robot_state_publisher")
    heard.clear()
    end = time.monotonic() + 0.15
    ros.spin_until(lambda: time.monotonic() > end)
    assert not heard
