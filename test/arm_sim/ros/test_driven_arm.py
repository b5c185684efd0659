# SPDX-License-Identifier: Apache-2.0
"""Motors over topics: currents and voltages by name, and the torques that acted."""

import numpy as np
import pytest
from harness import Ros
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from sim_by_hand import follow, next_command
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

import models
from arm_dynamics.ros import ControllerNode
from arm_sim.ros import SimNode
from arm_sim.ros.commands.latest import LatestCommand

pytestmark = pytest.mark.ros

Q = np.array([0.3, -0.4])


@pytest.mark.parametrize(
    ("scene", "goal", "error"),
    [("motor_pendulum", [1.2], 5e-3), ("flexible_arm", [0.3, -0.6], 1e-2)],
)
def test_controller_leads_an_arm_through_its_motors(
    ros: Ros, scene: str, goal: list[float], error: float
) -> None:
    """Voltages on a motor, a harmonic drive and a belt: the node finds commands by itself."""
    sim = ros.add(SimNode, models.scene(scene), realtime=False)
    controller = ros.add(ControllerNode, models.scene(scene), bandwidth=[20.0])
    point = JointTrajectoryPoint(positions=goal)
    point.time_from_start.sec = 1
    there = JointTrajectory(joint_names=list(sim.simulator.joint_names), points=[point])
    errors, _ = follow(sim, controller, there, 1500)
    assert np.abs(errors).max() < error
    assert np.abs(errors[-1]).max() < error / 2


def test_a_voltage_on_the_topic_and_its_limit(ros: Ros) -> None:
    sim = ros.add(SimNode, models.scene("motor_pendulum"), realtime=False)
    sim.inputs.on_joint_commands(serialize_message(JointState(name=["swing"], effort=[100.0])))
    for _ in range(20):
        sim.tick()
    current = sim.simulator.state.z[0]
    assert 0.0 < current < 24.0 / 0.8
    np.testing.assert_allclose(sim.simulator.effort, 50 * 0.05 * current, rtol=1e-12)


def test_gravity_is_carried_by_commands_of_the_drives_where_springs_leave_any() -> None:
    """Volts on a motor: the current that gives the torque, times the resistance."""
    for name, q in ("motor_pendulum", np.array([0.7])), ("spring_balanced_arm", Q):
        dynamics = models.dynamics(name)
        slot, weight = LatestCommand(dynamics), dynamics.gravity(q)
        slot.configure(1, "gravity")
        assert abs(weight).max() > 0.2
        wanted = 0.8 * weight / (50 * 0.05) if name == "motor_pendulum" else np.zeros(2)
        np.testing.assert_allclose(next_command(slot, q), wanted, rtol=1e-12, atol=1e-12)
