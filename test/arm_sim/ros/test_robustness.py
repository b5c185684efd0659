# SPDX-License-Identifier: Apache-2.0
"""Whatever messages arrive, the nodes continue, and nothing moves that should not."""

import struct
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from arm_msgs.srv import SetFriction, SetJointState, SetPayload, Step
from harness import Ros
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from pushes import pushed
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from sim_by_hand import next_command
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

import models
from arm_dynamics import InvalidInput, load_scene
from arm_dynamics.ros import ControllerNode, DynamicsNode
from arm_dynamics.ros.interfaces import (
    FORWARD_DYNAMICS,
    INVERSE_DYNAMICS,
    RESET,
    SET_FRICTION,
    SET_JOINT_STATE,
    SET_PAYLOAD,
    STEP,
)
from arm_sim.ros import SimNode

pytestmark = pytest.mark.ros

NAMES = list(models.dynamics("two_link").joint_names)
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
    sim.requests.answer(RESET)
    sim.engine.pause(False)
    sim.inputs.on_joint_commands(command())
    sim.tick()
    np.testing.assert_array_equal(sim.simulator.effort, TAU)
    assert sim.simulator.arm.step_count == 1
    assert np.isfinite(sim.simulator.state.q).all()


@bounded
@given(st.binary(max_size=300))
def test_any_bytes(nodes: Nodes, raw: bytes) -> None:
    nodes.sim.inputs.on_joint_commands(command())
    nodes.sim.inputs.on_joint_commands(raw)
    np.testing.assert_array_equal(next_command(nodes.sim.engine.commands, np.zeros(2)), TAU)
    nodes.controller.on_joint_states(raw)
    alive(nodes)


@bounded
@given(st.data())
def test_damaged_messages(nodes: Nodes, data: st.DataObject) -> None:
    raw = bytearray(command(effort=[3.0, 4.0]))
    for _ in range(data.draw(st.integers(1, 4))):
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(raw)))
    nodes.sim.inputs.on_joint_commands(bytes(raw))
    nodes.sim.inputs.on_joint_commands(bytes(raw[:cut]))
    nodes.controller.on_joint_states(bytes(raw))
    assert np.isfinite(next_command(nodes.sim.engine.commands, np.zeros(2))).all()
    alive(nodes)


def test_a_length_that_is_not_there_is_not_allocated(nodes: Nodes) -> None:
    raw = bytearray(command())
    at = raw.index(struct.pack("<I", 2))  # number of names
    for length in (2**31, 2**32 - 1, 10**8):
        raw[at : at + 4] = struct.pack("<I", length)
        nodes.sim.inputs.on_joint_commands(bytes(raw))
    alive(nodes)


@bounded
@given(names, few, few, few)
def test_joint_states_of_any_content(
    nodes: Nodes, name: list[str], position: Any, velocity: Any, effort: Any
) -> None:
    raw = serialize_message(
        JointState(name=name, position=position, velocity=velocity, effort=effort)
    )
    nodes.sim.inputs.on_joint_commands(raw)
    assert np.isfinite(next_command(nodes.sim.engine.commands, np.zeros(2))).all()
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
    nodes.sim.inputs.on_wrench(pushed(frame, *values))
    nodes.sim.tick()
    assert np.isfinite(nodes.sim.simulator.state.q).all()
    alive(nodes)


@pytest.mark.parametrize("size", [10**5, 3 * 10**6])
def test_giant_messages(nodes: Nodes, size: int) -> None:
    nodes.sim.inputs.on_commands(Float64MultiArray(data=[0.0] * size))
    nodes.sim.inputs.on_joint_commands(command(effort=[0.0] * size))
    nodes.sim.inputs.on_joint_commands(command(name=["x"] * (size // 10), effort=[]))
    nodes.controller.on_joint_states(state(position=[0.0] * size))
    alive(nodes)


def fits(name: list[str], position: Any, *others: Any) -> bool:
    """Whether joints, positions and other vectors make sense together."""
    whole = len(position) > 0 and len(position) % len(NAMES) == 0
    sizes = all(len(other) in (0, len(position)) for other in others)
    finite = all(np.isfinite(vector).all() for vector in (position, *others))
    return whole and sizes and finite and (not name or sorted(name) == sorted(NAMES))


@bounded
@example([], [0.0, 0.0], [0.0, 2.3e154], [], 2)
@given(orders, points, points, points, st.integers(0, 40))
def test_what_makes_sense_is_answered_and_all_else_refused(
    nodes: Nodes, name: list[str], position: Any, velocity: Any, other: Any, terms: int
) -> None:
    """What makes sense is answered as the core does, and the rest is refused."""
    common = {"joint_names": name, "position": position, "velocity": velocity}
    node, dynamics = nodes.dynamics, nodes.dynamics.dynamics
    for service, more, field, compute in (
        (INVERSE_DYNAMICS, {"acceleration": other, "terms": terms}, "effort",
         lambda q, v, a: dynamics.inverse(q, v, a, terms)),
        (FORWARD_DYNAMICS, {"effort": other}, "acceleration", dynamics.forward),
    ):  # fmt: skip
        request = service.type.Request(**common, **more)
        answer = node.answer(service, request, service.type.Response())
        assert "unexpected" not in answer.message
        known = service is FORWARD_DYNAMICS or terms <= 31
        if not (known and fits(name, position, velocity, other)):
            assert not answer.success
            assert answer.message and not getattr(answer, field)
            continue
        order = [NAMES.index(joint) for joint in name or NAMES]
        back = np.argsort(order)
        given_rows = (np.reshape(x or np.zeros(len(position)), (-1, 2))[:, back]
                      for x in (position, velocity, other))  # fmt: skip
        exact = np.array([np.nan])
        with np.errstate(all="ignore"), suppress(InvalidInput):  # of what overflows
            exact = np.array(compute(*given_rows))[:, order].ravel()
        assert answer.success == bool(np.isfinite(exact).all())
        np.testing.assert_array_equal(getattr(answer, field), exact if answer.success else [])


def finite(*vectors: Any) -> bool:
    return all(np.isfinite(vector).all() for vector in vectors)


@bounded
@given(orders, points, points, st.one_of(st.floats(0.0, 10.0), numbers), st.integers(0, 12_000))
def test_orders_of_any_content(
    nodes: Nodes, name: list[str], position: Any, velocity: Any, mass: float, count: int
) -> None:
    """What makes sense is done, and the rest is refused and changes nothing."""
    requests, simulator = nodes.sim.requests, nodes.sim.simulator
    joints = [NAMES.index(joint) for joint in name or NAMES if joint in NAMES]
    named = len(joints) == len(name or NAMES) == len(set(joints))
    q, v = simulator.state.q.copy(), simulator.state.v.copy()
    answer = requests.answer(
        SET_JOINT_STATE,
        SetJointState.Request(joint_names=name, position=position, velocity=velocity),
    )
    lengths = {len(position), len(velocity)} <= {0, len(joints)}
    sensible = named and lengths and finite(position, velocity)
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
        assert count in (0, *range(10_001, 12_001)) or nodes.sim.engine.failure
    assert np.isfinite(simulator.state.q).all()
    requests.answer(SET_PAYLOAD, SetPayload.Request(mass=0.1))
    requests.answer(SET_FRICTION, SetFriction.Request(viscous=[0.0, 0.0]))
    alive(nodes)
