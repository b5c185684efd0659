# SPDX-License-Identifier: Apache-2.0
"""What holds the arm until it is commanded, and stops it when commands stop."""

import time
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock, PropertyMock

import numpy as np
import pytest
from harness import Ros
from rclpy.parameter import Parameter
from sim_by_hand import NAMES, by_hand, command, motion, ticks

from arm_dynamics.exceptions import CompilerMissing
from arm_dynamics.ros.common.threads.background import Background
from arm_dynamics.ros.interfaces import RESET, SET_JOINT_STATE
from arm_sim.ros import SimNode
from arm_sim.ros.commands.latest import BRAKE, SERVO
from arm_sim.ros.commands.servos import Servos
from arm_sim.ros.commands.stopping import LONGEST, SLOW, Stopping
from arm_sim.ros.sim_params import SimParams
from models import features

pytestmark = pytest.mark.ros

SCENES: dict[str, Any] = {
    "panda": "panda",
    "flexible_arm": "flexible_arm",
    "slider_crank_motor": "slider_crank_motor",
    "bristles above a table": features.scene("planar", ("lugre", "contact")),
}


def braked(ros: Ros, scene: Any = "two_link", **parameters: Any) -> SimNode:
    """A node with the policy that is the default."""
    return by_hand(ros, scene, **{"stale_policy": SimParams().stale_policy, **parameters})


def place(node: SimNode) -> np.ndarray:
    return node.simulator.state.q.copy()


@pytest.mark.parametrize("name", SCENES)
def test_an_arm_stands_to_the_bit_until_the_first_command_and_after_the_last(
    ros: Ros, name: str
) -> None:
    """Drives, loops, contacts, springs: whatever pulls, and time goes on."""
    push = 20.0 if name == "slider_crank_motor" else 6.0
    node = braked(ros, SCENES[name], command_timeout=0.01)
    sim = node.simulator
    start = sim.arm.x.copy()
    ticks(node, 300)
    np.testing.assert_array_equal(sim.arm.x, start)
    assert sim.arm.step_count == 300
    assert node.engine.held == "brakes"
    names = list(sim.joint_names)
    for _ in range(60):
        node.inputs.on_joint_commands(command(name=names, effort=[push] * sim.n))
        node.tick()
    assert abs(sim.state.v).max() > 10 * SLOW
    ticks(node, 10 + round((LONGEST + 0.01) / sim.dt))
    still = sim.arm.x.copy()
    assert not sim.state.v.any()
    ticks(node, 100)
    np.testing.assert_array_equal(sim.arm.x, still)
    assert node.engine.held == "brakes"
    assert not sim.arm.acted.any()


def test_a_stop_takes_the_way_that_the_servos_need(ros: Ros) -> None:
    """Speeds fall as exp(-2 ω t): v/(2 ω) is left, and no joint turns back."""
    node = braked(ros, "panda", command_timeout=0.001)
    names = list(node.simulator.joint_names)
    speed = np.array([0.3, -0.2, 0.2, 0.1, -0.3, 0.2, 0.4])
    for _ in range(200):
        node.inputs.on_joint_commands(command(name=names, velocity=speed.tolist()))
        node.tick()
    before = place(node)
    ticks(node, 4)
    assert (np.sign(speed) * node.simulator.state.v > 5 * SLOW).all()
    assert node.engine.held != "brakes"
    ticks(node, 196)
    np.testing.assert_allclose(place(node) - before, speed / 200.0, rtol=0.2)


@pytest.mark.parametrize("policy", ["brake", "servo"])
def test_wherever_it_stands_it_is_held(ros: Ros, policy: str) -> None:
    """At the start, put elsewhere, and after a reset; a push moves what servos hold."""
    node = braked(ros, stale_policy=policy)
    request = SET_JOINT_STATE.type.Request(joint_names=NAMES, position=[0.4, -0.3])
    for service, given in (RESET, None), (SET_JOINT_STATE, request), (RESET, None):
        assert node.requests.answer(service, given).success
        there = place(node)
        ticks(node, 50)
        np.testing.assert_array_equal(place(node), there)
    node.engine.push("forearm", [5.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    ticks(node, 20)
    assert (place(node) != there).any() == (policy == "servo")


def test_servos_hold_where_it_was_stopped(ros: Ros) -> None:
    node = braked(ros, command_timeout=0.01, stale_policy="servo")
    for _ in range(40):
        node.inputs.on_joint_commands(command(name=list(NAMES), effort=[0.0, 0.0]))
        node.tick()
    ticks(node, 500)
    assert node.engine.held == "servos"
    still = place(node)
    assert abs(node.simulator.effort).max() > 1.0
    ticks(node, 100)
    np.testing.assert_array_equal(place(node), still)


def stopping_of(*speed: float, dt: float = 1e-3) -> tuple[SimpleNamespace, Stopping]:
    """An arm of two joints that has been led, and what stops it with servos that are there."""
    arm = SimpleNamespace(n=2, x=np.array([0.3, -0.2, *speed]), step_count=0, dt=dt)
    stopping = Stopping(arm, SimpleNamespace(request=lambda: True))
    stopping.release()
    return arm, stopping


@pytest.mark.parametrize("speed", [[0.0, 1.0], [-1.0, 0.0]])
def test_a_push_soon_after_it_stood_is_not_taken_for_its_motion(speed: list[float]) -> None:
    """Servos hold the place where it stood, though it has not been stopping for long."""
    arm, stopping = stopping_of(*speed)
    slowing = stopping.stop(SERVO)
    assert slowing is not None and slowing.velocity.tolist() == [0.0, 0.0]
    arm.x, arm.step_count = np.array([0.4, -0.1, 0.0, 0.0]), 1
    held = stopping.stop(SERVO)
    assert held is not None and held.position.tolist() == [0.4, -0.1]
    arm.x, arm.step_count = np.array([0.5, 0.0, *speed]), 2
    assert stopping.stop(SERVO) is held


def test_each_stop_may_take_its_own_time() -> None:
    """Up to the longest one; that of the stop before it does not count."""
    arm, stopping = stopping_of(1.0, -1.0, dt=0.25)
    for begin in (0, 100):
        stopping.release()
        slowed = []
        for arm.step_count in range(begin, begin + 6):
            slowed.append(stopping.stop(BRAKE) is not None)
        assert slowed == [True] * 4 + [False] * 2  # a second


def test_joints_below_a_millirad_per_second_are_held_at_once() -> None:
    for speed, slows in (1.01e-3, True), (-1.01e-3, True), (1e-3, False), (-1e-3, False):
        for joints in (speed, 0.0), (0.0, speed):
            assert (stopping_of(*joints)[1].stop(BRAKE) is not None) == slows


def test_servos_that_cannot_be_built_are_not_kept_quiet() -> None:
    """Else the brakes would hold the arm whatever positions are commanded, without a word."""
    compiled = Mock(has_servo=False)
    type(compiled).servo = PropertyMock(side_effect=CompilerMissing("no compiler"))
    background = Background("servos")
    servos = Servos(Mock(compiled=compiled), background)
    assert not servos.request()
    while not background.ready:
        time.sleep(1e-4)
    with pytest.raises(CompilerMissing):
        servos.request()
    background.close()


def test_reset_to_a_motion_it_stands_there_at_once(ros: Ros) -> None:
    """Though it was led before: until the first command it does not move."""
    node = braked(ros)
    node.inputs.on_joint_commands(command(name=list(NAMES), effort=[1.0, 2.0]))
    ticks(node, 3)
    node.engine.reset([0.4, -0.3], [1.0, -1.0])
    ticks(node, 5)
    np.testing.assert_array_equal(motion(node), [[0.4, -0.3], [0.0, 0.0]])
    assert node.engine.held == "brakes"


def test_another_policy_takes_over_in_motion(ros: Ros) -> None:
    node = braked(ros)
    start = place(node)
    for policy, count in ("zero", 50), ("brake", 1200):
        assert node.set_parameters([Parameter("stale_policy", value=policy)])[0].successful
        ticks(node, count)
        assert abs(place(node) - start).max() > 1e-3
    assert not node.simulator.state.v.any()


def test_a_place_does_not_grow_old_and_an_effort_does(ros: Ros) -> None:
    node = braked(ros, command_timeout=0.01)
    start = place(node)
    node.inputs.on_joint_commands(command(name=list(NAMES), position=start.tolist()))
    ticks(node, 100)
    assert not node.engine.commands.stale
    np.testing.assert_array_equal(place(node), start)
    node.inputs.on_joint_commands(command(name=list(NAMES), velocity=[0.0, 0.0]))
    ticks(node, 100)
    assert not node.engine.commands.stale
    node.inputs.on_joint_commands(command(name=list(NAMES), velocity=[0.1, 0.0]))
    ticks(node, 20)
    assert node.engine.commands.stale
