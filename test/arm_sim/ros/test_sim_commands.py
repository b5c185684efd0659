# SPDX-License-Identifier: Apache-2.0
"""Commands to the sim node, ticked by hand: efforts, velocities and positions, by some joints, as
the hardware of ros2_control sends them.
"""

from typing import Any

import numpy as np
import pytest
from harness import Ros
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from sim_by_hand import NAMES, TAU, by_hand, command, motion, next_command, ticks
from std_msgs.msg import Float64MultiArray, Header

import models
from arm_dynamics.ros.common.convert import to_time
from arm_dynamics.ros.interfaces import RESET, STEP
from arm_sim.ros import SimNode
from arm_sim.ros.interfaces import COMMANDS

pytestmark = pytest.mark.ros

NAN = float("nan")
PANDA = list(models.dynamics("panda").joint_names)
START = models.dynamics("panda").model.q0


@pytest.fixture
def node(ros: Ros) -> SimNode:
    """A two-link arm whose ticks are triggered by hand."""
    return by_hand(ros)


@pytest.fixture
def panda(ros: Ros) -> SimNode:
    """A Panda whose ticks are triggered by hand, with its brakes on."""
    return by_hand(ros, "panda", stale_policy="brake")


def send(node: SimNode, name: list[str], source: str = "", **fields: Any) -> None:
    header = Header(frame_id=source)
    node.inputs.on_joint_commands(command(header=header, name=name, **fields))


def test_quality_of_service(ros: Ros) -> None:
    """Best effort where the newest counts, so that every publisher will do."""
    node = by_hand(ros, publish_clock=True)
    effort, every = ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.RELIABLE
    for topic, reliability in (
        ("/joint_commands", effort), ("/sim/commands", effort), ("/sim/wrench", every),
        ("/joint_states", every), ("/sim/energy", every), ("/clock", every),
    ):  # fmt: skip
        (end,) = (
            *node.get_subscriptions_info_by_topic(topic), *node.get_publishers_info_by_topic(topic)
        )  # fmt: skip
        assert end.qos_profile.reliability == reliability
        assert end.qos_profile.durability == DurabilityPolicy.VOLATILE
    assert COMMANDS.subscribe.depth == 1, "of bare commands only the newest is taken"


def test_bad_commands_are_passed_over(node: SimNode, capfd: pytest.CaptureFixture[str]) -> None:
    node.inputs.on_joint_commands(command(name=NAMES, effort=TAU))
    bad: tuple[dict[str, Any] | list[float], ...] = (
        {"name": ["nobody"], "effort": [1.0]}, {"name": NAMES, "effort": [1.0, NAN]},
        {"name": NAMES, "position": [1.0]}, {"name": NAMES, "velocity": [np.inf, 1.0]},
        {"name": NAMES}, {}, [], [1.0] * 3, [NAN, 0.0],
    )  # fmt: skip
    for count, given in enumerate(bad, 1):
        if isinstance(given, dict):
            node.inputs.on_joint_commands(command(**given))
        else:
            node.inputs.on_commands(Float64MultiArray(data=given))
        acting = next_command(node.engine.commands, node.simulator.state.q)
        np.testing.assert_array_equal(acting, TAU)
        assert node.inputs.refused == count
    assert "command ignored: unknown joints nobody" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("topic", "effort"), [("joint_commands", 1000.0), ("~/commands", -1000.0)]
)
def test_effort_beyond_its_limit_is_clipped_and_reported_once(
    panda: SimNode, topic: str, effort: float,
    capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture,
) -> None:  # fmt: skip
    efforts = [1.0, effort, 0.0, 0.0, 0.0, effort, -2.0]
    for _ in range(4):
        if topic == "joint_commands":
            panda.inputs.on_joint_commands(command(name=PANDA, effort=efforts))
        else:
            panda.inputs.on_commands(Float64MultiArray(data=efforts))
        panda.tick()
    limit = panda.simulator.model.effort_limit
    np.testing.assert_array_equal(panda.simulator.effort, np.clip(efforts, -limit, limit))
    told = f"command {effort:g} N m of joint 'panda_joint2' exceeds its limit of {limit[1]:g} N m"
    assert capfd.readouterr().err.count(told) == 1
    assert not caplog.records  # the simulation itself has nothing to add


@pytest.mark.parametrize("policy", ["zero", "hold", "gravity"])
def test_old_commands_give_way_to_the_policy(
    ros: Ros, policy: str, capfd: pytest.CaptureFixture[str]
) -> None:
    """As before the first command, but that ``hold`` then has something to hold."""
    node = by_hand(ros, command_timeout=0.005, stale_policy=policy)
    sim = models.simulator("two_link")
    for count in range(-5, 30):
        if count == 0:
            node.inputs.on_commands(Float64MultiArray(data=TAU))
        wanted = np.zeros(2)
        if policy == "gravity":
            wanted = sim.dynamics.gravity(sim.state.q)
        if 0 <= count < 5 or (policy == "hold" and count >= 5):
            wanted = np.array(TAU)
        node.tick()
        sim.step(wanted)
        np.testing.assert_array_equal(motion(node), [sim.state.q, sim.state.v])
    assert capfd.readouterr().err.count(f"(stale_policy: {policy})") == 1
    node.inputs.on_commands(Float64MultiArray(data=TAU))
    node.tick()
    assert "commands have resumed" in capfd.readouterr().err
    ticks(node, 10)
    assert node.engine.commands.stale
    node.requests.answer(RESET)
    node.tick()
    assert "commands have resumed" not in capfd.readouterr().err, "a reset is no command"


def test_by_name_in_any_order_and_some_joints_only(panda: SimNode) -> None:
    """Joints that were never commanded get no effort; others keep their last command."""
    send(panda, PANDA, position=START.tolist())
    ticks(panda, 10)
    send(panda, [PANDA[6], PANDA[0]], position=[START[6] + 0.02, 0.03])
    ticks(panda, 400)
    wanted = [0.03, *START[1:6], START[6] + 0.02]
    np.testing.assert_allclose(panda.simulator.state.q, wanted, atol=1e-9)
    panda.engine.reset()
    send(panda, PANDA[:1], position=[0.0])
    panda.tick()
    np.testing.assert_array_equal(panda.simulator.effort[1:], 0.0)


@pytest.mark.parametrize("kind", ["position", "effort"])
def test_a_first_command_of_some_joints_names_the_others(
    panda: SimNode, kind: str, capfd: pytest.CaptureFixture[str]
) -> None:
    """The brakes of all are released."""
    for joint in panda.simulator.joint_names[:2]:
        send(panda, [joint], **{kind: [0.0]})
        panda.tick()
    told = capfd.readouterr().err
    assert told.count("have no command yet") == 1
    assert "joints panda_joint2, " in told and "panda_joint1" not in told


def test_efforts_between_positions(panda: SimNode) -> None:
    send(panda, PANDA, position=START.tolist())
    send(panda, PANDA[6:], effort=[0.25])
    panda.tick()
    assert panda.simulator.effort[6] == 0.25
    assert abs(panda.simulator.effort[1]) > 1.0  # holds against its weight
    send(panda, PANDA, effort=[0.5] * 7)
    panda.tick()
    np.testing.assert_array_equal(panda.simulator.effort, 0.5)


def test_what_is_nan_is_not_commanded(panda: SimNode) -> None:
    """As the hardware of ros2_control sends what no controller has claimed."""
    send(panda, PANDA, position=[NAN] * 7, effort=[NAN] * 7)
    ticks(panda, 20)
    np.testing.assert_array_equal(panda.simulator.state.q, START)
    assert panda.engine.held == "brakes"
    assert panda.inputs.refused == 0
    send(panda, PANDA, position=[*START[:6], NAN], effort=[NAN] * 6 + [0.1])
    panda.tick()
    assert panda.simulator.effort[6] == 0.1


def test_two_sources_lead_joints_by_position_and_by_effort(node: SimNode) -> None:
    start = node.simulator.state.q
    for _ in range(50):
        send(node, NAMES[:1], "left", position=start[:1].tolist())
        send(node, NAMES[1:], "right", effort=[0.3])
        node.tick()
    assert node.simulator.effort[1] == 0.3
    assert abs(node.simulator.state.q[0] - start[0]) < 1e-2
    assert set(node.engine.arbiter.sources) == {"left", "right"}


def test_who_commands_nothing_owns_nothing(node: SimNode) -> None:
    """Hardware that no controller has claimed, beside one that leads; and two that lead."""
    start = node.simulator.state.q.tolist()
    for _ in range(20):
        send(node, NAMES, position=[NAN, NAN])
    for _ in range(20):
        send(node, NAMES, "leader", position=start)
        node.tick()
    assert node.inputs.refused == 0
    send(node, NAMES, position=[0.0, 0.0])
    assert node.inputs.refused == 1
    node.tick()
    assert abs(node.simulator.state.q - start).max() < 1e-9


def test_steps_of_a_paused_simulation_wait_for_the_servos(ros: Ros) -> None:
    """In a node that ticks by the clock they are built in the background."""
    node = ros.add(SimNode, models.scene("two_link"), paused=True)
    goal = node.simulator.state.q + 0.01
    send(node, NAMES, position=goal.tolist())
    assert node.requests.answer(STEP, STEP.type.Request(steps=300)).success
    np.testing.assert_allclose(node.simulator.state.q, goal, atol=1e-8)


class TopicHardware:
    """The hardware without its controller manager, on a Panda, with commands of one kind.

    It behaves as its source does, ros-controls/topic_based_hardware_interfaces,
    joint_state_topic_hardware_interface.cpp: a cycle publishes the commands of all joints, unless
    Σ|state - command| is within a threshold.
    """

    def __init__(self, ros: Ros, field: str, threshold: float = 1e-5, **parameters: float) -> None:
        self.node = by_hand(ros, "panda", stale_policy="brake", **parameters)
        self.simulator = self.node.simulator
        self._field, self._threshold = field, threshold
        self.command, self.published = self.simulator.state.q, 0

    def cycle(self) -> None:
        """One update of the controller manager, and a tick."""
        sim = self.simulator
        state = sim.state.q if self._field == "position" else sim.effort
        if abs(state - self.command).sum() > self._threshold:
            stamp = to_time(1 + self.node.engine.stamp)
            given = {"header": Header(stamp=stamp), self._field: self.command.tolist()}
            self.node.inputs.on_joint_commands(command(name=PANDA, **given))
            self.published += 1
        self.node.tick()


def test_a_static_hold_moves_no_bit(ros: Ros) -> None:
    """Before the first command by brakes, after a motion by servos; the hardware is silent."""
    hardware = TopicHardware(ros, "position", publish_every=1000)
    simulator, start = hardware.simulator, hardware.command.copy()
    for _ in range(100):
        hardware.cycle()
    assert hardware.published == 0
    np.testing.assert_array_equal(simulator.state.q, start)
    for s in np.linspace(0.0, 1.0, 1000):
        hardware.command = start + 0.2 * (10 * s**3 - 15 * s**4 + 6 * s**5)
        hardware.cycle()
    for _ in range(1000):
        hardware.cycle()
    sent, still = hardware.published, simulator.state.q.copy()
    ticks(hardware.node, 5_000)
    np.testing.assert_array_equal(simulator.state.q, still)
    hardware.cycle()
    assert hardware.published == sent
    np.testing.assert_allclose(still, start + 0.2, atol=1e-5 / 7)


@pytest.mark.parametrize(("threshold", "silent"), [(1e-5, True), (-1.0, False)])
def test_torques_want_a_threshold_of_minus_one(ros: Ros, threshold: float, silent: bool) -> None:
    """A torque that acts is what is measured: with the default the next one is not sent."""
    hardware = TopicHardware(ros, "effort", threshold, command_timeout=0.05)
    hardware.command = hardware.simulator.dynamics.gravity(hardware.command)
    for _ in range(100):
        hardware.cycle()
    assert (hardware.node.engine.commands.stale_count > 0) == silent
    assert (hardware.published == 100) != silent
