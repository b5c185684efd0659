# SPDX-License-Identifier: Apache-2.0
"""Whatever messages arrive, the nodes continue, and nothing moves that should not."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from arm_msgs.srv import SetFriction, SetJointState, SetPayload, Step
from bent_messages import bent
from geometry_msgs.msg import PoseStamped
from harness import Ros
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from sim_by_hand import NAMES, by_hand, next_command
from std_msgs.msg import Float64MultiArray, Header

import models
from arm_dynamics import load_scene
from arm_dynamics.ros import ControllerNode, DynamicsNode
from arm_dynamics.ros.interfaces import (
    INVERSE_DYNAMICS,
    RESET,
    SET_FRICTION,
    SET_JOINT_STATE,
    SET_PAYLOAD,
    STEP,
    TASK_SPACE,
)
from arm_sim.ros import SimNode
from arm_sim.servo import JointCommand

pytestmark = pytest.mark.ros

TAU = [1.5, -0.5]
bounded = settings(
    max_examples=40, deadline=None, derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)  # fmt: skip
numbers = st.floats(width=64)  # infinities and NaN among them
few = st.lists(numbers, max_size=5)
names = st.lists(st.sampled_from([*NAMES, "knee", "", "x" * 200, "ä"]), max_size=4)
orders = st.permutations(NAMES) | st.just([]) | names  # of joints, as they may be given, or not
points = st.lists(st.floats(-10.0, 10.0), min_size=2, max_size=2) | few  # one, or whatever


@pytest.fixture(scope="module")
def nodes() -> Iterator[tuple[SimNode, ControllerNode]]:
    """Nodes for the whole module: what one example leaves behind meets the next."""
    ros = Ros()
    load = {"frame": "tip", "mass": 0.1, "com": [0.0] * 3, "inertia": [0.0] * 6}
    scene = load_scene(
        {**models.scene("two_link").model_dump(exclude_unset=True),
         "tunable": ["payload", "friction"], "payloads": [load]}
    )  # fmt: skip
    yield by_hand(ros, scene, command_timeout=0.0), ros.add(ControllerNode, scene)
    ros.close()


def command(**fields: Any) -> bytes:
    return serialize_message(JointState(**{"name": NAMES, "effort": TAU, **fields}))


def damaged(seed: int) -> bytes:
    return bent(np.random.default_rng(seed), command())


def assert_alive(sim: SimNode) -> None:
    """The sim still takes a good command and moves by it, finitely."""
    sim.requests.answer(RESET)
    sim.engine.pause(False)
    sim.inputs.on_joint_commands(command())
    sim.tick()
    np.testing.assert_array_equal(sim.simulator.effort, TAU)
    assert sim.simulator.arm.step_count == 1
    assert np.isfinite(sim.simulator.state.q).all()


def assert_passed_over_or_finite(nodes: tuple[SimNode, ControllerNode], raw: bytes) -> None:
    """Neither node takes numbers from a message that are not finite."""
    sim, controller = nodes
    sim.inputs.on_joint_commands(raw)
    acts = next_command(sim.engine.commands, np.zeros(2))
    assert isinstance(acts, JointCommand) or np.isfinite(acts).all()
    answer = controller.on_joint_states(raw)
    assert answer is None or np.isfinite(deserialize_message(answer, JointState).effort).all()
    assert_alive(sim)


@bounded
@given(st.binary(max_size=300) | st.builds(damaged, st.integers(0, 2**32 - 1)))
def test_any_bytes(nodes: tuple[SimNode, ControllerNode], raw: bytes) -> None:
    assert_passed_over_or_finite(nodes, raw)


@bounded
@given(names, few, few, few)
def test_joint_states_of_any_content(
    nodes: tuple[SimNode, ControllerNode], name: list[str], position: Any, velocity: Any,
    effort: Any,
) -> None:  # fmt: skip
    message = JointState(name=name, position=position, velocity=velocity, effort=effort)
    assert_passed_over_or_finite(nodes, serialize_message(message))


def test_giant_messages(nodes: tuple[SimNode, ControllerNode]) -> None:
    (sim, controller), size = nodes, 10**6
    sim.inputs.on_commands(Float64MultiArray(data=[0.0] * size))
    sim.inputs.on_joint_commands(command(effort=[0.0] * size))
    sim.inputs.on_joint_commands(command(name=["x"] * (size // 10), effort=[]))
    controller.on_joint_states(command(position=[0.0] * size))
    assert_alive(sim)


def finite(*vectors: Any) -> bool:
    return all(np.isfinite(vector).all() for vector in vectors)


@bounded
@given(orders, points, points, st.one_of(st.floats(0.0, 10.0), numbers), st.integers(0, 12_000))
def test_orders_of_any_content(
    nodes: tuple[SimNode, ControllerNode], name: list[str], position: Any, velocity: Any,
    mass: float, count: int,
) -> None:  # fmt: skip
    """What makes sense is done, and the rest is refused and changes nothing."""
    sim, requests, simulator = nodes[0], nodes[0].requests, nodes[0].simulator
    joints = [NAMES.index(joint) for joint in name or NAMES if joint in NAMES]
    named = len(joints) == len(name or NAMES) == len(set(joints))
    q, v = simulator.state.q.copy(), simulator.state.v.copy()
    answer = requests.answer(
        SET_JOINT_STATE,
        SetJointState.Request(joint_names=name, position=position, velocity=velocity),
    )
    lengths = {len(position), len(velocity)} <= {0, len(joints)}
    sensible = named and lengths and finite(position, velocity)
    sensible = sensible and max(map(abs, velocity), default=0.0) <= 1000.0  # 1 rad in a tick
    if sensible and position:
        place = simulator.state.q.copy()
        place[joints] = position
        sensible = not simulator.model.stops.refusal(place, simulator.joint_names)
    assert answer.success == sensible, answer.message
    if answer.success:
        q[joints] = position or q[joints]
        v[joints] = velocity or 0.0
    np.testing.assert_array_equal([simulator.state.q, simulator.state.v], [q, v])

    before = simulator.arm.parameters
    six = (velocity * 6 + [0.0] * 6)[:6]
    load = SetPayload.Request(index=count % 3, mass=mass, com=six[:3], inertia=six)
    answer = requests.answer(SET_PAYLOAD, load)
    possible = load.index == 0 and mass >= 0.0 and finite([mass], six)
    assert possible if answer.success else not (possible and mass < 10.0 and not any(six))
    if answer.success:
        assert simulator.dynamics.model.scene.payloads[0].mass == mass
    else:
        np.testing.assert_array_equal(simulator.arm.parameters, before)

    before = simulator.dynamics.model.viscous.copy()
    rub = SetFriction.Request(joint_names=name, viscous=position)
    answer = requests.answer(SET_FRICTION, rub)
    possible = named and len(position) == len(joints) and finite(position)
    assert answer.success == (possible and min(position) >= 0.0), answer.message
    if answer.success:
        before[joints] = position
    np.testing.assert_array_equal(simulator.dynamics.model.viscous, before)

    count = count if count > 10_000 else count % 20
    was = simulator.arm.step_count
    answer = requests.answer(STEP, Step.Request(steps=count))
    if answer.success:
        assert 1 <= count <= 10_000
        assert simulator.arm.step_count == was + count
    else:
        assert count in (0, *range(10_001, 12_001)) or sim.engine.failure
    assert np.isfinite(simulator.state.q).all()
    requests.answer(SET_PAYLOAD, SetPayload.Request(mass=0.1))
    requests.answer(SET_FRICTION, SetFriction.Request(viscous=[0.0, 0.0]))
    assert_alive(sim)


RUDE = "\n\u202eall is well\x1b[31m" + "x" * 100_000


def is_safe(text: str) -> None:
    """Text of a caller is repeated clipped and on one line."""
    assert text
    assert text.isprintable()
    assert len(text) < 2500


def test_text_in_questions_to_the_dynamics_node(ros: Ros) -> None:
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


def test_text_in_parameters_and_goals_of_the_controller(ros: Ros) -> None:
    node = ros.add(ControllerNode, models.scene("two_link"))
    for name in ("controller", "task_frame"):
        (result,) = node.set_parameters([Parameter(name, value=RUDE)])
        assert not result.successful
        is_safe(result.reason)
    goal = PoseStamped()
    goal.header.frame_id, goal.pose.orientation.w = RUDE, 1.0
    node.on_cartesian_goal(goal)
    ros.spin_until(lambda: not node.busy)
    is_safe(node.goals.outcome)


def test_text_in_sources_of_commands_in_the_diagnostics(ros: Ros) -> None:
    node = by_hand(ros)
    for _ in range(20):
        node.inputs.on_joint_commands(command(header=Header(frame_id=RUDE)))
        node.tick()
    node.inputs.on_joint_commands(command())
    is_safe(node.engine.arbiter.last_refusal)
    for finding in node.diagnostics():
        for value in finding.values.values():
            assert str(value).isprintable()
            assert len(str(value)) < 2500
