# SPDX-License-Identifier: Apache-2.0
"""Time of a controller's tick on a Panda: each law alone, and the node's whole answer to a state.

./arm python -m benchmarks.latency.controller_ticks
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable, Iterator
from importlib.resources import files
from itertools import cycle
from typing import Any

import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rich.console import Console
from rich.table import Table
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from arm_dynamics import Dynamics, load_scene
from arm_dynamics.control import NAMES, Measured, Settings, make_controller
from arm_dynamics.ros.common.transport import as_usual
from arm_dynamics.ros.controller_node import ControllerNode
from arm_dynamics.trajectory import Reference

FRAME = "panda_hand_tcp"
CALLS = 3000
WARM_UP = 300


def main() -> None:
    """Print least and median time of every law."""
    os.environ |= as_usual()
    scene = load_scene(files("arm_sim") / "scenes/panda.yaml")
    dynamics = Dynamics(scene)
    heads = "law: least", "median", "node: least", "median", "sent: least", "median"
    table = Table("controller", *heads, title="one tick of a Panda [µs]")
    for name, observer in [*((name, None) for name in NAMES), ("computed_torque", 40.0)]:
        label = name if observer is None else f"{name} + observer"
        law = _times(_law(dynamics, name, observer))
        with_node = [_times(answer) for answer in _answers(scene, name, observer)]
        table.add_row(label, *(f"{t:.1f}" for pair in (law, *with_node) for t in pair))
    Console(width=110).print(table)


def _law(dynamics: Dynamics, name: str, observer: float | None) -> Callable[[], object]:
    settings = Settings(frame=FRAME, observer=observer or 0.0)
    control = make_controller(name, dynamics, settings)
    q0, still = dynamics.model.q0, np.zeros(dynamics.n)
    state, goal = Measured(q0 + 0.02, still + 0.1), Reference(q0, still, still)
    return lambda: control.torque(state, goal)


def _answers(scene: Any, name: str, observer: float | None) -> Iterator[Callable[[], object]]:
    """The node's answer to the bytes of a state, first without DDS, then published."""
    context = Context()
    rclpy.init(args=[], context=context, domain_id=77)
    given = {"controller": name, "task_frame": FRAME, "observer": observer or 0.0}
    overrides = [Parameter(key, value=value) for key, value in given.items()]
    node = ControllerNode(scene, context=context, parameter_overrides=overrides)
    states = cycle([_state(node, 0.02), _state(node, 0.03)])  # a state repeated is not computed
    node.on_joint_states(next(states))
    node.on_joint_trajectory(_long_way(node))
    publish = node.send
    try:
        for send in (lambda command: None, publish):
            node.send = send
            yield lambda: node.on_joint_states(next(states))
    finally:
        node.destroy_node()
        context.try_shutdown()


def _state(node: ControllerNode, off: float) -> bytes:
    dynamics = node.dynamics
    message = JointState(name=list(dynamics.joint_names))
    message.position = (dynamics.model.q0 + off).tolist()
    message.velocity = [0.1] * dynamics.n
    return bytes(serialize_message(message))


def _long_way(node: ControllerNode) -> JointTrajectory:
    """A motion that outlasts the measurement, so that the reference is one that moves."""
    names = list(node.dynamics.joint_names)
    point = JointTrajectoryPoint(positions=(node.dynamics.model.q0 + 0.1).tolist())
    point.time_from_start.sec = 1000
    return JointTrajectory(joint_names=names, points=[point])


def _times(call: Callable[[], object]) -> tuple[float, float]:
    """Least and median time of a call in [µs]."""
    taken = []
    for _ in range(WARM_UP):
        call()
    for _ in range(CALLS):
        begin = time.perf_counter_ns()
        call()
        taken.append(1e-3 * (time.perf_counter_ns() - begin))
    return min(taken), statistics.median(taken)


if __name__ == "__main__":
    main()
