# SPDX-License-Identifier: Apache-2.0
"""The sim node records itself; topics are recorded and played."""

from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import WrenchStamped
from harness import Ros
from rcl_interfaces.msg import Log
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from recorded_engine import contents
from sensor_msgs.msg import JointState
from sim_by_hand import NAMES, by_hand, command, commands_to_come, ticks
from std_msgs.msg import Float64MultiArray

from arm_dynamics import ArmError, InvalidInput
from arm_dynamics.ros import ControllerNode, DynamicsNode
from arm_dynamics.ros.interfaces import EVERY
from arm_sim import Recording, Simulator
from arm_sim.recording.files import messages
from arm_sim.replay import replay
from arm_sim.ros import SimNode
from arm_sim.ros.record.definitions import definition_of
from arm_sim.ros.record.player import Player
from arm_sim.ros.record.topics import TopicRecorder

pytestmark = pytest.mark.ros


def test_our_definitions_are_those_that_are_installed() -> None:
    def bare(text: str) -> list[str]:
        lines = [line.partition("#")[0].replace(" ", "") for line in text.splitlines()]
        return sorted(line for line in lines if line and "=" not in line)

    for kind in messages._OWN:
        assert bare(messages.definition(kind)) == bare(definition_of(kind)), kind


def test_a_node_records_its_inputs_outputs_and_changes(ros: Ros, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    node = by_hand(ros, record=str(path), stale_policy="zero")
    waiting = commands_to_come(node)
    ticks(node, 20)
    raw = command(name=NAMES, effort=[1.5, -0.5])
    waiting.append(raw)
    node.inputs.on_joint_commands(raw)
    ticks(node, 30)
    node.inputs.on_commands(Float64MultiArray(data=[0.5, 0.5]))
    push = WrenchStamped()
    push.header.frame_id, push.wrench.force.z = "forearm", 3.0
    node.inputs.on_wrench(push)
    ticks(node, 30)
    node.engine.reset()
    assert node.set_parameters([Parameter("stale_policy", value="gravity")])[0].successful
    ticks(node, 20)
    states = node.recorder.ticks
    node.recorder.close()
    found = contents(path)
    assert states == 100 == len(found["/sim/ticks"])
    assert found["/joint_commands"][0] == bytes(raw)
    wrench = deserialize_message(found["/sim/wrench"][0], WrenchStamped)
    assert wrench.wrench.force.z == 3.0
    (told,) = [data for data in found["/sim/events"] if b"parameters: " in data]
    assert b"stale_policy='gravity'" in told
    event = deserialize_message(told, Log)
    assert (event.level, event.name) == (20, "sim")  # INFO
    (numbers,) = found["/sim/commands"]
    assert list(deserialize_message(numbers, Float64MultiArray).data) == [0.5, 0.5]
    last = deserialize_message(found["/joint_states"][-1], JointState)
    assert last.name == NAMES
    assert list(last.position) == node.simulator.state.q.tolist()
    loaded = Recording.load(path)
    assert len(loaded) == 101 and replay(loaded).equal


def test_a_bag_of_a_node_has_its_metadata(ros: Ros, tmp_path: Path) -> None:
    node = by_hand(ros, record=str(tmp_path / "bag-{time}"))
    ticks(node, 10)
    node.recorder.close()
    (folder,) = tmp_path.glob("bag-*")
    assert "{" not in folder.name and (folder / "metadata.yaml").exists()
    assert len(Recording.load(folder)) == 11
    with pytest.raises(InvalidInput, match="nowhere"):
        by_hand(ros, record=str(tmp_path / "nowhere/run.mcap"))


def test_diagnostics_report_the_recording(ros: Ros, tmp_path: Path) -> None:
    node = by_hand(ros, record=str(tmp_path / "run.mcap"))
    ticks(node, 10)
    (finding,) = [found for found in node.diagnostics() if found.part == "recording"]
    assert (finding.values["ticks"], finding.values["ticks lost"]) == (10, 0)
    assert finding.message(node).message == "ok"
    thread = node.recorder.thread
    node.recorder.lost, thread.lost = 2, 3
    thread.trouble, thread.failure = "the disk is full", "recording stopped"
    (finding,) = [found for found in node.diagnostics() if found.part == "recording"]
    assert finding.values["ticks lost"] == 2 and finding.values["messages lost"] == 3
    assert finding.message(node).level == DiagnosticStatus.ERROR
    for said in "2 time steps not in the recording: the disk is full", "recording stopped":
        assert said in finding.message(node).message


NODES = [SimNode, ControllerNode, DynamicsNode, TopicRecorder, Player]


@pytest.mark.parametrize("kind", NODES)
def test_a_node_that_could_not_be_built_can_be_destroyed(kind: Any, ros: Ros) -> None:
    """Kilted's rclpy does that at the end of the context."""

    class Kept(kind):
        made: Any = None

        def __init__(self, *args: Any, **more: Any) -> None:
            type(self).made = self
            super().__init__(*args, **more)

    unusable = Path(__file__).parent if kind is TopicRecorder else Path("nowhere.yaml")
    with pytest.raises(ArmError, match=unusable.name):
        Kept(unusable, context=ros.context)
    Kept.made.destroy_node()


def test_topics_are_recorded_as_they_come_and_played_again(ros: Ros, tmp_path: Path) -> None:
    publisher = ros.peer.create_publisher(JointState, "states", EVERY)
    recorder = ros.add(TopicRecorder, tmp_path / "run.mcap", ("states", "nobody"))
    ros.spin_until(lambda: recorder.discover() or "/states" in recorder.count)
    ros.spin_until(lambda: publisher.get_subscription_count() > 0)
    for k in range(20):
        message = JointState(name=["a", "b"], position=[float(k), 0.5])
        message.header.stamp.nanosec = 1_000_000 * (k + 1 + 4 * (k > 9))
        publisher.publish(message)
    ros.spin_until(lambda: recorder.count["/states"] == 20)
    assert recorder.missing == ("/nobody",) and recorder.gaps == {"/states": 4}
    recorder.thread.close()
    loaded = Recording.load(tmp_path / "run.mcap")
    np.testing.assert_array_equal(loaded.q[:, 0], np.arange(20.0))
    assert loaded.gaps == (10,) and "4 joint states are missing" in loaded.events[0].text
    ros.peer.destroy_publisher(publisher)

    heard: list[float] = []
    ros.peer.create_subscription(
        JointState, "states", lambda message: heard.append(message.position[0]), 100
    )
    player = ros.add(Player, tmp_path / "run.mcap")
    ros.spin_until(lambda: player.count_subscribers("/states") > 0)
    player.start(rate=0.0)
    ros.spin_until(lambda: len(heard) == 20)
    assert heard == list(range(20)) and player.count == 20


def test_hidden_topics_are_recorded_by_name_only(ros: Ros, tmp_path: Path) -> None:
    for topic in ("states", "hidden/_states"):
        ros.peer.create_publisher(JointState, topic, EVERY)
    every = ros.add(TopicRecorder, tmp_path / "every.mcap")
    named = ros.add(TopicRecorder, tmp_path / "named.mcap", ("hidden/_states",))
    ros.spin_until(lambda: {"/states"} <= every.count.keys() and len(named.count) == 1)
    assert "/hidden/_states" not in every.count and not named.gaps


@pytest.mark.parametrize("rate", [2.0, 0.0])
def test_messages_are_played_at_their_times(
    rate: float, ros: Ros, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By a clock that goes on while the player waits, and is always a little late."""
    (tmp_path / "robot.csv").write_text("time,position.a\n5,0\n5.04,1\n5.1,2\n")
    player, now, at = ros.add(Player, tmp_path / "robot.csv"), [50.0], list[float]()
    assert not player.done and player.duration == pytest.approx(0.1)

    def wait(seconds: float) -> bool:
        now[0] += seconds + 0.001
        return False

    monkeypatch.setattr("arm_sim.ros.record.player.time", Mock(monotonic=lambda: now[0]))
    topic = Mock(publish=lambda raw: at.append(now[0] - 50.0))
    player._pending = [(log, topic, raw) for log, _, raw in player._pending]
    player._stop = Mock(wait=wait)
    player.start(rate)
    player._thread.join(10.0)
    assert player.done and player.count == 3
    np.testing.assert_allclose(at, [0.001, 0.021, 0.051] if rate else [0.001, 0.002, 0.003])


def test_a_player_that_is_destroyed_stops(ros: Ros, tmp_path: Path) -> None:
    (tmp_path / "robot.csv").write_text("time,position.a\n0,0\n3600,1\n")
    player = ros.add(Player, tmp_path / "robot.csv")
    with pytest.raises(InvalidInput, match="rate"):
        player.start(-1.0)
    player.start()
    ros.spin_until(lambda: player.count == 1)
    player.destroy_node()
    assert player.count == 1 and player.done


def test_of_our_files_what_nodes_understand_is_played_or_what_is_named(
    ros: Ros, tmp_path: Path
) -> None:
    path = Simulator("two_link").run(0.02).save(tmp_path / "run.mcap")

    def topics(*names: str) -> set[str]:
        player = ros.add(Player, path, names)
        return {publisher.topic_name for _, publisher, _ in player._pending}

    every = topics()
    assert "/joint_states" in every and "/sim/ticks" not in every
    assert topics("/joint_states") == {"/joint_states"}
    with pytest.raises(InvalidInput, match=r"has no topic /joint_state; .* mean '/joint_states'"):
        Player(path, ("/joint_states", "/joint_state"), context=ros.peer.context)


def test_a_recorder_hears_every_publisher_of_a_topic(ros: Ros, tmp_path: Path) -> None:
    """Those that were there before and a weaker one; and earlier messages if all keep these."""
    recorder = ros.add(TopicRecorder, tmp_path / "run.mcap", ("states",))
    latched, passing, lossy = (QoSProfile(depth=1) for _ in range(3))
    latched.durability = DurabilityPolicy.TRANSIENT_LOCAL
    lossy.reliability = ReliabilityPolicy.BEST_EFFORT
    for count, weakest in enumerate((latched, passing, lossy), 1):
        ros.peer.create_publisher(JointState, "states", weakest)
        ros.spin_until(lambda count=count: recorder.count_publishers("/states") == count)
        recorder.count.clear()
        recorder.discover()
        *_, taken = (each.qos_profile for each in recorder.subscriptions)
        assert taken.reliability == weakest.reliability
        assert taken.durability == weakest.durability
