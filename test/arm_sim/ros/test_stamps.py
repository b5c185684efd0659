# SPDX-License-Identifier: Apache-2.0
"""Stamps: of simulated time, or of a clock that other nodes know."""

import time
from ctypes import c_int64
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from harness import Ros
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from sim_by_hand import by_hand, ticks

import models
from arm_dynamics import InvalidInput
from arm_dynamics.ros.common.convert import to_nanoseconds
from arm_sim.ros import SimNode
from arm_sim.ros.sim_params import SimParams
from arm_sim.ros.timing.stamps import NodeTime

MS = 1_000_000
EPOCH = 1_700_000_000 * 1000 * MS


class Machine:
    """A system clock that a test sets, and the stamps that follow it and the ticks' deadlines."""

    def __init__(self, tick: int = MS) -> None:
        self.now, self.simulated, self.due = EPOCH, 0, c_int64()
        clock = SimpleNamespace(ros_time_is_active=False)
        self.stamps = NodeTime(clock, tick, system=lambda: self.now, steady=lambda: self.now)
        self.stamps.follow(self.due)

    def ticks(self, late: np.ndarray) -> np.ndarray:
        """Stamps less the start of the clock, of ticks that are woken late by these times [ns]."""
        found = []
        due = self.now
        for lateness in late.tolist():
            due += MS
            self.due.value = due
            self.now, self.simulated = due + lateness, self.simulated + MS
            found.append(self.stamps.at(self.simulated) - EPOCH)
        self.now = due
        return np.array(found)


@pytest.fixture
def machine() -> Machine:
    made = Machine()
    made.stamps.at(0)
    return made


def test_stamps_after_time_stood_still_are_when_ticks_were_due(
    machine: Machine, rng: np.random.Generator
) -> None:
    """The first of these ticks comes late; the next ones catch up."""
    machine.now += 70 * MS
    machine.stamps.release()
    late = np.concatenate([np.arange(5 * MS, 0, -600_000), rng.integers(0, 100_000, 1000)])
    np.testing.assert_array_equal(machine.ticks(late), MS * np.arange(71, 71 + late.size))


def test_a_state_before_the_first_tick_after_a_rest_is_a_tick_older(machine: Machine) -> None:
    machine.ticks(np.zeros(10, int))
    machine.now += 70 * MS
    machine.stamps.release()
    machine.due.value = machine.now + MS
    machine.now += MS + 300_000
    assert machine.stamps.at(10 * MS) == EPOCH + 80 * MS
    machine.now -= MS + 300_000
    np.testing.assert_array_equal(machine.ticks(np.full(3, 300_000)), MS * np.arange(81, 84))


def test_stamps_are_never_of_the_future_nor_go_backwards(
    machine: Machine, rng: np.random.Generator
) -> None:
    """Where nobody says when ticks are due, and the first one comes late."""
    machine.stamps.follow(c_int64())
    machine.stamps.release()
    late = np.concatenate([np.arange(5 * MS, 0, -600_000), rng.integers(0, 100_000, 1000)])
    due = MS * np.arange(1, late.size + 1)
    found = machine.ticks(late)
    assert found[0] == due[0] + late[0]
    assert (found <= due + late).all()
    assert (np.diff(found) >= 0).all()
    assert (found[-500:] - due[-500:] < 1000).all()  # [ns]


def test_a_stall_that_is_made_up_for_leaves_stamps_even(machine: Machine) -> None:
    """As long as the loop catches up, it is late by what it has not made up for yet."""
    stall = 900 * MS
    late = np.zeros(5000, int)
    behind = np.arange(stall, 0, -int(0.8 * MS))  # ticks follow after 0.2 of a period
    late[1300 : 1300 + behind.size] = behind
    np.testing.assert_array_equal(machine.ticks(late), MS * np.arange(1, 5001))


@pytest.mark.parametrize(("dropped", "jumps"), [(3000, True), (500, False)])
def test_time_that_was_dropped_is_made_up_for_by_stamps(
    machine: Machine, dropped: int, jumps: bool
) -> None:
    """Once it is clear that ticks will not make up for it; little of it without a jump."""
    machine.ticks(np.zeros(100, int))
    machine.now += dropped * MS
    found = machine.ticks(np.zeros(3500, int))
    assert found[0] == 101 * MS
    assert ({*np.diff(found).tolist()} == {MS, MS + MS // 2}) != jumps
    np.testing.assert_array_equal(found[-50:], MS * (dropped + np.arange(3551, 3601)))


def test_a_reset_in_a_late_tick_leaves_stamps_even(machine: Machine) -> None:
    machine.ticks(np.zeros(10, int))
    machine.due.value = machine.now + MS
    machine.now += 5 * MS
    assert machine.stamps.at(0) == EPOCH + 10 * MS
    machine.now -= 5 * MS
    machine.simulated = 0
    np.testing.assert_array_equal(
        machine.ticks(np.array([5, 4, 3, 2, 1]) * MS), MS * np.arange(11, 16)
    )


def test_a_system_clock_that_is_set_is_followed(machine: Machine) -> None:
    machine.ticks(np.zeros(10, int))
    machine.now -= 3_600_000 * MS
    np.testing.assert_array_equal(
        machine.ticks(np.zeros(3, int)), MS * (np.arange(11, 14) - 3_600_000)
    )


def test_uneven_ticks_bear_what_the_clock_says() -> None:
    machine = Machine(tick=0)
    late = np.array([0, 70, 20, 90])
    np.testing.assert_array_equal(machine.ticks(late), MS * np.arange(1, 5) + late)


def test_who_owns_time_decides_what_stamps_are() -> None:
    assert SimParams().stamps == SimParams(realtime=False, time="ros").stamps == "ros"
    for owner in "lockstep", "publish_clock":
        assert SimParams(**{owner: True}).stamps == "sim"
        with pytest.raises(InvalidInput, match=f"'time' is 'ros' with {owner}"):
            SimParams(**{owner: True, "time": "ros"})
    assert SimParams(realtime=False).stamps == SimParams(realtime_factor=0.5).stamps == "sim"


@pytest.mark.ros
def test_stamps_of_a_running_arm_are_of_now_and_of_a_paused_one_stay(ros: Ros) -> None:
    node = ros.add(SimNode, models.scene("two_link"))
    heard, began = ros.listen(JointState, "/joint_states", 50), time.time_ns()

    def stamps() -> list[int]:
        return [to_nanoseconds(message.header.stamp) for message in heard]

    ros.spin_until(lambda: len(heard) > 20)
    assert began - 1000 * MS < stamps()[0] and stamps()[-1] <= time.time_ns()
    assert (np.diff(stamps()) >= 0).all()
    assert next(f for f in node.diagnostics() if f.part == "simulation").values["stamps"] == "ros"
    node.engine.queue.run(lambda: node.engine.pause(True))
    ros.spin_until(lambda: len({*stamps()[-3:]}) == 1)  # after those that were on their way
    released = time.time_ns()
    node.engine.queue.run(lambda: node.engine.pause(False))
    ros.spin_until(lambda: stamps()[-1] >= released)


@pytest.mark.ros
def test_stamps_follow_a_foreign_clock(ros: Ros) -> None:
    node = ros.add(
        SimNode, models.scene("two_link"), realtime=False, time="ros", use_sim_time=True
    )
    states = ros.listen(JointState, "/joint_states", 50)
    clock = ros.peer.create_publisher(Clock, "/clock", 10)
    told = Clock()
    told.clock.sec, told.clock.nanosec = 42, 7

    def seen() -> bool:
        clock.publish(told)
        node.tick()
        return bool(states) and to_nanoseconds(states[-1].header.stamp) == 42 * 1000 * MS + 7

    ros.spin_until(seen)


def clock_owner(ros: Ros, namespace: str) -> SimNode:
    made = partial(SimNode, models.scene("two_link"), namespace=namespace)
    return ros.add(made, realtime=False, publish_clock=True)


@pytest.mark.ros
def test_the_clock_is_on_request_and_two_are_reported(
    ros: Ros, capfd: pytest.CaptureFixture[str]
) -> None:
    by_hand(ros)
    assert not ros.peer.count_publishers("/clock")
    node = clock_owner(ros, "left")
    heard = ros.listen(Clock, "/clock")
    ticks(node, 5)
    ros.spin_until(lambda: heard and heard[-1].clock.nanosec == 5 * MS)
    clock = node.outputs.clock
    clock.check_conflict()
    assert not clock.alarm.message
    clock_owner(ros, "right")
    ros.spin_until(lambda: clock.check_conflict() or clock.alarm.message)
    clock.check_conflict()
    found = next(f for f in node.diagnostics() if f.part == "simulation").message(node)
    assert found.level == b"\x02"
    assert "2 publishers on /clock" in found.message
    assert capfd.readouterr().err.count("2 publishers on /clock") == 1
