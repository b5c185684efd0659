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
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

import models
from arm_dynamics.ros import ControllerNode
from arm_dynamics.ros.common.caller import Caller
from arm_dynamics.ros.common.executor import spin
from arm_dynamics.ros.interfaces import PAUSE, RESET, RESET_COUNTERS, STEP
from arm_dynamics.trajectory import Waypoint
from arm_sim import ClosedLoop
from arm_sim.ros import SimNode

pytestmark = pytest.mark.ros

TICKS = 300
GOAL = np.array([0.4, -0.3])
START = 10_000_000  # [ns]


IMPERFECT = {
    **models.scene("two_link").model_dump(exclude_unset=True),
    "sensors": {
        "position": {"resolution": 1e-4, "noise": 1e-5},
        "velocity": {"from": "position", "cutoff": 100},
        "delay": 0.001,
        "jitter": 0.002,
        "loss": 0.02,
    },
    "commands": {"delay": 0.001, "jitter": 0.001, "loss": 0.02},
}


def lockstep(ros: Ros, scene: Any = None, **parameters: Any) -> SimNode:
    scene = scene or models.scene("two_link")
    return ros.add(SimNode, scene, lockstep=True, **parameters)


def expected(scene: Any = None) -> np.ndarray:
    """The same motion in one process, without messages."""
    pair = ClosedLoop(scene or models.scene("two_link"))
    pair.follow([Waypoint(0.2, pair.simulator.state.q + GOAL)], START)
    motion = pair.run(TICKS * pair.simulator.dt)
    return np.hstack([motion.q, motion.v])


def trajectory(sim: SimNode) -> JointTrajectory:
    goal = (sim.simulator.state.q + GOAL).tolist()
    message = JointTrajectory(joint_names=list(sim.simulator.joint_names))
    message.header.stamp.nanosec = START
    message.points = [JointTrajectoryPoint(positions=goal)]
    message.points[0].time_from_start.nanosec = 200_000_000
    return message


def watched(sim: SimNode) -> list[np.ndarray]:
    """Fills with every state that the simulation reaches; stops it after ``TICKS``."""
    states = [np.concatenate([sim.simulator.state.q, sim.simulator.state.v])]

    def note() -> None:
        states.append(np.concatenate([sim.simulator.state.q, sim.simulator.state.v]))
        sim.engine.ticks.paused = sim.simulator.arm.step_count >= TICKS

    sim.engine.on.tick.append(note)
    return states


def motion(ros: Ros, sim: SimNode, controller: ControllerNode) -> np.ndarray:
    states = watched(sim)
    ros.spin_until(lambda: controller.goals.follower is not None)
    controller.on_joint_trajectory(trajectory(sim))
    ros.spin_until(lambda: controller.goals.follower.remaining(0) > 0.0)  # once it is planned
    sim.engine.pause(False)
    ros.spin_until(lambda: sim.simulator.arm.step_count >= TICKS, timeout=60.0)
    return np.array(states)


def pair(ros: Ros, scene: Any = None, **parameters: Any) -> tuple[SimNode, ControllerNode]:
    sim = lockstep(ros, scene, paused=True, **parameters)
    return sim, ros.add(ControllerNode, models.scene("two_link"))


def test_over_topics_it_equals_one_process_to_the_bit(ros: Ros) -> None:
    np.testing.assert_array_equal(motion(ros, *pair(ros)), expected())


def test_sensors_and_lines_of_the_scene_do_the_same_over_topics_to_the_bit(ros: Ros) -> None:
    over_topics = motion(ros, *pair(ros, IMPERFECT, stale_policy="zero"))
    np.testing.assert_array_equal(over_topics, expected(IMPERFECT))
    assert abs(over_topics - expected()).max() > 1e-4


def test_lost_messages_are_requested_again_and_change_nothing(
    ros: Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
    sim, controller = pair(ros, lockstep_retry=0.005)
    take, count = sim.inputs.on_joint_commands, iter(range(10**9))

    def lose_every_seventh(command: bytes, arrival: int) -> int | None:
        return take(command, arrival) if next(count) % 7 else None

    monkeypatch.setattr(sim.inputs, "on_joint_commands", lose_every_seventh)
    np.testing.assert_array_equal(motion(ros, sim, controller), expected())
    assert sim.lockstep.repeated >= TICKS // 7 - 2


def test_a_state_is_published_again_once_for_each_time_of_waiting(ros: Ros) -> None:
    sim = lockstep(ros, lockstep_retry=10.0)
    heard = ros.listen(JointState, "/joint_states")
    for count in 1, 2:
        sim.lockstep.waiting.published -= 100 * 10**9
        for _ in range(3):
            sim.lockstep.watch()
        assert sim.lockstep.repeated == count
    ros.spin_until(lambda: len(heard) == 2)
    answer(sim, 5_000_000)
    found = {f.part: f for f in sim.diagnostics()}["lockstep"]
    assert found.values == {"asked again": 2, "ignored": 1, "partner gone": False}
    assert found.message(sim).level == DiagnosticStatus.WARN
    assert sim.requests.answer(RESET_COUNTERS).success
    assert (sim.lockstep.repeated, sim.lockstep.waiting.ignored) == (0, 0)


def answer(sim: SimNode, stamp: int, tau: tuple[float, float] = (0.5, -0.5)) -> None:
    message = JointState(name=list(sim.simulator.joint_names), effort=list(tau))
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
    sim.lockstep.on_command(serialize_message(message))


def test_answers_are_to_states_that_are_published(ros: Ros) -> None:
    sim = lockstep(ros, publish_every=5)
    answer(sim, 0)
    assert sim.simulator.arm.step_count == 5
    answer(sim, 1_000_000)
    answer(sim, 5_000_000)
    assert sim.simulator.arm.step_count == 10


def test_a_partner_that_is_gone_is_noticed_in_time_and_may_come_back(
    ros: Ros, capfd: pytest.CaptureFixture[str]
) -> None:
    sim = lockstep(ros, lockstep_timeout=0.2, lockstep_retry=0.02)
    answer(sim, 0)
    since = time.monotonic()
    ros.spin_until(lambda: sim.lockstep.gone)
    assert time.monotonic() - since > 0.15
    assert sim.lockstep.repeated > 2
    said = "no answer to the state of 0.001000 s for 0.2 s: the partner is gone; time stands still"
    assert capfd.readouterr().err.count(said) == 1
    found = {f.part: f for f in sim.diagnostics()}["lockstep"].message(sim)
    assert found.level == b"\x02"
    assert "does not answer" in found.message
    assert sim.simulator.arm.step_count == 1
    answer(sim, 1_000_000)
    assert not sim.lockstep.gone
    assert "the partner answers again" in capfd.readouterr().err
    assert sim.simulator.arm.step_count == 2


def test_paused_it_does_not_wait_for_commands(ros: Ros) -> None:
    sim = lockstep(ros, lockstep_timeout=0.05, lockstep_retry=0.08)
    assert sim.requests.answer(PAUSE, SetBool.Request(data=True)).success
    answer(sim, 0)
    sim.lockstep.waiting.first = sim.lockstep.waiting.published = 0  # long ago
    heard = ros.listen(JointState, "/joint_states")
    for _ in range(5):
        sim.lockstep.watch()
    ros.spin_until(lambda: heard)
    assert 1 <= len(heard) <= 2  # each time that 0.1 s have passed, of 0.04 s
    assert not sim.lockstep.gone and sim.lockstep.repeated == 0
    assert sim.simulator.arm.step_count == 0
    assert sim.requests.answer(PAUSE, SetBool.Request(data=False)).success
    answer(sim, 0)
    assert sim.simulator.arm.step_count == 1


def test_after_a_reset_the_first_state_is_answered_again(ros: Ros) -> None:
    sim = lockstep(ros)
    for stamp in range(0, 5_000_000, 1_000_000):
        answer(sim, stamp)
    assert sim.requests.answer(RESET).success
    answer(sim, 5_000_000)
    assert sim.simulator.arm.step_count == 0
    answer(sim, 0)
    assert sim.simulator.arm.step_count == 1


def test_services_are_answered_while_the_pair_runs_as_fast_as_it_can(ros: Ros) -> None:
    scene, options = models.scene("two_link"), {"context": ros.context}
    sim = SimNode(scene, parameter_overrides=[Parameter("lockstep", value=True)], **options)
    controller = ControllerNode(scene, own_thread=True, **options)
    over = threading.Event()
    thread = threading.Thread(target=spin, args=(sim, over.is_set))
    thread.start()
    try:
        ros.spin_until(lambda: sim.simulator.arm.step_count > 3000)
        with closing(Caller(5.0, ros.domain)) as caller:
            response = caller.ask("sim", STEP, STEP.type.Request(steps=5), repeatable=False)
    finally:
        over.set()
        thread.join()
        controller.destroy_node()
        sim.destroy_node()
    assert "running" in response.message
