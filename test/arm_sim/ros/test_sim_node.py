# SPDX-License-Identifier: Apache-2.0
"""The sim node, ticked by hand: what moves it, what it publishes, what it refuses."""

import threading
import time
from functools import partial
from typing import Any

import numpy as np
import pytest
from arm_msgs.msg import Energy
from arm_msgs.srv import Step
from harness import Ros
from sensor_msgs.msg import JointState
from sim_by_hand import NAMES, by_hand, command, motion, ticks
from std_msgs.msg import Float64MultiArray

import models
from arm_dynamics.ros import ControllerNode
from arm_sim.ros import SimNode

pytestmark = pytest.mark.ros


@pytest.fixture
def node(ros: Ros) -> SimNode:
    """A two-link arm whose ticks are triggered by hand."""
    return by_hand(ros)


def test_ticks_equal_the_simulator_to_the_bit(ros: Ros, rng: np.random.Generator) -> None:
    node, sim = by_hand(ros, "panda"), models.simulator("panda")
    for tau in rng.normal(scale=5.0, size=(200, sim.n)):
        node.inputs.on_joint_commands(command(name=list(sim.joint_names), effort=tau.tolist()))
        node.tick()
        sim.step(tau)
        np.testing.assert_array_equal(motion(node), [sim.state.q, sim.state.v])
    assert node.simulator.state.time == sim.state.time


def test_publishes_each_state_with_the_torque_that_acted(ros: Ros, node: SimNode) -> None:
    heard = ros.listen(JointState, "/joint_states", 50)
    node.inputs.on_commands(Float64MultiArray(data=[1e9, 0.25]))
    for count in range(1, 6):
        node.tick()
        ros.spin_until(lambda count=count: len(heard) >= count)
        message, state = heard[-1], node.simulator.state
        assert list(message.name) == NAMES
        np.testing.assert_array_equal(message.position, state.q)
        np.testing.assert_array_equal(message.velocity, state.v)
        np.testing.assert_array_equal(message.effort, node.simulator.effort)
        stamp = message.header.stamp
        assert stamp.sec * 10**9 + stamp.nanosec == count * 1_000_000
    assert message.effort[1] == 0.25


def test_energy_account_balances(ros: Ros) -> None:
    node = by_hand(ros, "panda", energy_period=0.01, command_timeout=0.0, integrator="rk4")
    heard = ros.listen(Energy, "/sim/energy")
    ticks(node, 10)
    node.inputs.on_commands(Float64MultiArray(data=[3.0, -20.0, 1.0, 15.0, 0.5, 2.0, 0.1]))
    start = sum(node.simulator.dynamics.energy(*motion(node)))
    for _ in range(20):
        ticks(node, 10)
        ros.spin_until(lambda: heard)
    ros.spin_until(lambda: heard[-1].header.stamp.nanosec == 210_000_000)
    assert {m.header.stamp.nanosec % 10_000_000 for m in heard} == {0}
    last = heard[-1]
    kinetic, potential = node.simulator.dynamics.energy(*motion(node))
    assert (last.kinetic, last.potential) == (kinetic, potential)
    assert last.total == pytest.approx(kinetic + potential)
    assert last.input > 0.1
    assert last.dissipated > 1e-4
    assert last.balance == pytest.approx(last.total - start - last.input + last.dissipated)
    assert abs(last.balance) < 1e-6 * last.input


def test_energies_begin_again_after_a_reset(ros: Ros) -> None:
    node = by_hand(ros, energy_period=0.01)
    heard = ros.listen(Energy, "/sim/energy")
    for count in 2, 4:
        node.inputs.on_commands(Float64MultiArray(data=[1.5, -0.5]))
        ticks(node, 20)
        ros.spin_until(lambda count=count: len(heard) == count)
        node.engine.reset()
    first, again = heard[1], heard[3]
    assert first.input != 0.0
    assert (first.input, first.total) == (again.input, again.total)


def test_simulated_time_goes_at_a_tenth_of_the_clock(ros: Ros) -> None:
    began = time.monotonic()
    node = ros.add(SimNode, models.scene("two_link"), realtime_factor=0.1)
    ros.spin_until(lambda: node.simulator.arm.step_count >= 20)
    assert time.monotonic() - began > 0.18


def test_simulated_time_goes_as_fast_as_possible(ros: Ros) -> None:
    node = ros.add(SimNode, models.scene("two_link"), realtime_factor=0.0, dt=0.001)
    ros.spin_until(lambda: node.simulator.arm.step_count >= 100)
    assert node.loop.report().missed == node.loop.report().dropped == 0


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
        report = node.loop.report()
        summary = (
            f"{report.ticks} cycles, {report.rate:.2f} per second, {report.missed} deadlines "
            f"missed, {report.dropped} dropped; lateness {report.lateness}; 0 answers\n"
        )
        assert summary in capfd.readouterr().err
