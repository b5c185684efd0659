# SPDX-License-Identifier: Apache-2.0
"""Ticks of a node by the clock and in lockstep: which commands act in them, and what is told."""

import math
import time
from ctypes import addressof, byref

import numpy as np
import pytest
from arm_msgs.msg import Energy
from harness import Ros
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from sim_by_hand import NAMES, Waiting, by_hand, motion

import models
from arm_dynamics.ros.common.convert import to_nanoseconds, to_time
from arm_dynamics.ros.interfaces import JOINT_COMMANDS
from arm_sim.ros import SimNode
from arm_sim.ros.node_library import library
from arm_sim.ros.timing.histogram import Histogram
from arm_sim.ros.timing.realtime_loop import Due

pytestmark = pytest.mark.ros

MILLISECOND, SECOND = 10**6, 10**9


def message(*tau: float, source: str = "leader", stamp: int = 0) -> bytes:
    """A command of efforts."""
    told = JointState(name=NAMES, effort=list(tau))
    told.header.frame_id, told.header.stamp = source, to_time(stamp)
    return serialize_message(told)


def test_in_lockstep_answers_alone_cause_ticks(ros: Ros) -> None:
    """A command that comes late, twice or without a stamp is counted and acts with the answer."""
    node = ros.add(SimNode, models.scene("two_link"), lockstep=True, stale_policy="zero")
    lockstep = node.lockstep
    lockstep.on_command(message(0.5, 0.5, stamp=0))
    waiting = Waiting(node)
    node.engine.ticks.at_once, lockstep.waiting.soon = 0, 60 * SECOND
    for tick in 1, 2, 3:
        for stamp in (7 * MILLISECOND, (tick - 1) * MILLISECOND, tick * MILLISECOND):
            waiting.messages.append(message(tick, stamp * 1e-9, stamp=stamp))
        lockstep.on_command(message(tick, 0.0))
        assert not waiting.messages and node.simulator.arm.step_count == tick + 1
        assert lockstep.waiting.ignored == 3 * tick
        assert node.simulator.effort.tolist() == [tick, tick * MILLISECOND * 1e-9]


class Clocked:
    """A node by hand, whose ticks are made by the clock while messages wait."""

    def __init__(self, ros: Ros, **due: int) -> None:
        self.node = by_hand(ros, command_timeout=5e-3)
        self.lateness = Histogram()
        self.due = Due(lateness=addressof(self.lateness), **due)
        self.commands = Waiting(self.node).messages

    def ticks(self, count: int) -> None:
        """As many ticks, in one call."""
        engine, ended = self.node.engine, self.node.simulator.arm.step_count + count

        def end() -> None:
            self.due.ended = self.node.simulator.arm.step_count == ended

        engine.on.tick[:], self.due.ended = [end], 0
        engine.run(library().ticks_by_the_clock, byref(self.due))
        assert not engine.failure


def test_commands_age_in_part_while_ticks_are_made_up_for(ros: Ros) -> None:
    """Long behind, ticks of a second follow at once: they take next to no time."""
    clocked = Clocked(
        ros, deadline=time.monotonic_ns() - 1000 * SECOND, period=SECOND, give_up=10_000 * SECOND
    )
    engine = clocked.node.engine
    clocked.commands.append(message(0.1, 0.1))
    heard = engine.arbiter.now
    clocked.ticks(50)
    assert 1.0 <= engine.commands.age < 2.0, "the first one counts in full"
    assert 1.0 <= engine.arbiter.now - heard < 2.0


def test_an_order_waits_for_no_more_than_the_tick_under_way(ros: Ros) -> None:
    clocked, served = Clocked(ros), list[int]()
    queue, arm = clocked.node.engine.queue, clocked.node.simulator.arm
    queue.served = True
    clocked.ticks(3)
    queue.post(lambda: served.append(arm.step_count))
    clocked.ticks(3)
    assert served == [3] and arm.step_count == 6


def test_an_account_of_many_ticks_is_that_of_each(
    ros: Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("arm_sim.ros.energy_trail.ROWS", 3)
    clocked, each = Clocked(ros), by_hand(ros, command_timeout=5e-3)
    each.inputs.polled.close()
    for node in clocked.node, each:
        node.engine.energy.keep(True)
    for k in range(19):  # before it is closed, since nobody listens
        clocked.commands.append(raw := message(math.sin(k), 1.0))
        clocked.ticks(5)
        each.inputs.on_joint_commands(raw)
        for _ in range(5):
            each.tick()
            each.engine.energy.read()
        assert motion(each).tobytes() == motion(clocked.node).tobytes()
    one, other = clocked.node.engine.energy.read(), each.engine.energy.read()
    assert one is not None and other is not None and one.input != 0.0
    np.testing.assert_allclose(one, other, atol=1e-12)


def test_energies_are_published_beside_ticks_by_the_clock(ros: Ros) -> None:
    node = ros.add(SimNode, "panda", command_timeout=0.0, energy_period=0.05)
    energies = ros.listen(Energy, "sim/energy")
    names, said = list(node.simulator.joint_names), list[JointState]()

    def answer(state: JointState) -> None:
        said.append(state)
        told = JointState(name=names, effort=[0.0] * len(names), header=state.header)
        told.header.frame_id = "leader"
        publisher.publish(told)

    publisher = ros.publisher(JointState, JOINT_COMMANDS.name)
    ros.peer.create_subscription(JointState, "joint_states", answer, 10)
    ros.spin_until(lambda: len(energies) >= 10)
    node.loop.stop()
    assert node.engine.round_trip.histogram.percentiles().count > 0
    stamps = np.array([s.header.stamp.sec * SECOND + s.header.stamp.nanosec for s in said])
    assert (np.diff(stamps) >= 0).all() and stamps[-1] <= time.time_ns()
    times = [to_nanoseconds(e.header.stamp) for e in energies]
    assert (np.diff(times) > 0).all() and times[-1] <= time.time_ns()
    assert all(abs(e.balance) < 1e-6 for e in energies)
    last = node.engine.energy.read()
    assert last is not None and last.step == node.simulator.arm.step_count
    assert (last.kinetic, last.potential) == node.simulator.dynamics.energy(*motion(node))
