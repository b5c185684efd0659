# SPDX-License-Identifier: Apache-2.0
"""The sim node with sensors and delays: what it publishes, and when commands act."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from harness import Ros
from sensor_msgs.msg import JointState
from sim_by_hand import by_hand, ticks
from std_msgs.msg import Float64MultiArray

import models
from arm_sim import Recording, Simulator
from arm_sim.ros import SimNode
from arm_sim.ros.tick_engine import TickEngine

pytestmark = pytest.mark.ros

PLAIN = models.scene("two_link").model_dump(exclude_unset=True)
SENSORS = {"position": {"resolution": 1e-2}, "effort": {"offset": 0.5}, "delay": 0.002}


def node_with(ros: Ros, sensors: Any = None, commands: Any = None, **parameters: Any) -> SimNode:
    scene = {**PLAIN, "sensors": sensors, "commands": commands}
    return by_hand(ros, scene, stale_policy="zero", **parameters)


def test_joint_states_carry_sensor_readings_and_ground_truth_is_a_separate_topic(ros: Ros) -> None:
    assert not node_with(ros).count_publishers("/sim/ground_truth")
    node = node_with(ros, SENSORS)
    told = ros.listen(JointState, "/joint_states", 50)
    true = ros.listen(JointState, "/sim/ground_truth", 50)
    states = [node.simulator.state]
    node.inputs.on_commands(Float64MultiArray(data=[0.0, 0.25]))
    for count in range(1, 6):
        node.tick()
        states.append(node.simulator.state)
        ros.spin_until(lambda count=count: min(len(told), len(true)) >= count)
    np.testing.assert_array_equal([list(m.position) for m in true], [s.q for s in states[1:]])
    np.testing.assert_array_equal(true[-1].effort, [0.0, 0.25])
    for k, message in enumerate(told[1:], start=2):
        late = states[k - 2]
        np.testing.assert_allclose(message.position, np.rint(late.q / 0.01) * 0.01, atol=1e-12)
        np.testing.assert_array_equal(message.velocity, late.v)
        assert message.header.stamp.nanosec == k * 1_000_000  # when it is known
    np.testing.assert_array_equal(told[-1].effort, [0.5, 0.75])


def test_a_recording_has_what_sensors_told_also_after_resets(ros: Ros, tmp_path: Path) -> None:
    path, every = tmp_path / "run.mcap", 3
    node = node_with(ros, SENSORS, record=str(path), publish_every=every)
    node.inputs.on_commands(Float64MultiArray(data=[1.0, 0.25]))
    told = []
    for _ in range(3):
        for _ in range(12):
            node.tick()
            told.append(node.simulator.arm.sensors.measured.copy())
        node.engine.reset()
    assert node.recorder is not None
    node.recorder.close()
    loaded = Recording.load(path)
    assert loaded.measured is not None and len(loaded) == 37
    found = np.hstack([loaded.measured.q, loaded.measured.v, loaded.measured.effort])[1:]
    rows = np.isfinite(found).all(axis=1)
    np.testing.assert_array_equal(np.flatnonzero(rows), np.arange(every - 1, 36, every))
    np.testing.assert_array_equal(found[rows], np.array(told)[rows])


def acting(node: SimNode | TickEngine, count: int) -> list[float]:
    """Torque of the second joint in each of some ticks."""
    found = []
    for _ in range(count):
        node.tick()
        found.append(float(node.simulator.effort[1]))
    return found


@pytest.mark.parametrize("waits", [False, True])
def test_commands_act_when_they_arrive_and_no_sooner(ros: Ros, waits: bool) -> None:
    """Time that waits for a command, also after a reset, goes on when one is on the way."""
    node = node_with(ros, commands={"delay": 0.003}, wait_for_command=waits)
    for _ in range(2 * waits):
        ticks(node, 3)
        assert node.simulator.arm.step_count == 0
        node.inputs.on_commands(Float64MultiArray(data=[0.0, 3.0]))
        ticks(node, 3)
        assert node.simulator.arm.step_count == 3
        node.engine.reset()
    node.inputs.on_commands(Float64MultiArray(data=[0.0, 1.0]))
    first = acting(node, 2)
    node.inputs.on_commands(Float64MultiArray(data=[0.0, 2.0]))
    assert first + acting(node, 5) == [0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 2.0]


def test_a_held_command_is_lost_once_and_not_again_in_each_tick() -> None:
    """Whether the one command arrives is up to one draw: for some seeds it never does."""
    outcomes = set()
    for seed in range(5):
        lossy = {**PLAIN, "sensors": {"seed": seed}, "commands": {"loss": 0.5}}
        engine = TickEngine(Simulator(lossy), wrench_timeout=0.1, wrench_reference="local")
        engine.commands.put((0.0, 1.0))
        outcomes.add(tuple(acting(engine, 10)))
    assert outcomes == {(0.0,) * 10, (1.0,) * 10}


def test_a_delayed_command_becomes_stale_unless_it_is_sent_again() -> None:
    simulator, command = Simulator({**PLAIN, "commands": {"delay": 0.002}}), (0.0, 1.0)
    engine = TickEngine(simulator, wrench_timeout=0.1, wrench_reference="local")
    engine.configure(0.003, "zero")
    for _ in range(9):
        engine.commands.put(command)
        engine.tick()
    assert simulator.effort[1] == 1.0
    assert acting(engine, 8) == [1.0] * 4 + [0.0] * 4, "it acts for three ticks from its arrival"


def test_a_reset_forgets_commands_on_the_way(ros: Ros) -> None:
    node = node_with(ros, SENSORS, {"delay": 0.002})
    for before in (1, 0):  # ticks since it was sent
        node.inputs.on_commands(Float64MultiArray(data=[0.0, 1.0]))
        ticks(node, before)
        node.engine.reset()
        assert acting(node, 5) == [0.0] * 5
