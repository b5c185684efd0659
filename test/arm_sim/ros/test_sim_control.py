# SPDX-License-Identifier: Apache-2.0
"""Pushes, payload, friction, the first command and diagnostics, on a sim node ticked by hand."""

from ctypes import byref
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from arm_msgs.srv import SetFriction, SetPayload
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import WrenchStamped
from harness import Ros
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from sim_by_hand import NAMES, TAU, by_hand, next_command, pushed, ticks
from std_msgs.msg import Float64MultiArray

import models
from arm_dynamics import load_scene
from arm_dynamics.ros.interfaces import RESET_COUNTERS, SET_FRICTION, SET_PAYLOAD
from arm_sim import Simulator
from arm_sim.ros import SimNode
from arm_sim.ros.commands.arbiter import STREAM
from arm_sim.ros.node_library import library
from arm_sim.ros.timing.histogram import Percentiles
from arm_sim.ros.timing.realtime_loop import LoopReport

pytestmark = pytest.mark.ros


def finding(node: SimNode, part: str) -> DiagnosticStatus:
    return {f.part: f for f in node.diagnostics()}[part].message(node)


def values(found: DiagnosticStatus) -> dict[str, str]:
    return {pair.key: pair.value for pair in found.values}


def command(source: str = "", effort: Any = TAU) -> bytes:
    message = JointState(name=NAMES, effort=effort)
    message.header.frame_id = source
    return serialize_message(message)


def test_a_wrench_comes_over_its_topic_and_bad_ones_are_passed_over(
    ros: Ros, capfd: pytest.CaptureFixture[str]
) -> None:
    node = by_hand(ros, wrench_timeout=10.0)
    refused = ("paw", 1.0, "frame 'paw'"), ("", 1.0, "frame ''"), ("tip", np.nan, "= nan")
    for count, (frame, force, said) in enumerate(refused, 1):
        node.inputs.on_wrench(pushed(frame, force, *[0.0] * 5))
        assert said in capfd.readouterr().err
        assert node.engine.wrenches.active == ()
        assert node.inputs.refused_wrenches == count
    publisher = ros.publisher(WrenchStamped, "/sim/wrench")
    publisher.publish(pushed("tip", 1.0, 0.0, 1.0, 0.0, 0.0, 0.0))
    ros.spin_until(lambda: node.engine.wrenches.active)


LOAD = {"frame": "tip", "mass": 0.5, "com": [0.0] * 3, "inertia": [0.0] * 6}


def scene(**more: Any) -> Any:
    base = models.scene("two_link").model_dump(exclude_unset=True)
    return load_scene({**base, "payloads": [LOAD], **more})


def test_payload_and_friction_are_set_by_services(ros: Ros) -> None:
    node = by_hand(ros, scene(tunable=["payload", "friction"]), integrator="rk4")
    inertia = [0.01, 0.0, 0.0, 0.01, 0.0, 0.01]
    heavy = {"mass": 2.0, "com": [0.1, 0.0, 0.0], "inertia": inertia}
    load = SetPayload.Request(index=0, **heavy)
    rub = SetFriction.Request(joint_names=["elbow"], viscous=[2.0])
    for service, request in (SET_PAYLOAD, load), (SET_FRICTION, rub):
        answer = node.requests.answer(service, request)
        assert answer.success, answer.message
    joints = models.scene("two_link").model_dump(exclude_unset=True)["joints"]
    joints["elbow"]["friction"] = {"viscous": 2.0}
    sim = Simulator(scene(payloads=[{**LOAD, **heavy}], joints=joints), integrator="rk4")
    for _ in range(100):
        node.tick()
        sim.step([0.0, 0.0])
    np.testing.assert_allclose(node.simulator.state.q, sim.state.q, rtol=0.0, atol=1e-10)
    node.engine.configure(0.0, "gravity")  # which is the new one
    carried = next_command(node.engine.commands, sim.state.q)
    np.testing.assert_allclose(carried, sim.dynamics.gravity(sim.state.q), rtol=1e-12)


def test_what_a_node_does_is_told_in_numbers(ros: Ros) -> None:
    node = by_hand(ros, command_timeout=0.005, wrench_timeout=1.0)
    node.inputs.on_joint_commands(command("leader"))
    trip = node.engine.round_trip
    trip.reset()
    for state, arrival in (7, 3_000_000), (8, 5_000_000):  # 3 and 5 ms after they were sent
        library().trip_register_state(byref(trip), state)
        sent = trip._times[(trip.next - 1) % 256]
        assert trip.register_answer(state, sent + arrival)
    node.inputs.on_wrench(pushed("tip", 1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    node.inputs.on_wrench(pushed("paw", *[1.0] * 6))
    ticks(node, 3)
    assert values(finding(node, "commands")) == {
        "age [s]": "0.003", "stale": "false", "stale count": "0", "extended": "0",
        "policy": "zero", "held": "no", "passed over": "0", "sources": "leader",
        "publishers": "0", "oldest [s]": "0", "answers": "2", "round trip p50 [s]": "0.003",
        "round trip p99 [s]": "0.005", "pushed frames": "tip", "wrenches passed over": "1",
    }  # fmt: skip
    ticks(node, 4)
    told = values(finding(node, "commands"))
    assert (told["stale"], told["stale count"]) == ("true", "1")
    node.engine.pause(True)
    told = values(finding(node, "simulation"))
    assert told["time [s]"] == "0.007" and told["paused"] == "true" and told["diverged"] == "false"


def test_what_ticks_suffer_shows_once(ros: Ros, monkeypatch: pytest.MonkeyPatch) -> None:
    node = by_hand(ros)
    report = LoopReport(2000, 4.0, 3, 1, Percentiles(2000, 1e-5, 2e-4, 3e-3))
    monkeypatch.setattr(node.loop, "report", lambda: report)
    state = replace(node.simulator.state, error=2.5e-4, time_stepped=4)
    node.engine.simulator = SimpleNamespace(
        state=state, stop_torque=np.array([0.0, -2.5]), joint_names=NAMES,
        choice=node.simulator.choice, dt=node.simulator.dt,
    )  # fmt: skip
    found = {finding.part: finding.message(node) for finding in node.diagnostics()}
    late, first_order = found["loop"], found["simulation"]
    assert late.level == first_order.level == DiagnosticStatus.WARN
    assert late.message == "3 time steps began after the next one was due; 1 time step dropped"
    assert values(late)["rate [Hz]"] == "500" and values(late)["lateness p99 [s]"] == "0.0002"
    assert first_order.message == "4 time steps of first order: too many events"
    told = values(first_order)
    assert (told["at stops"], told["error estimate"]) == ("elbow -2.5", "0.00025")
    assert finding(node, "loop").message == finding(node, "simulation").message == "ok"


def test_diagnostics_are_published_while_somebody_listens(ros: Ros) -> None:
    """Only then the energy account is kept, which shows ticks that are too coarse."""
    node = by_hand(ros, integrator="euler", energy_period=0.005)
    ticks(node, 5)
    assert node.engine.energy.read() is None
    heard = list[DiagnosticArray]()
    listener = ros.peer.create_subscription(DiagnosticArray, "/diagnostics", heard.append, 10)
    ros.spin_until(lambda: node.diagnosis.has_subscribers)
    ticks(node, 5)
    node.engine.change(lambda: node.simulator.set_state([0.5, -0.3], [3.0, -4.0]))
    ticks(node, 300)
    node.diagnosis.publish()
    ros.spin_until(lambda: heard)
    status = {s.name: s for s in heard[-1].status}
    assert set(status) == {"sim: loop", "sim: commands", "sim: simulation"}
    assert values(status["sim: loop"])["executor"] == "SingleThreadedExecutor"
    found, state = status["sim: simulation"], node.simulator.state
    energy = sum(node.simulator.dynamics.energy(state.q, state.v))
    assert float(values(found)["energy [J]"]) == pytest.approx(energy, rel=1e-5)
    assert found.level == DiagnosticStatus.WARN
    assert f"off by {node.engine.energy.error:.2g} of the energy that moved" in found.message
    ros.peer.destroy_subscription(listener)
    ros.spin_until(lambda: not node.diagnosis.has_subscribers)
    ticks(node, 5)
    assert node.engine.energy.read() is None


def test_several_publishers_show_unless_each_leads_joints_of_its_own(ros: Ros) -> None:
    node = by_hand(ros)
    publishers = [ros.publisher(JointState, "/joint_commands")]
    ros.spin_until(lambda: node.count_publishers("/joint_commands") == 1)
    assert finding(node, "commands").level == DiagnosticStatus.OK
    publishers.append(ros.publisher(JointState, "/joint_commands"))
    ros.spin_until(lambda: node.count_publishers("/joint_commands") == 2)
    found = finding(node, "commands")
    assert found.level == DiagnosticStatus.WARN
    assert found.message == "2 publishers on /joint_commands"
    told = []
    for source, joint in (("left", 0), ("right", 1)):
        message = JointState(name=[NAMES[joint]], effort=[1.0])
        message.header.frame_id = source
        node.inputs.on_joint_commands(serialize_message(message))
        told.append(finding(node, "commands").level)
    assert told == [DiagnosticStatus.WARN, DiagnosticStatus.OK]


def test_stale_commands_show(ros: Ros) -> None:
    node = by_hand(ros, command_timeout=0.005)
    node.inputs.on_commands(Float64MultiArray(data=TAU))
    ticks(node, 10)
    found = finding(node, "commands")
    assert found.level == DiagnosticStatus.WARN
    assert "fallback (stale_policy: zero)" in found.message
    node.inputs.on_commands(Float64MultiArray(data=TAU))
    ticks(node, 2)
    assert finding(node, "commands").level == DiagnosticStatus.OK
    ticks(node, 10)
    node.inputs.on_commands(Float64MultiArray(data=TAU))
    ticks(node, 2)
    found = finding(node, "commands")
    assert (found.level, found.message) == (
        DiagnosticStatus.WARN, "commands stopped, and have resumed",
    )  # fmt: skip
    assert finding(node, "commands").level == DiagnosticStatus.OK


def test_two_controllers_show_and_the_first_one_stays_until_counters_are_reset(
    ros: Ros, capfd: pytest.CaptureFixture[str]
) -> None:
    node = by_hand(ros, command_timeout=0.002)
    for _ in range(STREAM):
        node.inputs.on_joint_commands(command("/controller:1"))
        node.tick()
    node.inputs.on_joint_commands(command("/controller:2", effort=[9.0, 9.0]))
    node.inputs.on_wrench(pushed("paw", *[1.0] * 6))
    node.tick()
    np.testing.assert_array_equal(node.simulator.effort, TAU)
    found = finding(node, "commands")
    assert found.level == DiagnosticStatus.ERROR
    assert "two controllers: '/controller:2' is refused" in found.message
    assert "1 command ignored" in found.message
    assert "two controllers" in capfd.readouterr().err
    ticks(node, 999)
    assert finding(node, "commands").level == DiagnosticStatus.ERROR  # for a second
    ticks(node, 1)
    assert finding(node, "commands").level != DiagnosticStatus.ERROR
    counts = lambda: [  # noqa: E731
        node.inputs.refused, node.inputs.refused_wrenches, node.engine.arbiter.refused,
        node.engine.commands.stale_count, node.engine.round_trip.histogram.percentiles().count,
    ]  # fmt: skip
    assert counts() == [1, 1, 1, 1, 1]
    assert node.requests.answer(RESET_COUNTERS).success
    assert counts() == [0, 0, 0, 0, 0]
    assert "ignored" not in finding(node, "commands").message
    node.inputs.on_joint_commands(command(effort=[np.nan, 0.0]))
    assert "1 command ignored" in finding(node, "commands").message
