# SPDX-License-Identifier: Apache-2.0
"""Whatever comes in, the nodes go on, and nothing moves that should not."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from arm_msgs.srv import (
    DynamicsTerms,
    ForwardDynamics,
    InverseDynamics,
    SetFriction,
    SetJointState,
    SetPayload,
    Step,
    TaskSpace,
)
from geometry_msgs.msg import WrenchStamped
from harness import Ros
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

import models
from arm_dynamics import load_scene
from arm_dynamics.ros.controller_node import ControllerNode
from arm_dynamics.ros.dynamics_node import DynamicsNode
from arm_sim.ros.sim_node import SimNode

pytestmark = pytest.mark.ros

NAMES = list(models.dynamics("two_link").joint_names)
TAU = [1.5, -0.5]
bounded = settings(
    max_examples=60, deadline=None, derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)  # fmt: skip
numbers = st.floats(width=64)  # infinities and NaN among them
few = st.lists(numbers, max_size=5)
names = st.lists(st.sampled_from([*NAMES, "knee", "", "x" * 200, "ä"]), max_size=4)


class Nodes:
    """All nodes, driven by hand, each built once."""

    def __init__(self, ros: Ros) -> None:
        scene = load_scene(
            {**models.scene("two_link").model_dump(exclude_unset=True),
             "tunable": ["payload", "friction"],
             "payloads": [{"frame": "tip", "mass": 0.1, "com": [0.0] * 3, "inertia": [0.0] * 6}]}
        )  # fmt: skip
        self.sim: SimNode = ros.add(SimNode, scene, realtime=False, command_timeout=0.0)
        self.controller: ControllerNode = ros.add(ControllerNode, scene)
        self.dynamics: DynamicsNode = ros.add(DynamicsNode, scene)


@pytest.fixture(scope="module")
def nodes() -> Iterator[Nodes]:
    """Nodes for the whole module: what one example leaves behind meets the next."""
    ros = Ros()
    yield Nodes(ros)
    ros.close()


def state(stamp: int = 0, **fields: Any) -> bytes:
    given_fields = {"name": NAMES, "position": [0.1, 0.2], "velocity": [0.0, 0.0], **fields}
    message = JointState(**given_fields)
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
    return serialize_message(message)


def command(**fields: Any) -> bytes:
    return serialize_message(JointState(**{"name": NAMES, "effort": TAU, **fields}))


def alive(nodes: Nodes) -> None:
    """The sim still takes a good command and moves by it, finitely."""
    sim = nodes.sim
    sim.requests.on_reset(None, Step.Response())
    sim.requests.pause(False)
    sim.on_joint_commands(command())
    sim.tick()
    np.testing.assert_array_equal(sim.simulator.effort, TAU)
    assert sim.simulator.step_count == 1
    assert np.isfinite(sim.simulator.state.q).all()


# --- bytes that are no message -----------------------------------------------------------------


@bounded
@given(st.binary(max_size=300))
def test_any_bytes(nodes: Nodes, raw: bytes) -> None:
    nodes.sim.on_joint_commands(command())
    nodes.sim.on_joint_commands(raw)
    np.testing.assert_array_equal(nodes.sim.commands.held(np.zeros(2)), TAU)
    nodes.controller.on_joint_states(raw)
    alive(nodes)


@bounded
@given(st.data())
def test_damaged_messages(nodes: Nodes, data: st.DataObject) -> None:
    raw = bytearray(command(effort=[3.0, 4.0]))
    for _ in range(data.draw(st.integers(1, 4))):
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(raw)))
    nodes.sim.on_joint_commands(bytes(raw))
    nodes.sim.on_joint_commands(bytes(raw[:cut]))
    nodes.controller.on_joint_states(bytes(raw))
    assert np.isfinite(nodes.sim.commands.held(np.zeros(2))).all()
    alive(nodes)


def test_a_length_that_is_not_there_is_not_allocated(nodes: Nodes) -> None:
    raw = bytearray(command())
    at = raw.index(struct.pack("<I", 2))  # number of names
    for length in (2**31, 2**32 - 1, 10**8):
        raw[at : at + 4] = struct.pack("<I", length)
        nodes.sim.on_joint_commands(bytes(raw))
    alive(nodes)


# --- messages that make no sense ---------------------------------------------------------------


@bounded
@given(names, few, few, few)
def test_joint_states_of_any_content(
    nodes: Nodes, name: list[str], position: Any, velocity: Any, effort: Any
) -> None:
    raw = serialize_message(
        JointState(name=name, position=position, velocity=velocity, effort=effort)
    )
    nodes.sim.on_joint_commands(raw)
    assert np.isfinite(nodes.sim.commands.held(np.zeros(2))).all()
    answer = nodes.controller.on_joint_states(raw)
    if answer is not None:
        assert np.isfinite(deserialize_message(answer, JointState).effort).all()
    alive(nodes)


@bounded
@given(names, st.lists(st.tuples(few, few, few, st.integers(-(2**31), 2**31 - 1)), max_size=4))
def test_trajectories_of_any_content(nodes: Nodes, name: list[str], points: Any) -> None:
    controller = nodes.controller
    controller.on_joint_states(state())
    message = JointTrajectory(joint_names=name)
    for position, velocity, acceleration, seconds in points:
        point = JointTrajectoryPoint(positions=position, velocities=velocity)
        point.accelerations = acceleration
        point.time_from_start.sec = seconds
        message.points.append(point)
    controller.on_joint_trajectory(message)
    answer = controller.on_joint_states(state(1_000_000))
    assert answer is not None
    assert np.isfinite(deserialize_message(answer, JointState).effort).all()


@bounded
@given(st.sampled_from(["tip", "", "paw", "elbow", "x" * 1000]), st.lists(numbers, min_size=6,
                                                                        max_size=6))  # fmt: skip
def test_wrenches_of_any_content(nodes: Nodes, frame: str, values: list[float]) -> None:
    message = WrenchStamped()
    message.header.frame_id = frame
    force, torque = message.wrench.force, message.wrench.torque
    force.x, force.y, force.z, torque.x, torque.y, torque.z = values
    nodes.sim.push.on_wrench(message)
    nodes.sim.tick()
    assert np.isfinite(nodes.sim.simulator.state.q).all()
    alive(nodes)


@pytest.mark.parametrize("size", [10**5, 3 * 10**6])
def test_giant_messages(nodes: Nodes, size: int) -> None:
    nodes.sim.on_commands(Float64MultiArray(data=[0.0] * size))
    nodes.sim.on_joint_commands(command(effort=[0.0] * size))
    nodes.sim.on_joint_commands(command(name=["x"] * (size // 10), effort=[]))
    nodes.controller.on_joint_states(state(position=[0.0] * size))
    alive(nodes)


@pytest.mark.parametrize("text", ["", "<", "<robot/>", "x" * 10**6, "/etc/passwd", "<a>" * 1000])
def test_descriptions_of_any_content_leave_the_arm(nodes: Nodes, text: str) -> None:
    before = nodes.dynamics.dynamics
    nodes.dynamics.on_robot_description(String(data=text))
    assert nodes.dynamics.dynamics is before


# --- requests ----------------------------------------------------------------------------------


@bounded
@given(names, few, few, few, st.integers(0, 255))
def test_requests_of_any_content(
    nodes: Nodes, name: list[str], position: Any, velocity: Any, other: Any, terms: int
) -> None:
    common = {"joint_names": name, "position": position, "velocity": velocity}
    node = nodes.dynamics
    for answer, field in (
        (node.on_inverse_dynamics(
            InverseDynamics.Request(**common, acceleration=other, terms=terms),
            InverseDynamics.Response()), "effort"),
        (node.on_forward_dynamics(
            ForwardDynamics.Request(**common, effort=other), ForwardDynamics.Response()),
         "acceleration"),
        (node.on_dynamics_terms(DynamicsTerms.Request(**common), DynamicsTerms.Response()),
         "mass_matrix"),
        (node.on_task_space(
            TaskSpace.Request(**common, frame="tip", direction=other[:2], axes=name[:2]),
            TaskSpace.Response()), "jacobian"),
    ):  # fmt: skip
        assert answer.success or answer.message
        assert "unexpected" not in answer.message
        assert np.isfinite(getattr(answer, field)).all()


@bounded
@given(names, few, few, numbers, st.integers(0, 2**32 - 1))
def test_orders_of_any_content(
    nodes: Nodes, name: list[str], position: Any, velocity: Any, mass: float, count: int
) -> None:
    requests = nodes.sim.requests
    six = (velocity * 6 + [0.0] * 6)[:6]
    for answer in (
        requests.on_set_joint_state(
            SetJointState.Request(joint_names=name, position=position, velocity=velocity),
            SetJointState.Response()),
        requests.on_set_payload(
            SetPayload.Request(index=count % 3, mass=mass, com=six[:3], inertia=six),
            SetPayload.Response()),
        requests.on_set_friction(
            SetFriction.Request(joint_names=name, viscous=position), SetFriction.Response()),
        requests.on_step(Step.Request(steps=count if count > 10_000 else count % 20),
                         Step.Response()),
    ):  # fmt: skip
        assert answer.success or answer.message
        assert "unexpected" not in answer.message
    assert np.isfinite(nodes.sim.simulator.state.q).all()
    requests.on_set_payload(SetPayload.Request(mass=0.1), SetPayload.Response())
    requests.on_set_friction(SetFriction.Request(viscous=[0.0, 0.0]), SetFriction.Response())
    alive(nodes)


# --- time --------------------------------------------------------------------------------------


def effort_after(controller: ControllerNode, jump: int) -> np.ndarray:
    """What is commanded when time jumps in the middle of a motion, the arm standing still."""
    point = JointTrajectoryPoint(positions=[1.0, 1.0])
    point.time_from_start.sec = 10
    controller.on_joint_states(state(20 * 10**9))
    controller.on_joint_states(state(0))
    controller.on_joint_trajectory(JointTrajectory(joint_names=NAMES, points=[point]))
    controller.on_joint_states(state(1_000_000))
    answer = controller.on_joint_states(state(max(0, 1_000_000 + jump)))
    assert answer is not None
    return np.array(deserialize_message(answer, JointState).effort)


@pytest.mark.parametrize("jump", [-1_000_000, 5 * 10**9, 2 * 10**18 // 1000])
def test_when_time_jumps_the_arm_is_held(nodes: Nodes, jump: int) -> None:
    still = models.dynamics("two_link").gravity([0.1, 0.2])
    held = effort_after(nodes.controller, jump)
    loaded = nodes.controller._dynamics.gravity([0.1, 0.2])
    assert np.abs(loaded - still).max() < 1.0
    np.testing.assert_allclose(held, loaded, atol=1e-9)


def test_a_small_gap_is_no_jump(nodes: Nodes) -> None:
    held = nodes.controller._dynamics.gravity([0.1, 0.2])
    assert np.abs(effort_after(nodes.controller, 500_000_000) - held).max() > 1e-3
