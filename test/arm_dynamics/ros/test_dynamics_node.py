# SPDX-License-Identifier: Apache-2.0
"""The dynamics node's responses against the core, and its errors for bad requests."""

import threading
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from arm_msgs.srv import InverseDynamics
from harness import Ros
from rclpy.parameter import Parameter
from std_msgs.msg import String

import models
from arm_dynamics import Term, load_scene
from arm_dynamics.ros import DynamicsNode
from arm_dynamics.ros.dynamics_node import node as dynamics_node
from arm_dynamics.ros.interfaces import (
    DYNAMICS_TERMS,
    FORWARD_DYNAMICS,
    INVERSE_DYNAMICS,
    LATCHED,
    MAX_POINTS,
    MODEL_INFO,
    TASK_SPACE,
    Service,
)
from tolerances import INVERSE_PAIR, PINOCCHIO, assert_close

pytestmark = pytest.mark.ros

PENDULUM = (models.SCENES / "pendulum.urdf").read_text()
TWO_LINK = (models.SCENES / "two_link.urdf").read_text()
SPRUNG = load_scene(
    {
        "robot": {"urdf": TWO_LINK},
        "joints": {"elbow": {"spring": {"stiffness": 9.0, "damping": 0.5}}},
        "springs": [{"frames": ["forearm", "world"], "stiffness": 50.0, "rest_length": 0.2}],
    }
)


@pytest.fixture
def node(ros: Ros) -> DynamicsNode:
    """Knows the Panda."""
    return ros.add(DynamicsNode, models.scene("panda"))


def asked(node: DynamicsNode, service: Service, **fields: Any) -> Any:
    return node.answer(service, service.type.Request(**fields), service.type.Response())


def inverse(node: DynamicsNode, **fields: Any) -> Any:
    return asked(node, INVERSE_DYNAMICS, **fields)


def info(node: DynamicsNode) -> Any:
    return asked(node, MODEL_INFO)


def batch(rng: np.random.Generator, count: int, n: int = 7) -> np.ndarray:
    return rng.normal(size=(3, count, n))


def test_springs_are_among_the_terms_unless_they_are_left_out(
    ros: Ros, rng: np.random.Generator
) -> None:
    node = ros.add(DynamicsNode, SPRUNG)
    q, v, a = batch(rng, 4, n=2)
    state = {"position": q.ravel(), "velocity": v.ravel()}
    spring = asked(node, DYNAMICS_TERMS, **state).spring
    assert_close(spring, node.dynamics.spring(q, v).ravel(), PINOCCHIO)
    torque = inverse(node, acceleration=a.ravel(), **state).effort  # all terms
    assert_close(torque, node.dynamics.inverse(q, v, a).ravel(), PINOCCHIO)
    without = inverse(node, acceleration=a.ravel(), terms=15, **state).effort
    assert_close(np.subtract(torque, without), spring, PINOCCHIO)
    back = asked(node, FORWARD_DYNAMICS, effort=torque, **state)
    assert_close(back.acceleration, a.ravel(), INVERSE_PAIR)


def test_terms_of_the_message_are_those_of_the_library() -> None:
    for term in (*Term, Term.ALL):
        assert getattr(InverseDynamics.Request, str(term.name)) == term
    assert InverseDynamics.Request().terms == Term.ALL


def test_model_info(node: DynamicsNode) -> None:
    answer, model = info(node), node.dynamics.model
    assert answer.success
    assert tuple(answer.joint_names) == model.joint_names
    assert tuple(answer.joint_types) == model.joint_types
    assert tuple(answer.frame_names) == model.frame_names
    np.testing.assert_array_equal(answer.position_lower, model.position_lower)
    np.testing.assert_array_equal(answer.position_upper, model.position_upper)
    np.testing.assert_array_equal(answer.velocity_limits, model.velocity_limit)
    np.testing.assert_array_equal(answer.effort_limits, model.effort_limit)
    np.testing.assert_array_equal(answer.gravity, [0.0, 0.0, -9.81])
    assert answer.total_mass == model.total_mass
    assert "7 joints" in answer.summary


BAD = [
    ({}, "position has 0 numbers; allowed: a multiple of 7"),
    ({"position": [0.0] * 14, "velocity": [0.0] * 7}, "velocity has 7 numbers; allowed: 0 or 14"),
    (
        {"position": [0.0] * 9 + [np.nan] + [0.0] * 4},
        "position of joint 'panda_joint3' at point 1 is nan; allowed: finite numbers",
    ),
    ({"position": [0.0] * 7, "terms": 32}, "32"),
    ({"position": [1e308] * 7, "velocity": [1e308] * 7}, "too large"),
    ({"position": [0.0] * 7 * (MAX_POINTS + 1)}, f"up to {MAX_POINTS} in one call"),
    ({"position": [0.0], "joint_names": ["panda_joint1"]}, "each of panda_joint1"),
    ({"position": [0.0] * 7, "joint_names": ["x"] * 100_000}, "100000 joint names; allowed"),
]


def test_bad_requests_are_refused_and_the_node_goes_on(node: DynamicsNode) -> None:
    for fields, complaint in BAD:
        answer = inverse(node, **fields)
        assert not answer.success
        assert complaint in answer.message
        assert len(answer.message) < 1000
        assert len(answer.effort) == 0
        assert inverse(node, position=[0.0] * 7).success


def test_an_unexpected_failure_is_answered(
    node: DynamicsNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> None:
        raise ZeroDivisionError("by surprise")

    monkeypatch.setattr(type(node.dynamics), "inverse", fail)
    answer = inverse(node, position=[0.0] * 7)
    assert not answer.success
    assert "by surprise" in answer.message


def test_without_a_robot_every_service_says_so(ros: Ros) -> None:
    node = ros.add(DynamicsNode)
    for service in (INVERSE_DYNAMICS, FORWARD_DYNAMICS, DYNAMICS_TERMS, MODEL_INFO):
        answer = asked(node, service)
        assert not answer.success
        assert "/robot_description" in answer.message


def test_description_comes_by_topic_even_if_it_was_published_before(ros: Ros) -> None:
    publisher = ros.peer.create_publisher(String, "/robot_description", LATCHED)
    publisher.publish(String(data=PENDULUM))
    node = ros.add(DynamicsNode)
    ros.spin_until(lambda: info(node).success)
    assert len(info(node).joint_names) == 1
    publisher.publish(String(data=TWO_LINK))
    ros.spin_until(lambda: len(info(node).joint_names) == 2)


def test_a_description_that_cannot_be_used_keeps_the_one_before_and_is_told_once(
    ros: Ros, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Text that names a file is not read as one; one robot is too large for the memory."""
    node = ros.add(DynamicsNode, robot_description=TWO_LINK)
    for broken in ("<robot name='x'/>", str(models.SCENES / "pendulum.urdf")):
        for _ in range(3):
            node.on_robot_description(String(data=broken))
        assert len(info(node).joint_names) == 2
        said = capfd.readouterr().err
        assert said.count("robot_description refused, the previous one is kept") == 1
    monkeypatch.setattr(dynamics_node, "Dynamics", Mock(side_effect=MemoryError))
    node.on_robot_description(String(data=PENDULUM))
    assert "not enough memory to build it" in capfd.readouterr().err
    assert len(info(node).joint_names) == 2


class Slow:
    """Builds the first arm when it may go on, and notes how many joints all have."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.begun, self.go_on, self.joints = threading.Event(), threading.Event(), list[int]()
        self._build = dynamics_node.Dynamics
        monkeypatch.setattr(dynamics_node, "Dynamics", self)

    def __call__(self, scene: Any) -> Any:
        if not self.begun.is_set():
            self.begun.set()
            assert self.go_on.wait(20.0)
        made = self._build(scene)
        self.joints.append(made.n)
        return made


def test_services_of_the_last_arm_go_on_while_another_is_built(
    ros: Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of descriptions that come meanwhile, the newest is built next, and the others never."""
    node = ros.add(DynamicsNode, robot_description=TWO_LINK)
    publisher = ros.peer.create_publisher(String, "/robot_description", LATCHED)
    task = ros.peer.create_client(TASK_SPACE.type, "/dynamics/task_space")
    assert task.wait_for_service(10.0)
    slow = Slow(monkeypatch)
    publisher.publish(String(data=chain(3)))
    ros.spin_until(slow.begun.is_set)
    for text in (chain(4), chain(5), PENDULUM):
        publisher.publish(String(data=text))
        ros.spin_until(lambda text=text: node._described and node._described[0].data == text)
    asked = task.call_async(TASK_SPACE.type.Request(frame="forearm", position=[0.1, 0.2]))
    ros.spin_until(asked.done)
    assert asked.result().success and len(asked.result().joint_names) == 2
    assert not slow.joints
    slow.go_on.set()
    ros.spin_until(lambda: len(info(node).joint_names) == 1)
    assert slow.joints == [3, 1]


def test_a_parameter_replaces_a_description_that_came_before_it(
    ros: Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Although that is still being built."""
    node = ros.add(DynamicsNode)
    publisher = ros.peer.create_publisher(String, "/robot_description", LATCHED)
    slow = Slow(monkeypatch)
    publisher.publish(String(data=chain(3)))
    ros.spin_until(slow.begun.is_set)
    threading.Timer(0.1, slow.go_on.set).start()
    assert node.set_parameters([Parameter("robot_description", value=PENDULUM)])[0].successful
    ros.spin_until(lambda: len(slow.joints) == 2)
    assert slow.joints == [3, 1]
    assert len(info(node).joint_names) == 1


def test_description_as_a_parameter_may_change(ros: Ros) -> None:
    node = ros.add(DynamicsNode, robot_description=TWO_LINK)
    broken = Parameter("robot_description", value="<robot")
    assert not node.set_parameters([broken])[0].successful
    assert len(info(node).joint_names) == 2
    publisher = ros.peer.create_publisher(String, "/robot_description", LATCHED)
    for _ in range(2):  # also if it is the same as before a description came
        assert node.set_parameters([Parameter("robot_description", value=PENDULUM)])[0].successful
        assert len(info(node).joint_names) == 1
        publisher.publish(String(data=chain(3)))
        ros.spin_until(lambda: len(info(node).joint_names) == 3)


def chain(joints: int) -> str:
    """A description of as many joints that move."""
    link = '<link name="l{0}"/><joint name="j{0}" type="continuous"><parent link="l{0}"/>'
    links = "".join(f'{link.format(i)}<child link="l{i + 1}"/></joint>' for i in range(joints))
    return f'<robot name="chain">{links}<link name="l{joints}"/></robot>'


def test_with_a_scene_no_description_is_taken(ros: Ros, capfd: pytest.CaptureFixture[str]) -> None:
    scene = str(models.SCENES / "two_link.yaml")
    node = ros.add(DynamicsNode, scene=scene, robot_description=PENDULUM)
    assert len(info(node).joint_names) == 2
    assert not ros.peer.count_subscribers("/robot_description")
    assert "'robot_description' is not used" in capfd.readouterr().err
    (answer,) = node.set_parameters([Parameter("robot_description", value=TWO_LINK)])
    assert not answer.successful
    assert "cannot be set: the node has its arm from a scene" in answer.reason
    assert len(info(node).joint_names) == 2
