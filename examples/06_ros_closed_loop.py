# SPDX-License-Identifier: Apache-2.0
"""Simulator and controller as ROS 2 nodes in one process, in real time, without launch files."""

import os
import time
from importlib.resources import files

# Set before ROS starts: the nodes are not visible to the rest of the network.
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

import numpy as np
import rclpy
from arm_msgs.msg import TrackingState
from rclpy.context import Context
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from arm_dynamics.ros import ControllerNode, make_executor
from arm_sim.figures import figure
from arm_sim.ros import SimNode

scene = str(files("arm_sim") / "scenes/panda.yaml")
context = Context()
rclpy.init(context=context, domain_id=100 - os.getpid() % 50)

controller = ControllerNode(scene, context=context)
executor = make_executor(controller)
errors: list[np.ndarray] = []
controller.create_subscription(
    TrackingState, "~/state", lambda state: errors.append(np.array(state.position_error)), 10
)
publisher = controller.create_publisher(JointTrajectory, "~/joint_trajectory", 10)

sim = SimNode(scene, context=context)  # its brakes hold the arm until the first command
executor.add_node(sim)

start, sent = time.monotonic(), False
while time.monotonic() < start + 3.0:
    executor.spin_once(timeout_sec=0.1)
    if errors and not sent:
        goal = sim.simulator.state.q + 0.3
        point = JointTrajectoryPoint(positions=goal.tolist())
        point.time_from_start.sec = 1
        publisher.publish(JointTrajectory(joint_names=sim.simulator.joint_names, points=[point]))
        sent = True

sim.destroy_node()  # logs rate and lateness
controller.destroy_node()
executor.shutdown()
context.try_shutdown()

print(f"{len(errors)} states, largest tracking error {np.abs(errors).max():.1e} rad")
distance = np.abs(sim.simulator.state.q - goal).max()
print(f"distance to the goal at the end {distance:.1e} rad")

with figure("ros_closed_loop", size=(7, 4)) as axis:
    axis.plot(1e3 * np.array(errors), label=[f"joint {i + 1}" for i in range(len(goal))])
    axis.set(xlabel="message on ~/state", ylabel="tracking error [mrad]", title="Two nodes, 1 kHz")
    axis.legend(ncols=2)

assert distance < 1e-2
