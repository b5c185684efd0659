# SPDX-License-Identifier: Apache-2.0
"""Sim and controller close the loop, driven by hand: no clock, so the same on every machine."""

import math
from typing import Any

import numpy as np
import pytest
from harness import Ros
from rclpy.serialization import deserialize_message, serialize_message
from samples import sampled
from sensor_msgs.msg import JointState
from sim_by_hand import follow, state_bytes
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

import models
from arm_dynamics.ros import ControllerNode
from arm_dynamics.trajectory import Waypoint
from arm_sim.ros import SimNode
from arm_sim.simulation.closed_loop import ClosedLoop
from tolerances import ALGEBRA, assert_close

pytestmark = pytest.mark.ros

RMS = 1e-3  # [rad] with a perfect model
GOALS = 0.5 * np.array([[1, -1, 1, -1, 1, -1, 1], [0, 0, 0, 0, 0, 0, 0]])


def pair(
    ros: Ros, controllers_scene: Any = None, **parameters: Any
) -> tuple[SimNode, ControllerNode]:
    scene = models.scene("panda")
    sim = ros.add(SimNode, scene, realtime=False, integrator="rk4", **parameters)
    return sim, ros.add(ControllerNode, controllers_scene or scene, bandwidth=[20.0])


def trajectory(sim: SimNode) -> JointTrajectory:
    """Half a radian there and back with every joint, in two seconds."""
    points = [
        JointTrajectoryPoint(positions=(sim.simulator.model.q0 + goal).tolist()) for goal in GOALS
    ]
    for i, point in enumerate(points):
        point.time_from_start.sec = i + 1
    return JointTrajectory(joint_names=list(sim.simulator.joint_names), points=points)


def rms(errors: np.ndarray) -> float:
    return float(np.sqrt(np.mean(errors**2)))


def test_tracks_with_a_perfect_model(ros: Ros) -> None:
    sim, controller = pair(ros)
    errors, positions = follow(sim, controller, trajectory(sim), 2500)
    assert rms(errors) < RMS
    assert np.ptp(positions, axis=0).min() > 0.4
    np.testing.assert_allclose(positions[-1], sim.simulator.model.q0, rtol=0.0, atol=RMS)


@pytest.mark.parametrize("sent", sampled([[], [math.nan] * 7], 1), ids=["none", "nan"])
def test_tracks_a_robot_that_sends_no_velocities(ros: Ros, sent: list[float]) -> None:
    sim, _ = pair(ros)
    controller = ros.add(
        ControllerNode, models.scene("panda"), bandwidth=[20.0], velocities="positions",
        velocity_cutoff=150.0,
    )  # fmt: skip

    def answer() -> bytes | None:
        message = deserialize_message(state_bytes(sim), JointState)
        message.velocity = sent
        return controller.on_joint_states(serialize_message(message))

    errors, _ = follow(sim, controller, trajectory(sim), 1500, answer)
    assert rms(errors) < RMS
    assert not controller._log.passed_over


def test_the_efforts_of_a_motion_repeat_it_without_feedback(ros: Ros) -> None:
    """Torques of a controlled motion, sent as efforts of its points, are the motion's own."""
    scene, ticks = models.scene("panda"), 1500
    controlled = ClosedLoop(scene)
    home = controlled.simulator.state.q
    controlled.follow([Waypoint(1.0 + i, home + goal) for i, goal in enumerate(GOALS)])
    done = controlled.run(1.5)
    q, tau = done.q, done.command
    sim = ros.add(SimNode, scene, realtime=False, integrator="rk4")
    blind = ros.add(ControllerNode, scene, controller="pd", bandwidth=[0.0])
    repeated = JointTrajectory(joint_names=list(sim.simulator.joint_names))
    for k in range(ticks):
        point = JointTrajectoryPoint(positions=q[k].tolist(), effort=tau[k].tolist())
        point.time_from_start.sec, point.time_from_start.nanosec = divmod(k * 10**6, 10**9)
        repeated.points.append(point)
    blind.on_joint_states(state_bytes(sim))
    blind.on_joint_trajectory(repeated)
    while blind.busy:
        blind.deliver()
    for k in range(ticks):
        assert_close(sim.simulator.state.q, q[k], 1e-6)
        command = blind.on_joint_states(state_bytes(sim))
        given = deserialize_message(command, JointState).effort
        assert_close(given, tau[k], ALGEBRA)
        sim.inputs.on_joint_commands(command)
        sim.tick()
