# SPDX-License-Identifier: Apache-2.0
"""The control law of the controller node: chosen at start, changed in motion, or refused."""

import time
from threading import Event
from typing import Any

import numpy as np
import pytest
from goal_client import Client, goal
from hand_goals import FRAME, HOME, see
from hand_goals import NAMES as JOINTS
from harness import Ros, change
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from two_link_control import MS, point, trajectory

import models
from arm_dynamics import InvalidInput
from arm_dynamics.control import Measured, Settings, make_controller
from arm_dynamics.ros import ControllerNode
from arm_dynamics.ros.controller import selection as module
from arm_dynamics.task_space import TaskSpace
from arm_dynamics.trajectory import Reference
from tolerances import ALGEBRA, assert_close

pytestmark = pytest.mark.ros


def controller_node(ros: Ros, **parameters: Any) -> ControllerNode:
    return ros.add(ControllerNode, models.scene("panda"), **parameters)


def settle(node: ControllerNode) -> None:
    """Wait until what is prepared in the background is ready; it is taken in the next tick."""
    end = time.monotonic() + 20.0
    while node.busy and time.monotonic() < end:
        time.sleep(0.01)
        node.deliver()
    assert not node.busy


def go(node: ControllerNode, offset: float, seconds: int) -> None:
    """Lead every joint away from home."""
    there = point(seconds, *(HOME + offset).tolist())
    node.on_joint_trajectory(trajectory(there, names=JOINTS))


def test_the_law_is_the_one_of_the_core(ros: Ros) -> None:
    """With every setting, at start and after a change; at rest it presses as the node was told."""
    dynamics = models.dynamics("panda")
    q, v = HOME + 0.02, np.full(7, 0.1)
    sideways = TaskSpace(dynamics, FRAME, selection="position").jacobian(HOME)[1]
    still = Reference(HOME, np.zeros(7), np.zeros(7))
    given = {"task_frame": FRAME, "task_axes": "position", "force": 5.0}
    more = {"force_direction": [0.0, 1.0, 0.0], "friction": True, "damping_ratio": [0.8]}
    node = controller_node(ros, controller="motion_force", switch_time=0.0, **given, **more)
    settings = Settings(
        damping_ratio=0.8, frame=FRAME, axes="position", direction=(0.0, 1.0, 0.0), force=5.0,
        friction=True,
    )  # fmt: skip
    assert_close(see(node, 0), dynamics.gravity(HOME) + 5.0 * sideways, 1e-8)
    law = make_controller("motion_force", dynamics, settings)
    assert_close(see(node, MS, q, v), law.torque(Measured(q, v), still), ALGEBRA)
    assert change(node, controller="joint_impedance", force=0.0).successful
    settle(node)
    law = make_controller("joint_impedance", dynamics, settings)
    see(node, 2 * MS, q, v)
    assert_close(see(node, 3 * MS, q, v), law.torque(Measured(q, v), still), ALGEBRA)


def test_a_bandwidth_that_the_loop_does_not_carry_is_told_or_refused(
    ros: Ros, capfd: pytest.CaptureFixture[str]
) -> None:
    node = controller_node(ros)
    for bandwidth, stamp, said in (
        (300.0, MS, "act 0.001 s late and are held for 0.001 s; sensible: at most 239 rad/s"),
        (200.0, 4 * MS, "act 0.004 s late and are held for 0.001 s; sensible: at most 79.8 rad/s"),
        (20.0, 6 * MS, ""),
    ):
        see(node, 0), see(node, stamp)
        node._lateness.end_second()
        assert change(node, bandwidth=bandwidth).successful
        assert said in capfd.readouterr().err
        assert ("sensible" in node.diagnostics()[0].message(node).message) == bool(said)
    result = change(node, bandwidth=3000.0)
    assert "at most 432 rad/s" in result.reason and not result.successful
    assert node.params.settings.bandwidth == 20.0


def test_gains_of_a_law_that_remembers_fade_in(ros: Ros) -> None:
    node = controller_node(ros, controller="pid", bandwidth=[10.0])
    for k in range(50):
        before = see(node, k * MS, HOME + 0.05 * (k > 0))
    assert change(node, bandwidth=12.0).successful
    np.testing.assert_array_equal(see(node, 50 * MS, HOME + 0.05), before)


def test_time_that_goes_backwards_clears_the_memory(ros: Ros) -> None:
    node = controller_node(ros, controller="pid")
    fresh = see(node, 1000 * MS)
    for k in range(1001, 1200):
        see(node, k * MS, HOME + 0.1)
    assert abs(see(node, 1200 * MS) - fresh).max() > 1.0
    np.testing.assert_array_equal(see(node, 0), fresh)


def test_after_floating_the_arm_is_held_where_it_was_led_to(ros: Ros) -> None:
    """And not pulled back to where it was when floating began."""
    node = controller_node(ros, controller="float", switch_time=0.0)
    see(node, 0)
    led = HOME + 0.4
    assert_close(see(node, MS, led), models.dynamics("panda").gravity(led), ALGEBRA)
    assert change(node, controller="computed_torque").successful
    settle(node)
    see(node, 2 * MS, led)  # the hand-over begins with the torque of before
    assert node.params.controller == "computed_torque" and not node.busy
    assert_close(node.goals.follower.reference(3 * MS).q, led, ALGEBRA)
    assert_close(see(node, 3 * MS, led), models.dynamics("panda").gravity(led), ALGEBRA)
    assert abs(see(node, 4 * MS, led + 0.1) - see(node, 4 * MS, led)).max() > 1.0
    go(node, 0.1, 1)
    assert change(node, bandwidth=8.0).successful
    settle(node)
    assert node.goals.follower is not None and node.goals.follower.remaining(4 * MS) > 0.9


def test_a_controller_that_cannot_be_prepared_is_not_taken_for_the_one_that_acts(
    ros: Ros, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """An arm that is still led by hand follows no goals."""

    def fail() -> None:
        raise InvalidInput("no compiler")

    node = controller_node(ros, controller="float")
    see(node, 0)
    settle(node)
    monkeypatch.setattr(module, "preparation", lambda control: fail)
    assert change(node, controller="pd_gravity", bandwidth=8.0).successful
    settle(node)
    assert node.params.controller == "float" and node.params.settings.bandwidth == 20.0
    assert "stay in force: no compiler" in capfd.readouterr().err
    assert node.diagnostics()[0].values["controller"] == "float"
    point = JointTrajectoryPoint(positions=HOME.tolist())
    point.time_from_start.sec = 1
    there = JointTrajectory(joint_names=JOINTS, points=[point])
    assert not Client(ros).send(goal(there)).accepted
    assert "'float' follows no trajectories" in node.goals.outcome
    ros.spin_until(lambda: node.get_parameter("controller").value == "float")
    assert change(node, controller="pd_gravity").successful and node.busy  # not taken for done


def test_the_newest_choice_counts_whatever_was_being_prepared(
    ros: Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A controller that is ready late does not take the place of one that was chosen since."""
    node = controller_node(ros, switch_time=0.0, bandwidth=[4.0])
    see(node, 0)
    settle(node)
    ready = Event()
    jobs = [lambda: ready.wait(20.0), None]  # the second one needs no preparation
    monkeypatch.setattr(module, "preparation", lambda control: jobs.pop(0))
    assert change(node, controller="pd").successful
    assert node.busy
    assert change(node, controller="pd_gravity").successful
    ready.set()
    settle(node)
    still = Reference(HOME, np.zeros(7), np.zeros(7))
    chosen = make_controller("pd_gravity", models.dynamics("panda"), Settings(bandwidth=4.0))
    see(node, MS, HOME + 0.1)
    exact = chosen.torque(Measured(HOME + 0.1, np.zeros(7)), still)
    assert_close(see(node, 2 * MS, HOME + 0.1), exact, ALGEBRA)


BAD = [
    ({"controller": "operational_space"}, "frame (task_frame of the node) is not given"),
    ({"task_frame": "paw"}, "frame 'paw' does not exist"),
    (
        {"controller": "operational_space", "task_frame": FRAME, "bandwidth": [9.0] * 7},
        "allowed: a number or shape",
    ),
    ({"controller": "pd", "bandwidth": [-1.0]}, "bandwidth"),
    ({"observer": 2000.0}, "product must stay below one"),
]


def test_bad_settings_in_motion_are_refused_and_the_law_goes_on(ros: Ros) -> None:
    node = controller_node(ros)
    see(node, 0)
    exact, before = see(node, MS, HOME + 0.1), node.params
    for values, complaint in BAD:
        result = change(node, **values)
        assert not result.successful
        assert complaint in result.reason
        assert node.params == before
        np.testing.assert_array_equal(see(node, 2 * MS, HOME + 0.1), exact)
    result = change(node, switch_time=1.0)
    assert not result.successful
    assert "read-only" in result.reason


def test_a_scene_without_friction_is_reported(ros: Ros, capfd: pytest.CaptureFixture[str]) -> None:
    assert change(ros.add(ControllerNode, "ur5e"), friction=True).successful
    assert "friction = true: the controller's scene has none" in capfd.readouterr().err
