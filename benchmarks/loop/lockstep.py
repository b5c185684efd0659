# SPDX-License-Identifier: Apache-2.0
"""Lockstep: how fast, and whether two runs are the same to the bit."""

import hashlib
import time
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from arm_dynamics.ros.common.executor import make_executor
from arm_dynamics.trajectory import Waypoint, quintic
from arm_sim import ClosedLoop, Recording, Simulator
from arm_sim.cli.demo.processes import DemoFailed, Processes
from arm_sim.plant.actuation import computed_torque
from arm_sim.ros import SimNode

START = 500_000_000  # [ns] of simulated time, when the motion begins
POINTS, STEP = 5, 2.0  # points of the motion and time from one to the next in [s]
SWING = 0.2  # [rad]


def lockstep(
    scene: str, ticks: int, compiled_ticks: int, logs: Path, domain: int
) -> dict[str, Any]:
    twice = [across(scene, ticks, logs, domain) for _ in range(2)]
    alone = [_alone(scene, ticks) for _ in range(2)]
    compiled = _compiled(scene, compiled_ticks)
    return {"ticks": ticks, "compiled ticks": compiled_ticks, "across": twice, "alone": alone,
            "compiled": compiled}  # fmt: skip


def _digest(motion: Recording, ticks: int) -> str:
    """Of every state and the torque that led to it."""
    last = slice(1, ticks + 1)
    rows = np.hstack([motion.q[last], motion.v[last], motion.tau[:ticks]])
    return hashlib.sha256(rows.tobytes()).hexdigest()[:16]


def _points(q0: np.ndarray) -> list[Waypoint]:
    return [Waypoint(STEP * k, q0 + SWING * (-1) ** k) for k in range(1, POINTS + 1)]


def across(
    scene: str, ticks: int, logs: Path, domain: int, recorded: bool = True
) -> dict[str, Any]:
    """The sim node here, the controller in a process of its own; a digest if it is recorded."""
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain,
               signal_handler_options=SignalHandlerOptions.NO)  # fmt: skip
    file = logs / f"lockstep-{time.time_ns()}.mcap"
    wanted = {"lockstep": True, "paused": True, "record": str(file) if recorded else ""}
    overrides = [Parameter(name, value=value) for name, value in wanted.items()]
    node = SimNode(scene, context=context, parameter_overrides=overrides)
    executor = make_executor(node)
    try:
        with Processes(logs) as processes:
            processes.start("controller", "controller", scene, "--with-parent")
            result = _led(node, executor, ticks)
    finally:
        executor.remove_node(node)
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()
    if not recorded:
        return result
    motion = Recording.load(file)
    file.unlink()
    return result | {"digest": _digest(motion, ticks)}


def _led(node: SimNode, executor: Any, ticks: int) -> dict[str, Any]:
    publisher = node.create_publisher(JointTrajectory, "controller/joint_trajectory", 10)
    answers = lambda: node.engine.round_trip.histogram.percentiles().count  # noqa: E731
    _spin(executor, lambda: publisher.get_subscription_count() and answers(), 30.0)
    message = JointTrajectory(joint_names=list(node.simulator.joint_names))
    message.header.stamp.nanosec = START
    for point in _points(node.simulator.state.q):
        entry = JointTrajectoryPoint(positions=point.q.tolist())
        entry.time_from_start.sec = round(point.time)
        message.points.append(entry)
    publisher.publish(message)
    settled = time.monotonic() + 2.0
    _spin(executor, lambda: time.monotonic() > settled, 10.0)
    engine, simulator = node.engine, node.simulator
    engine.pause(False)
    began, before = time.perf_counter(), simulator.arm.step_count
    _spin(executor, lambda: simulator.arm.step_count >= ticks, 1e-2 * ticks + 60.0)
    rate = (simulator.arm.step_count - before) / (time.perf_counter() - began)
    engine.pause(True)
    repeated = node.lockstep.repeat_count if node.lockstep else 0
    return {"rate": rate, "asked again": repeated}


def _spin(executor: Any, done: Any, timeout: float) -> None:
    end = time.monotonic() + timeout
    while not done():
        if time.monotonic() > end:
            raise DemoFailed("lockstep: the controller gave no answer in time")
        executor.spin_once(timeout_sec=0.1)


def _alone(scene: str, ticks: int) -> dict[str, Any]:
    """The same in this process, without messages."""
    pair = ClosedLoop(scene)
    pair.follow(_points(pair.simulator.state.q), START)
    began = time.perf_counter()
    motion = pair.run(ticks * pair.simulator.dt)
    rate = ticks / (time.perf_counter() - began)
    return {"rate": rate, "digest": _digest(motion, ticks)}


def _compiled(scene: str, ticks: int) -> list[dict[str, Any]]:
    simulator = Simulator(scene)
    start = Waypoint(0.0, simulator.state.q)
    path = quintic([start, *_points(simulator.state.q)])
    control = computed_torque(simulator.model, path.sample)
    simulator.run(0.01, control)
    results = []
    for _ in range(2):
        simulator.reset()
        began = time.perf_counter()
        motion = simulator.run(ticks * simulator.dt, control)
        rate = ticks / (time.perf_counter() - began)
        results.append({"rate": rate, "digest": _digest(motion, ticks)})
    return results
