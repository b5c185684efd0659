# SPDX-License-Identifier: Apache-2.0
"""Answers of C equal those of Python to the bit; Python answers all other states."""

import os
import time
from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from arm_msgs.msg import TrackingState
from controller_pair import MS, side_by_side
from geometry_msgs.msg import PoseStamped
from goal_client import SUCCEEDED, Client, Result, goal, tolerance
from harness import Ros
from rclpy.serialization import deserialize_message
from samples import sampled
from sensor_msgs.msg import JointState
from two_link_control import NAMES, point, state, still, trajectory

import models
from arm_dynamics.codegen.compiler import find_compiler
from arm_dynamics.control import NAMES as CONTROLLERS
from arm_dynamics.ros import ControllerNode
from arm_dynamics.task_space.task_space import TaskSpace

pytestmark = [pytest.mark.ros, pytest.mark.skipif(find_compiler() is None, reason="no C compiler")]

TWO_LINK = models.scene("two_link")
BENT = {
    "robot": {"urdf": (models.SCENES / "two_link.urdf").read_text()},
    "joints": {"*": {"friction": {"coulomb": 0.2, "viscous": 0.1}}},
    "initial": {"position": {"shoulder": 0.4, "elbow": 0.9}},
}
NAMED = [name for name in CONTROLLERS if name not in ("computed_torque", "float")]
NAMED += ["own_controllers:Pull"]
DRIVEN = {
    "robot": {"urdf": (models.SCENES / "two_link.urdf").read_text()},
    "joints": {
        "shoulder": {
            "actuator": {"command": "voltage", "resistance": 1.2, "torque_constant": 0.05,
                         "gear_ratio": 80},
            "friction": {"coulomb": 0.2, "viscous": 0.1},
        },
        "elbow": {"actuator": {"command": "current", "resistance": 0.8, "torque_constant": 0.04,
                               "gear_ratio": 50}},
    },
}  # fmt: skip


@pytest.mark.parametrize(
    ("scene", "parameters"),
    [
        (models.scene("panda"), {"saturate": True, "cpus": str(min(os.sched_getaffinity(0)))}),
        (models.scene("gripper"), {}),
        (DRIVEN, {"damping_ratio": [0.7, 1.2]}),
    ],
    ids=["panda", "gripper", "driven"],
)
def test_commands_are_those_of_python(
    ros: Ros, rng: np.random.Generator, scene: Any, parameters: dict[str, Any]
) -> None:
    with side_by_side(ros, scene, **parameters) as pair:
        pair.led(30, rng)
        pair.go((0.05, 0.02), (0.12, -0.01), (0.2, 0.0))
        pair.led(250, rng)
        assert pair.in_c > 270
        pair.go((0.05, 0.02), (0.12, 0.0), effort=3.0)
        pair.led(150, rng)
        assert pair.in_c > 410
        pair.go((0.1, 0.01))  # the efforts fade out
        pair.led(60, rng)


@pytest.mark.parametrize("cogs", [True, False], ids=["cogging", "gravity compensated by the arm"])
def test_commands_that_depend_on_positions_are_for_python(
    ros: Ros, rng: np.random.Generator, cogs: bool
) -> None:
    scene = deepcopy(DRIVEN)
    poles = {"amplitude": 0.01, "order": 4, "phase": 0.2}
    scene["joints"]["shoulder"]["actuator"]["cogging"] = poles
    given = (scene, {}) if cogs else (TWO_LINK, {"gravity_compensated": True})
    with side_by_side(ros, given[0], **given[1]) as pair:
        pair.led(10, rng)
        assert pair.in_c == 0
        assert pair.fast.answers.obstacle == "commands depend on positions"


@pytest.mark.parametrize("more", sampled([{"observer": 10.0, "saturate": True}, {}], 1), ids=str)
@pytest.mark.parametrize("name", sampled(NAMED, 3))
def test_every_controller_is_answered_in_c(
    ros: Ros, rng: np.random.Generator, name: str, more: dict[str, Any]
) -> None:
    """With the same memory as Python, which answers now and then."""
    task = {"task_frame": "tip", "task_axes": "x z", "force_direction": [1.0, 0.0, 0.0]}
    with side_by_side(ros, BENT, controller=name, friction=True, **task, **more) as pair:
        pair.led(20, rng)
        pair.go((0.02, 0.01), (0.06, -0.01))
        pair.led(40, rng)
        while pair.slow.busy or pair.fast.busy:  # another controller is built ahead
            pair.led(1, rng)
            time.sleep(0.02)  # leaves the interpreter to the builders
        pair.change(bandwidth=[12.0])  # controllers with memory fade in
        pair.led(240, rng)
        assert pair.in_c > 80
        assert not pair.fast.answers.obstacle


def test_the_tracking_state_is_that_of_python(ros: Ros, rng: np.random.Generator) -> None:
    every = 5 * MS
    with side_by_side(ros, BENT, state_period=0.005) as pair:
        heard = ros.listen(TrackingState, "/controller/state", 1000)
        ros.spin_until(lambda: ros.peer.count_publishers("/controller/state") == 2)
        pair.led(20, rng)
        pair.go((0.05, 0.02), (0.09, -0.01))
        pair.led(100, rng)
        ros.spin_until(lambda: len(heard) >= 2 * (119 * MS // every))
        assert pair.in_c > 110
    told: dict[int, list[TrackingState]] = {}
    for message in heard:
        told.setdefault(message.header.stamp.nanosec, []).append(message)
    assert np.all(np.diff(list(told)) == every)
    assert [len(messages) for messages in told.values()] == [2] * len(told)
    assert all(one == other for one, other in told.values())
    last, moving = told[max(told)][0], told[30 * MS + MS][0]
    assert moving.goal.startswith("following") and 0.07 < moving.remaining < 0.09
    assert last.joint_names == pair.names and last.remaining == 0.0
    assert np.any(last.position_error) and np.any(last.effort)


def test_near_a_singularity_python_answers(ros: Ros, rng: np.random.Generator) -> None:
    task = {"task_frame": "tip", "task_axes": "x z", "jump_limit": 0.0}
    with side_by_side(ros, BENT, controller="operational_space", **task) as pair:
        pair.led(10, rng)
        before = pair.in_c
        for _ in range(5):
            pair.stamp += MS
            pair.answers(pair.state((0.0, 0.0), (0.0, 0.0)))  # straight
        assert pair.in_c == before
        pair.led(10, rng)
        assert pair.in_c > before


def test_a_cartesian_motion_is_for_python(ros: Ros, rng: np.random.Generator) -> None:
    task = {"task_frame": "tip", "task_axes": "x z"}
    with side_by_side(ros, BENT, **task) as pair:
        pair.led(10, rng)
        goal, here = PoseStamped(), TaskSpace(pair.slow.dynamics, "tip").pose(pair.q).position
        goal.pose.position.x, goal.pose.position.z = here[0] - 0.05, here[2]
        pair.fast.on_cartesian_goal(goal)

        def followed() -> bool:
            pair.stamp += MS
            pair.shown(pair.state(pair.q, pair.v))
            return str(pair.fast.goals.outcome).startswith("following a straight line")

        ros.spin_until(followed)
        count = pair.in_c
        for _ in range(3):
            followed()
        assert pair.in_c == count
        assert pair.fast.answers.obstacle == "the motion is a Cartesian path"


def test_goals_of_the_action_are_watched(ros: Ros, rng: np.random.Generator) -> None:
    node = ros.adopt(ControllerNode(TWO_LINK, own_thread=True, context=ros.context))
    heard = ros.listen(JointState, "/joint_commands")
    publisher = ros.publisher(JointState, "/joint_states")

    def see(stamp: int, off: float) -> None:
        at = node.goals.follower.reference(stamp * MS) if node.goals.follower else still(0.1, -0.2)
        count = len(heard)
        publisher.publish(deserialize_message(state(stamp * MS, at.q + off, at.v), JointState))
        ros.spin_until(lambda: len(heard) > count)

    see(0, 0.0)
    client, there = Client(ros), trajectory(point(0.5, 0.3, 0.0))
    near = {"path_tolerance": [tolerance(name, 0.05) for name in NAMES]}
    first = client.send(goal(there, **near))
    for stamp in range(501):
        see(stamp, 0.04)
    assert client.result(first)[0] == SUCCEEDED
    assert node.answers.count > 400, "with feedback at 20 Hz"
    second = client.send(goal(there, **near))
    for stamp in range(501, 600):
        see(stamp, 0.0)
    see(600, 0.06)
    assert client.result(second)[1].error_code == Result.PATH_TOLERANCE_VIOLATED
    count = node.answers.count
    for stamp in range(601, 620):
        see(stamp, 0.06)  # nobody watches any more
    with node.answers:
        assert node.answers.count > count + 10


def test_who_is_destroyed_hears_no_more_states(ros: Ros) -> None:
    node = ControllerNode(TWO_LINK, own_thread=True, context=ros.context)
    ros.spin_until(lambda: ros.peer.count_subscribers("/joint_states") == 1)
    thread = node.answers._thread
    node.destroy_node()
    assert not thread.is_alive()
    ros.spin_until(lambda: ros.peer.count_subscribers("/joint_states") == 0)
    node.answers.close()  # once is enough
