# SPDX-License-Identifier: Apache-2.0
"""Sim and controller in lockstep: the same bits, whatever messages are lost."""

import threading
import time
from contextlib import closing
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from harness import Ros
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from sim_by_hand import NAMES, commands_to_come
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

import models
from arm_dynamics.ros import ControllerNode
from arm_dynamics.ros.common.caller import Caller
from arm_dynamics.ros.common.convert import to_time
from arm_dynamics.ros.common.executor import spin
from arm_dynamics.ros.interfaces import PAUSE, RESET, RESET_COUNTERS, STEP
from arm_dynamics.trajectory import Waypoint
from arm_sim import ClosedLoop
from arm_sim.ros import SimNode

pytestmark = pytest.mark.ros

TICKS = 300
GOAL = np.array([0.4, -0.3])
START = 10_000_000  # [ns]
MS = 1_000_000
PLAIN = models.scene("two_link").model_dump(exclude_unset=True)
IMPERFECT = PLAIN | {
    "sensors": {
        "position": {"resolution": 1e-4, "noise": 1e-5},
        "velocity": {"from": "position", "cutoff": 100},
        "delay": 0.001, "jitter": 0.002, "loss": 0.02,
    },
    "commands": {"delay": 0.001, "jitter": 0.001, "loss": 0.02},
}  # fmt: skip


def lockstep(ros: Ros, scene: Any = PLAIN, **parameters: Any) -> SimNode:
    return ros.add(SimNode, scene, lockstep=True, **parameters)


def expected(scene: Any) -> np.ndarray:
    """The same motion in one process, without messages."""
    pair = ClosedLoop(scene)
    pair.follow([Waypoint(0.2, pair.simulator.state.q + GOAL)], START)
    motion = pair.run(TICKS * pair.simulator.dt)
    return np.hstack([motion.q, motion.v])


def motion(ros: Ros, sim: SimNode) -> np.ndarray:
    """Every state that a paused simulation reaches in ``TICKS`` with a controller."""
    controller, arm, states = ros.add(ControllerNode, PLAIN), sim.simulator.arm, []

    def note() -> None:
        states.append(arm.x.copy())
        sim.engine.ticks.paused = arm.step_count >= TICKS

    note()
    sim.engine.on.tick.append(note)
    goal = JointTrajectoryPoint(positions=(arm.x[:2] + GOAL).tolist())
    goal.time_from_start.nanosec = 200_000_000
    trajectory = JointTrajectory(joint_names=NAMES, points=[goal])
    trajectory.header.stamp.nanosec = START
    ros.spin_until(lambda: controller.goals.follower is not None)
    controller.on_joint_trajectory(trajectory)
    ros.spin_until(lambda: controller.goals.follower.remaining(0) > 0.0)  # once it is planned
    sim.engine.pause(False)
    ros.spin_until(lambda: arm.step_count >= TICKS)
    return np.array(states)


@pytest.mark.parametrize("scene", [PLAIN, IMPERFECT], ids=["plain", "with sensors and lines"])
def test_over_topics_it_equals_one_process_to_the_bit(ros: Ros, scene: Any) -> None:
    sim = lockstep(ros, scene, paused=True, stale_policy="zero")
    np.testing.assert_array_equal(motion(ros, sim), expected(scene))


def test_lost_messages_are_requested_again_and_change_nothing(
    ros: Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
    sim = lockstep(ros, paused=True, lockstep_retry=0.005)
    take, count = sim.inputs.on_joint_commands, iter(range(10**9))

    def lose_every_seventh(command: bytes, arrival: int) -> int | None:
        return take(command, arrival) if next(count) % 7 else None

    monkeypatch.setattr(sim.inputs, "on_joint_commands", lose_every_seventh)
    np.testing.assert_array_equal(motion(ros, sim), expected(PLAIN))
    assert sim.lockstep.repeat_count >= TICKS // 7 - 2


def message(stamp: int, *tau: float) -> bytes:
    told = JointState(name=NAMES, effort=tau or (0.5, -0.5))
    told.header.stamp = to_time(stamp)
    return serialize_message(told)


def answer(sim: SimNode, stamp: int) -> None:
    sim.lockstep.on_command(message(stamp))


def test_answers_alone_cause_ticks(ros: Ros) -> None:
    """A command that comes late, twice or without a stamp is counted and acts with the answer."""
    sim = lockstep(ros, stale_policy="zero")
    answer(sim, 0)
    waiting = commands_to_come(sim)
    sim.engine.ticks.most_messages, sim.lockstep.waiting.soon = 0, 60_000 * MS
    for tick in 1, 2, 3:
        for stamp in (7 * MS, (tick - 1) * MS, tick * MS):
            waiting.append(message(stamp, tick, stamp * 1e-9))
        sim.lockstep.on_command(message(0, tick, 0.0))
        assert not waiting and sim.simulator.arm.step_count == tick + 1
        assert sim.lockstep.waiting.ignored == 3 * tick
        assert sim.simulator.effort.tolist() == [tick, tick * MS * 1e-9]


def test_a_state_is_published_again_once_for_each_time_of_waiting(ros: Ros) -> None:
    sim = lockstep(ros, lockstep_retry=10.0)
    heard = ros.listen(JointState, "/joint_states")
    for count in 1, 2:
        sim.lockstep.waiting.published -= 100_000 * MS
        for _ in range(3):
            sim.lockstep.check_partner()
        assert sim.lockstep.repeat_count == count
    ros.spin_until(lambda: len(heard) == 2)
    answer(sim, 5 * MS)
    found = {f.part: f for f in sim.diagnostics()}["lockstep"]
    assert found.values == {"asked again": 2, "ignored": 1, "partner gone": False}
    assert found.message(sim).level == DiagnosticStatus.WARN
    assert sim.requests.answer(RESET_COUNTERS).success
    assert (sim.lockstep.repeat_count, sim.lockstep.waiting.ignored) == (0, 0)


def test_a_partner_that_is_gone_is_noticed_in_time_and_may_come_back(
    ros: Ros, capfd: pytest.CaptureFixture[str]
) -> None:
    sim = lockstep(ros, lockstep_timeout=0.2, lockstep_retry=0.02)
    answer(sim, 0)
    since = time.monotonic()
    ros.spin_until(lambda: sim.lockstep.is_partner_gone)
    assert time.monotonic() - since > 0.15
    assert sim.lockstep.repeat_count > 2
    assert capfd.readouterr().err.count("no answer to the state of 0.001000 s for 0.2 s") == 1
    found = {f.part: f for f in sim.diagnostics()}["lockstep"].message(sim)
    assert found.level == DiagnosticStatus.ERROR
    assert sim.simulator.arm.step_count == 1
    answer(sim, MS)
    assert not sim.lockstep.is_partner_gone
    assert "the partner answers again" in capfd.readouterr().err
    assert sim.simulator.arm.step_count == 2


def test_paused_it_does_not_wait_for_commands(ros: Ros) -> None:
    sim = lockstep(ros, lockstep_timeout=0.05, lockstep_retry=0.08)
    assert sim.requests.answer(PAUSE, SetBool.Request(data=True)).success
    answer(sim, 0)
    sim.lockstep.waiting.first = sim.lockstep.waiting.published = 0  # long ago
    heard = ros.listen(JointState, "/joint_states")
    for _ in range(5):
        sim.lockstep.check_partner()
    ros.spin_until(lambda: heard)
    assert 1 <= len(heard) <= 2  # each time that 0.1 s have passed, of 0.04 s
    assert not sim.lockstep.is_partner_gone and sim.lockstep.repeat_count == 0
    assert sim.simulator.arm.step_count == 0
    assert sim.requests.answer(PAUSE, SetBool.Request(data=False)).success
    answer(sim, 0)
    assert sim.simulator.arm.step_count == 1


def test_answers_are_to_states_that_are_published_also_after_a_reset(ros: Ros) -> None:
    sim = lockstep(ros, publish_every=5)
    for stamp, ticks in (0, 5), (1 * MS, 5), (5 * MS, 10):
        answer(sim, stamp)
        assert sim.simulator.arm.step_count == ticks
    assert sim.requests.answer(RESET).success
    for stamp, ticks in (10 * MS, 0), (0, 5):
        answer(sim, stamp)
        assert sim.simulator.arm.step_count == ticks


def test_services_are_answered_while_the_pair_runs_as_fast_as_it_can(ros: Ros) -> None:
    """In a namespace, as one of two arms."""
    options = {"context": ros.context, "namespace": "left"}
    sim = SimNode(PLAIN, parameter_overrides=[Parameter("lockstep", value=True)], **options)
    controller = ControllerNode(PLAIN, own_thread=True, **options)
    over = threading.Event()
    thread = threading.Thread(target=spin, args=(sim, over.is_set))
    thread.start()
    try:
        ros.spin_until(lambda: sim.simulator.arm.step_count > 1000)
        with closing(Caller(5.0, ros.domain)) as caller:
            response = caller.ask("left/sim", STEP, STEP.type.Request(steps=5), repeatable=False)
    finally:
        over.set()
        thread.join()
        controller.destroy_node()
        sim.destroy_node()
    assert "running" in response.message
