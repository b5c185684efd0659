# SPDX-License-Identifier: Apache-2.0
"""Two that publish joint states of one arm: who comes second refuses, and both are named."""

from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Event, Thread, Timer
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from harness import Ros
from rclpy.node import Node
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from sim_by_hand import NAMES, TAU, by_hand, command
from std_msgs.msg import Float64MultiArray

import models
from arm_dynamics import InvalidInput
from arm_dynamics.ros.interfaces import JOINT_STATES
from arm_sim import Recording
from arm_sim.ros import SimNode

pytestmark = pytest.mark.ros


class Driver:
    """Another publisher of joint states, which speaks while it is told to."""

    def __init__(self, ros: Ros, names: list[str]) -> None:
        self._topic = ros.adopt(Node("driver", context=ros.context)).create_publisher(
            JointState, JOINT_STATES.name, 10
        )
        self.message: Any = JointState(name=names, position=[0.0] * len(names))
        self.speaks, self.ended = Event(), Event()
        self.thread = Thread(target=self._speak, daemon=True)
        self.thread.start()
        ros.spin_until(lambda: ros.peer.count_publishers("/joint_states"))

    def _speak(self) -> None:
        while not self.ended.wait(5e-3):
            if self.speaks.is_set():
                self._topic.publish(self.message)


@pytest.fixture
def driver(ros: Ros) -> Iterator[Callable[[list[str]], Driver]]:
    """Makes a driver that is known to all; it does not speak yet."""
    made: list[Driver] = []
    yield lambda names: made.append(Driver(ros, names)) or made[-1]
    for one in made:
        one.ended.set()
        one.thread.join()


def sim(ros: Ros, **parameters: Any) -> SimNode:
    made: SimNode = ros.add(SimNode, models.scene("two_link"), **parameters)
    return made


def test_who_comes_second_refuses_to_start(
    ros: Ros, driver: Callable[..., Driver], tmp_path: Path
) -> None:
    """Unless it ticks by hand, or is in another namespace."""
    driver(["lift", *NAMES]).speaks.set()
    with pytest.raises(InvalidInput) as refused:
        sim(ros, record=str(tmp_path / "run.mcap"))
    said = str(refused.value)
    assert said.startswith("two nodes publish /joint_states: this sim, and '/driver'; allowed:")
    assert "namespace (--ros-args -r __ns:=/left)" in said and "ROS_DOMAIN_ID" in said
    assert not (tmp_path / "run.mcap").exists()
    by_hand(ros)
    ros.adopt(SimNode(models.scene("two_link"), context=ros.context, namespace="left"))


def test_a_predecessor_may_take_a_moment_to_end(ros: Ros, driver: Callable[..., Driver]) -> None:
    before = driver(NAMES)
    before.speaks.set()
    Timer(0.3, before.speaks.clear).start()
    sim(ros)


def test_a_publisher_that_is_silent_or_of_other_joints_is_no_rival(
    ros: Ros, driver: Callable[..., Driver]
) -> None:
    """One that was killed is still listed."""
    gripper = driver(["finger"])
    made = sim(ros)
    made.competitors.update()
    assert not made.competitors.alarm.message
    gripper.speaks.set()
    ros.spin_until(lambda: len(made.competitors._ignored) == 2)
    made.competitors.update()
    assert not made.competitors.alarm.message and made.competitors._subscription is None


def test_beside_a_rival_only_answers_to_its_states_move_a_sim(
    ros: Ros, driver: Callable[..., Driver], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "run.mcap"
    made = sim(ros, record=str(path))
    states = ros.listen(JointState, "/joint_states", 100)
    commands = ros.publisher(JointState, "/joint_commands")

    def answer() -> bool:
        ours = [state for state in states if state.effort]
        commands.publish(JointState(header=ours[-1].header, name=NAMES, effort=TAU))
        ros.spin_once()
        return True

    ros.spin_until(lambda: states and answer() and made.engine.commands.was_sent)
    rival = driver(NAMES)
    rival.message = b"\0\1\0\0rubbish"
    rival.speaks.set()
    ros.spin_until(lambda: made.competitors._subscription is not None)
    for _ in range(30):
        ros.spin_once()
        made.competitors.update()
    assert not made.competitors.alarm.message, "it is no joint state"
    rival.message = serialize_message(JointState(name=NAMES))
    ros.spin_until(lambda: made.competitors.alarm.message)
    assert "two nodes publish /joint_states: this sim, and '/driver'" in capfd.readouterr().err
    found = {f.part: f.message(made) for f in made.diagnostics()}["simulation"]
    assert found.level == DiagnosticStatus.ERROR
    assert made.competitors.alarm.message in found.message

    ros.spin_until(lambda: made.engine.commands.stale)
    refused = made.inputs.refused
    commands.publish(JointState(name=NAMES, effort=TAU))
    ros.spin_until(lambda: made.inputs.refused == refused + 1)
    ros.publisher(Float64MultiArray, "/sim/commands").publish(Float64MultiArray(data=TAU))
    ros.spin_until(lambda: made.inputs.refused == refused + 2)
    assert made.engine.commands.stale
    ros.spin_until(lambda: answer() and not made.engine.commands.stale)

    rival.speaks.clear()
    ros.spin_until(lambda: not made.competitors.alarm.message and made.engine.commands.stale)
    commands.publish(JointState(name=NAMES, effort=TAU))
    ros.spin_until(lambda: not made.engine.commands.stale)
    made.recorder.close()
    assert any("two nodes publish" in event.text for event in Recording.load(path).events)


def test_stamps_of_simulated_time_tell_no_sims_apart(
    ros: Ros, driver: Callable[..., Driver]
) -> None:
    """Two that start at zero have the same."""
    made, rival = sim(ros, lockstep=True), driver(NAMES)
    rival.speaks.set()
    ros.spin_until(lambda: made.competitors.alarm.message)
    assert made.engine.round_trip.awaits(0)
    assert made.inputs.on_joint_commands(command(name=NAMES, effort=TAU)) is None
    assert made.inputs.refused == 1
