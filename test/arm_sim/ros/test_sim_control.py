# SPDX-License-Identifier: Apache-2.0
"""Pushes, payload, friction, the first command and diagnostics, on a sim node ticked by hand."""

from ctypes import byref
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from arm_msgs.msg import Energy
from arm_msgs.srv import SetFriction, SetPayload
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import WrenchStamped
from harness import Ros
from pushes import pushed
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from sim_by_hand import NAMES, TAU, by_hand, next_command, ticks
from std_msgs.msg import Float64MultiArray

import models
from arm_dynamics import Dynamics, load_scene
from arm_dynamics.ros.interfaces import RESET, RESET_COUNTERS, SET_FRICTION, SET_PAYLOAD
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


def test_a_wrench_comes_over_its_topic_and_a_reset_ends_it(ros: Ros) -> None:
    node = by_hand(ros, wrench_timeout=10.0)
    publisher = ros.publisher(WrenchStamped, "/sim/wrench")
    publisher.publish(pushed("tip", 1.0, 0.0, 1.0, 0.0, 0.0, 0.0))
    ros.spin_until(lambda: node.engine.wrenches.active)
    ticks(node, 10)
    assert np.any(node.simulator.state.q != models.simulator("two_link").state.q)
    node.requests.answer(RESET)
    sim = models.simulator("two_link")
    for _ in range(10):
        node.tick()
        sim.step([0.0, 0.0])
    np.testing.assert_array_equal(node.simulator.state.q, sim.state.q)


def test_bad_wrenches_are_passed_over(ros: Ros, capfd: pytest.CaptureFixture[str]) -> None:
    node = by_hand(ros)
    for count, (frame, force, said) in enumerate(
        (("paw", 1.0, "frame 'paw'"), ("", 1.0, "frame ''"), ("tip", np.nan, "= nan"),
         ("tip", np.inf, "= inf")), 1
    ):  # fmt: skip
        node.inputs.on_wrench(pushed(frame, force, *[0.0] * 5))
        assert said in capfd.readouterr().err
        assert node.engine.wrenches.active == ()
        assert node.inputs.refused_wrenches == count


LOAD = {"frame": "tip", "mass": 0.5, "com": [0.0] * 3, "inertia": [0.0] * 6}


def scene(**more: Any) -> Any:
    base = models.scene("two_link").model_dump(exclude_unset=True)
    return load_scene({**base, "payloads": [LOAD], **more})


def test_payload_and_friction_are_set_by_services(ros: Ros) -> None:
    node = by_hand(ros, scene(tunable=["payload", "friction"]), integrator="rk4")
    load = SetPayload.Request(index=0, mass=2.0, com=[0.1, 0.0, 0.0], inertia=[0.01, 0, 0] * 2)
    load.inertia = [0.01, 0.0, 0.0, 0.01, 0.0, 0.01]
    answer = node.requests.answer(SET_PAYLOAD, load)
    assert answer.success, answer.message
    rub = SetFriction.Request(joint_names=["elbow"], viscous=[2.0])
    answer = node.requests.answer(SET_FRICTION, rub)
    assert answer.success, answer.message
    heavy = {**LOAD, "mass": 2.0, "com": [0.1, 0.0, 0.0], "inertia": list(load.inertia)}
    joints = {**models.scene("two_link").model_dump(exclude_unset=True).get("joints", {})}
    joints["elbow"] = {**joints.get("elbow", {}), "friction": {"viscous": 2.0}}
    sim = Simulator(scene(payloads=[heavy], joints=joints), integrator="rk4")
    for _ in range(100):
        node.tick()
        sim.step([0.0, 0.0])
    np.testing.assert_allclose(node.simulator.state.q, sim.state.q, rtol=0.0, atol=1e-10)


def test_what_a_payload_puts_in_is_accounted_for(ros: Ros) -> None:
    """And the weight that the policy ``gravity`` carries is the new one."""
    given = scene(tunable=["payload", "friction"], initial={"position": {"shoulder": 0.4}})
    node = by_hand(ros, given, integrator="rk4", stale_policy="gravity", energy_period=0.02)
    heard = ros.peer.create_subscription(Energy, "/sim/energy", lambda _: None, 10)
    engine, sim = node.engine, node.simulator
    ros.spin_until(lambda: node.count_subscribers("/sim/energy") == 1)
    engine.commands.put((2.0, 1.0))
    ticks(node, 50)
    before = engine.energy.read()
    load = SetPayload.Request(mass=2.0, com=[0.1, 0.0, 0.0])
    assert node.requests.answer(SET_PAYLOAD, load).success
    rub = SetFriction.Request(viscous=[2.0, 0.5])
    assert node.requests.answer(SET_FRICTION, rub).success
    after = engine.energy.read()
    jump = sum(sim.dynamics.energy(sim.state.q, sim.state.v)) - before.total
    assert after.changed == pytest.approx(jump, rel=1e-12)
    assert abs(jump) > 0.1
    ticks(node, 50)
    account = engine.energy.read()
    assert account.dissipated > after.dissipated
    assert abs(account.balance) < 1e-8
    engine.commands.clear()
    loaded = Dynamics(scene(payloads=[{**LOAD, "mass": 2.0, "com": [0.1, 0.0, 0.0]}]))
    np.testing.assert_allclose(
        next_command(engine.commands, sim.state.q), loaded.gravity(sim.state.q), rtol=1e-12
    )
    ros.peer.destroy_subscription(heard)


def test_time_stands_still_until_the_first_command(ros: Ros) -> None:
    node = by_hand(ros, wait_for_command=True)
    ticks(node, 50)
    assert node.simulator.arm.step_count == 0
    node.inputs.on_commands(Float64MultiArray(data=TAU))
    ticks(node, 5)
    assert node.simulator.arm.step_count == 5
    node.requests.answer(RESET)
    ticks(node, 5)
    assert node.simulator.arm.step_count == 0


def energy(node: SimNode) -> tuple[float, float]:
    state = node.simulator.state
    return node.simulator.dynamics.energy(state.q, state.v)


def test_what_a_node_does_is_told_in_numbers(ros: Ros) -> None:
    node = by_hand(ros, command_timeout=0.005, wrench_timeout=1.0)
    node.inputs.on_joint_commands(command("leader"))
    trip = node.engine.round_trip
    trip.reset()
    for state, arrival in (7, 3_000_000), (8, 5_000_000):  # 3 and 5 ms after they were sent
        library().trip_sent(byref(trip), state)
        sent = trip._times[(trip.next - 1) % 256]
        assert trip.answered(state, sent + arrival)
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
    told = values(finding(node, "simulation"))
    assert told == {
        "time [s]": "0.007", "stamps": "sim", "tf": told["tf"], "paused": "false",
        "diverged": "false", "at stops": "none", "method": node.simulator.choice.method.name,
        "error estimate": "0", "time-stepped ticks": "0", "energy balance [J]": "closed",
        "energy [J]": "closed",
    }  # fmt: skip
    node.engine.pause(True)
    assert values(finding(node, "simulation"))["paused"] == "true"


def test_ticks_that_are_late_show_once(ros: Ros, monkeypatch: pytest.MonkeyPatch) -> None:
    node = by_hand(ros, realtime_factor=0.5)
    report = LoopReport(2000, 4.0, 3, 1, Percentiles(2000, 1e-5, 2e-4, 3e-3))
    monkeypatch.setattr(node.loop, "report", lambda: report)
    found = finding(node, "loop")
    assert (found.level, found.message) == (
        DiagnosticStatus.WARN,
        "3 time steps began after the next one was due; 1 time step dropped",
    )  # fmt: skip
    assert values(found) == {
        "rate [Hz]": "500", "ticks": "2000", "missed": "3", "dropped": "1",
        "lateness p50 [s]": "1e-05", "lateness p99 [s]": "0.0002", "lateness max [s]": "0.003",
        "realtime factor": "0.5", "overrun": "catch_up", "driven by": "hand",
        "messages": "in C", "ticks made": "in C",
    }  # fmt: skip
    found = finding(node, "loop")
    assert (found.level, found.message) == (DiagnosticStatus.OK, "ok")


def test_joints_at_their_stops_and_ticks_of_first_order_show(ros: Ros) -> None:
    node = by_hand(ros)
    state = replace(node.simulator.state, error=2.5e-4, time_stepped=4)
    node.engine.simulator = SimpleNamespace(
        state=state, stop_torque=np.array([0.0, -2.5]), joint_names=NAMES,
        choice=node.simulator.choice, dt=node.simulator.dt,
    )  # fmt: skip
    found = finding(node, "simulation")
    told = values(found)
    assert (told["at stops"], told["error estimate"]) == ("elbow -2.5", "0.00025")
    assert told["time-stepped ticks"] == "4"
    assert (found.level, found.message) == (
        DiagnosticStatus.WARN, "4 time steps of first order: too many events",
    )  # fmt: skip
    assert finding(node, "simulation").message == "ok"


def test_diagnostics_are_published_while_somebody_listens(ros: Ros) -> None:
    node = by_hand(ros, energy_period=0.02)
    node.tick()
    node.diagnosis.publish()
    heard = ros.listen(DiagnosticArray, "/diagnostics")
    ros.spin_until(lambda: node.diagnosis.has_subscribers)
    ticks(node, 30)
    node.diagnosis.publish()
    ticks(node, 30)
    node.diagnosis.publish()
    ros.spin_until(lambda: len(heard) >= 2)
    status = {s.name: s for s in heard[-1].status}
    assert set(status) == {"sim: loop", "sim: commands", "sim: simulation"}
    assert values(status["sim: loop"])["driven by"] == "hand"
    assert values(status["sim: loop"])["executor"] == "SingleThreadedExecutor"
    told = values(status["sim: simulation"])
    assert abs(float(told["energy balance [J]"])) < 1e-3
    assert float(told["energy [J]"]) == pytest.approx(sum(energy(node)), rel=1e-5)


def test_ticks_that_are_too_coarse_show_while_diagnostics_are_heard(ros: Ros) -> None:
    """Only then the energy account is kept."""
    node = by_hand(ros, integrator="euler", energy_period=0.005)
    ticks(node, 5)
    assert node.engine.energy.read() is None
    heard = ros.peer.create_subscription(DiagnosticArray, "/diagnostics", lambda _: None, 10)
    ros.spin_until(lambda: node.diagnosis.has_subscribers)
    ticks(node, 5)
    node.engine.change(lambda: node.simulator.set_state([0.5, -0.3], [3.0, -4.0]))
    ticks(node, 300)
    found = finding(node, "simulation")
    assert found.level == DiagnosticStatus.WARN
    assert f"off by {node.engine.energy.error:.2g} of the energy that moved" in found.message
    assert "with time steps of 0.001 s" in found.message
    ros.peer.destroy_subscription(heard)
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


def test_two_controllers_show_and_the_first_one_stays(
    ros: Ros, capfd: pytest.CaptureFixture[str]
) -> None:
    node = by_hand(ros)
    for _ in range(STREAM):
        node.inputs.on_joint_commands(command("/controller:1"))
        node.tick()
    node.inputs.on_joint_commands(command("/controller:2", effort=[9.0, 9.0]))
    node.tick()
    np.testing.assert_array_equal(node.simulator.effort, TAU)
    found = finding(node, "commands")
    assert found.level == DiagnosticStatus.ERROR
    assert "two controllers: '/controller:2' is refused" in found.message
    assert "two controllers" in capfd.readouterr().err
    ticks(node, 999)
    assert finding(node, "commands").level == DiagnosticStatus.ERROR  # for a second
    ticks(node, 1)
    assert finding(node, "commands").level != DiagnosticStatus.ERROR


def test_counters_are_reset(ros: Ros) -> None:
    node = by_hand(ros, command_timeout=0.002)
    for _ in range(STREAM):
        node.inputs.on_joint_commands(command("one"))
    for _ in range(3):
        node.inputs.on_joint_commands(command("two"))
    node.inputs.on_wrench(pushed("paw", *[1.0] * 6))
    ticks(node, 5)
    counts = lambda: [  # noqa: E731
        node.inputs.refused, node.inputs.refused_wrenches, node.engine.arbiter.refused,
        node.engine.commands.stale_count, node.engine.round_trip.histogram.percentiles().count,
    ]  # fmt: skip
    assert counts() == [3, 1, 3, 1, 1]
    assert "3 commands ignored" in finding(node, "commands").message
    assert node.requests.answer(RESET_COUNTERS).success
    assert counts() == [0, 0, 0, 0, 0]
    assert "passed over" not in finding(node, "commands").message
    node.inputs.on_joint_commands(command(effort=[np.nan, 0.0]))
    assert "1 command ignored" in finding(node, "commands").message
