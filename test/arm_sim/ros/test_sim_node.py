# SPDX-License-Identifier: Apache-2.0
"""The sim node, ticked by hand: what moves and stops it, what it publishes, what it refuses."""

import threading
import time
from functools import partial
from typing import Any

import numpy as np
import pytest
from arm_msgs.msg import Energy
from arm_msgs.srv import SetJointState, Step
from diagnostic_msgs.msg import DiagnosticStatus
from harness import Ros
from sensor_msgs.msg import JointState
from sim_by_hand import NAMES, by_hand, command, motion, ticks
from std_srvs.srv import SetBool

import models
from arm_dynamics.ros import ControllerNode
from arm_dynamics.ros.common.convert import to_nanoseconds
from arm_dynamics.ros.interfaces import PAUSE, SET_JOINT_STATE, STEP
from arm_sim.ros import SimNode
from arm_sim.ros.sim_params import SimParams

pytestmark = pytest.mark.ros


@pytest.fixture
def node(ros: Ros) -> SimNode:
    """A two-link arm whose ticks are triggered by hand."""
    return by_hand(ros)


def test_ticks_are_those_of_the_simulator_to_the_bit_and_are_published(
    ros: Ros, rng: np.random.Generator
) -> None:
    """Each state with the torque that acted: some are beyond limits."""
    node, sim = by_hand(ros, "panda"), models.simulator("panda")
    heard = ros.listen(JointState, "/joint_states", 50)
    for count, tau in enumerate(rng.normal(scale=20.0, size=(50, sim.n)), 1):
        node.inputs.on_joint_commands(command(name=list(sim.joint_names), effort=tau.tolist()))
        node.tick()
        sim.step(tau)
        np.testing.assert_array_equal(motion(node), [sim.state.q, sim.state.v])
        ros.spin_until(lambda count=count: len(heard) == count)
        message = heard[-1]
        assert tuple(message.name) == sim.joint_names
        np.testing.assert_array_equal(message.position, sim.state.q)
        np.testing.assert_array_equal(message.velocity, sim.state.v)
        np.testing.assert_array_equal(message.effort, sim.effort)
        assert message.header.stamp.nanosec == count * 1_000_000
    assert node.simulator.state.time == sim.state.time


def test_energies_are_published_beside_ticks_by_the_clock(ros: Ros) -> None:
    ros.add(SimNode, "panda", stale_policy="zero", energy_period=0.02)
    heard = ros.listen(Energy, "/sim/energy")
    ros.spin_until(lambda: len(heard) >= 5)
    times = [to_nanoseconds(message.header.stamp) for message in heard]
    assert (np.diff(times) > 0).all() and times[-1] <= time.time_ns()
    assert all(abs(message.balance) < 1e-6 for message in heard)


@pytest.mark.parametrize("factor", [0.1, 0.0])
def test_simulated_time_goes_at_a_tenth_of_the_clock_or_as_fast_as_possible(
    ros: Ros, factor: float
) -> None:
    began = time.monotonic()
    node = ros.add(SimNode, models.scene("two_link"), realtime_factor=factor)
    ros.spin_until(lambda: node.simulator.arm.step_count >= 20)
    report = node.loop.report()
    assert time.monotonic() - began > 0.18 if factor else report.missed == report.dropped == 0


def test_parameters_without_effect_are_named(ros: Ros, capfd: pytest.CaptureFixture[str]) -> None:
    """Those for another source of ticks, unless they have their defaults."""
    lockstep = SimParams(lockstep=True, lockstep_retry=0.1, cpus="0", overrun="skip")
    assert lockstep.unused == ("overrun",)
    assert SimParams(overrun="skip", priority=5, lockstep_retry=0.1).unused == ("lockstep_retry",)
    by_hand(ros, realtime_factor=0.0, cpus="0", overrun="catch_up")
    told = "without effect, since time steps are triggered by hand: realtime_factor, cpus\n"
    assert told in capfd.readouterr().err


def test_a_failure_in_the_loop_pauses_it(ros: Ros, capfd: pytest.CaptureFixture[str]) -> None:
    node = ros.add(SimNode, models.scene("two_link"))

    def fail(*_: Any) -> None:
        raise ZeroDivisionError("by surprise")

    node.engine.on.tick.append(fail)
    node.engine.queue.ring()
    ros.spin_until(lambda: node.engine.paused)
    node.engine.on.tick.clear()
    said = capfd.readouterr().err
    assert said.count("by surprise") == 1
    assert ros.call(Step, "/sim/step", Step.Request(steps=2)).success


@pytest.mark.parametrize("make", [SimNode, partial(ControllerNode, own_thread=True)])
def test_when_a_node_is_destroyed_its_threads_have_ended(
    ros: Ros, make: Any, capfd: pytest.CaptureFixture[str]
) -> None:
    before = set(threading.enumerate())
    node = make(models.scene("two_link"), context=ros.context)
    threads = {thread.name: thread for thread in set(threading.enumerate()) - before}
    assert len(threads) >= 3
    for name in threads.keys() & {"states", "realtime_loop", "energy"}:
        assert threads[name].daemon, "it would keep a process that has forgotten its node"
    node.destroy_node()
    assert set(threading.enumerate()) <= before
    if make is SimNode:
        ticks = node.loop.report().ticks
        assert f"{ticks} cycles, " in capfd.readouterr().err


def set_joint_state(node: SimNode, **fields: Any) -> Any:
    return node.requests.answer(SET_JOINT_STATE, SetJointState.Request(**fields))


def pause(node: SimNode, stop: bool) -> None:
    assert node.requests.answer(PAUSE, SetBool.Request(data=stop)).success


def test_mimic_joints_may_be_set_as_they_follow(ros: Ros) -> None:
    node, both = by_hand(ros, "gripper"), ["right_slide", "left_slide"]
    assert set_joint_state(node, joint_names=both, position=[-0.011, 0.03]).success
    for fields, words in (
        ({"joint_names": both, "velocity": [0.1, 0.1]}, "right_slide is 0.1, but right_slide fol"),
        ({"joint_names": both[:1], "position": [0.0]}, "right_slide follows left_slide; command"),
    ):
        answer = set_joint_state(node, **fields)
        assert not answer.success and words in answer.message
        np.testing.assert_array_equal(motion(node), [[0.0, 0.03], [0.0, 0.0]])


def test_a_pause_stops_time_and_is_seen_now_and_then(
    ros: Ros, node: SimNode, capfd: pytest.CaptureFixture[str]
) -> None:
    ticks(node, 3)
    pause(node, True)
    before, heard = motion(node), ros.listen(JointState, "/joint_states", 50)
    ticks(node, 350)
    np.testing.assert_array_equal(motion(node), before)
    ros.spin_until(lambda: len(heard) >= 3)
    for _ in range(3):  # one more may be on its way, not more
        ros.spin_once()
    assert 3 <= len(heard) <= 4
    assert {message.header.stamp.nanosec for message in heard} == {3_000_000}
    pause(node, False)
    ticks(node, 3)
    assert node.simulator.arm.step_count == 6
    said = capfd.readouterr().err
    assert "paused at 0.003 s" in said and "running on at 0.003 s" in said


def test_set_joint_state_by_name_while_time_goes_on(ros: Ros, node: SimNode) -> None:
    ticks(node, 10)
    moving = motion(node)
    heard = ros.listen(JointState, "/joint_states")
    answer = set_joint_state(node, joint_names=[NAMES[1]], position=[0.7])
    assert answer.success, answer.message
    np.testing.assert_array_equal(motion(node), [[moving[0, 0], 0.7], [moving[1, 0], 0.0]])
    assert node.simulator.state.time == pytest.approx(0.01)
    ros.spin_until(lambda: heard)
    assert heard[-1].position[1] == 0.7
    assert set_joint_state(node, velocity=[1000.0, -1000.0]).success
    np.testing.assert_array_equal(motion(node), [[moving[0, 0], 0.7], [1000.0, -1000.0]])


def test_divergence_pauses_and_keeps_the_last_good_state(
    node: SimNode, capfd: pytest.CaptureFixture[str]
) -> None:
    ticks(node, 4)
    node.simulator.set_state([0.0, 0.0], [1e160, 1e160])
    good = motion(node)
    ticks(node, 3)
    assert capfd.readouterr().err.count("cannot be computed") == 1
    found = {f.part: f for f in node.diagnostics()}["simulation"]
    assert found.message(node).level == DiagnosticStatus.ERROR and found.values["diverged"]
    answer = node.requests.answer(STEP, Step.Request(steps=2))
    assert not answer.success
    assert "after 0 of 2 steps" in answer.message
    ticks(node, 3)
    np.testing.assert_array_equal(motion(node), good)
    node.simulator.set_state([0.0, 0.0], [0.0, 0.0])
    pause(node, False)
    ticks(node, 2)
    assert node.simulator.arm.step_count == 6
    found = {f.part: f for f in node.diagnostics()}["simulation"]
    assert found.message(node).level == DiagnosticStatus.OK
