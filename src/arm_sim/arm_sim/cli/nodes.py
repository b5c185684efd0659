# SPDX-License-Identifier: Apache-2.0
"""``./arm sim``, ``./arm dynamics`` and ``./arm controller``: the nodes, without ros2 run."""

import ctypes
import json
import os
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict
from functools import partial
from typing import Annotated, Any

import click

from arm_dynamics import InvalidInput
from arm_sim.cli.arguments import File, Scene
from arm_sim.cli.command import command

_PR_SET_PDEATHSIG = 1  # of prctl: the signal that a process gets when its parent ends
ForRos = Annotated[tuple[str, ...], click.UNPROCESSED, "[--ros-args …]"]
WithParent = Annotated[bool, {"hidden": True}, "End with the parent."]


@command(
    "./arm sim panda",
    "./arm sim my_arm.urdf --ros-args -p stale_policy:=zero -p dt:=0.0005",
    "./arm sim my_arm.urdf --ros-args -r __ns:=/left",
    ignore_unknown_options=True,
)
def sim(
    scene: Scene | None = None,
    rest: ForRos = (),
    *,
    report: File | None = None,
    with_parent: WithParent = False,
) -> None:
    """Simulate the arm of SCENE at 1 kHz from joint commands until Ctrl-C.

    It receives efforts, positions or velocities on joint_commands, or efforts on sim/commands in
    model order, and publishes joint_states. Until the first command, and when commands stop,
    brakes hold the arm; the parameter stale_policy selects brake, servo, zero, hold or gravity.

    Args:
        report: At the end, write timing statistics of the loop to this file.
    """
    _announce("simulator")
    from arm_sim.ros import SimNode

    node = _run(SimNode, scene, rest, with_parent)
    if report is not None and node is not None:
        loop = {**asdict(node.loop.report()), "bars": node.loop.lateness.bars()}
        trip = asdict(node.engine.round_trip.histogram.percentiles())
        content = {"loop": loop, "round_trip": trip}
        if (recorder := node.recorder) is not None:
            content["recording"] = recorder.report()
        report.write_text(json.dumps(content), encoding="utf-8")


@command(
    "./arm dynamics panda", "./arm dynamics --ros-args -r __ns:=/left", ignore_unknown_options=True
)
def dynamics(
    scene: Scene | None = None, rest: ForRos = (), *, with_parent: WithParent = False
) -> None:
    """Answer inverse and forward dynamics of the arm of SCENE as services until Ctrl-C.

    Without SCENE it waits for a URDF on the topic robot_description.
    """
    _announce("dynamics node")
    from arm_dynamics.ros import DynamicsNode

    _run(DynamicsNode, scene, rest, with_parent)


@command(
    "./arm controller panda",
    "./arm controller my_scene.yaml --ros-args -p bandwidth:=[40.0] -p damping_ratio:=[0.9]",
    "./arm controller my_scene.yaml --ros-args -p controller:=pd_gravity",
    ignore_unknown_options=True,
)
def controller(
    scene: Scene | None = None, rest: ForRos = (), *, with_parent: WithParent = False
) -> None:
    """Move the arm of SCENE along trajectories until Ctrl-C.

    The parameter controller selects the control law, computed torque by default. The node
    subscribes to joint_states and controller/joint_trajectory and publishes joint_commands. Its
    scene may differ from the simulator's, to study model errors.
    """
    _announce("controller")
    from arm_dynamics.ros import ControllerNode

    _run(partial(ControllerNode, own_thread=True), scene, rest, with_parent)


def _announce(node: str) -> None:
    """Say at once what starts, before imports and compilers take seconds."""
    with suppress(OSError):  # a full disk keeps no node from starting
        click.echo(f"starting the {node} …", err=True)


def _run(
    make: Callable[..., Any], scene: str | None, rest: tuple[str, ...], with_parent: bool
) -> Any:
    """Run one node; return it after a clean end, else exit with its status."""
    from rclpy.parameter import Parameter

    from arm_dynamics.ros.common.command_line import split_words

    try:
        scene, rest = split_words((scene, *rest) if scene else rest)
    except InvalidInput as error:
        raise click.UsageError(str(error)) from None
    if with_parent:
        # The kernel sends SIGTERM when the parent process ends, for any reason.
        parent = os.getppid()
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM, 0, 0, 0)
        if os.getppid() != parent:
            sys.exit(1)
    overrides = [Parameter("scene", value=scene)] if scene else []
    status, node = run_node(partial(make, parameter_overrides=overrides), rest)
    if status:
        sys.exit(status)
    return node


def run_node(
    make: Callable[..., Any], words: Sequence[str] = (),
    until: Callable[[Any], bool] = lambda node: False,
) -> tuple[int, Any]:  # fmt: skip
    """Run a node in this process until it is interrupted, or a function of it returns true.

    Returns:
        The exit status, and the node, or None if it was ended before it was complete.
    """
    from arm_dynamics.ros.common.executable import run

    nodes: list[Any] = []

    def make_and_keep(**context: Any) -> Any:
        nodes.append(make(**context))
        return nodes[0]

    status = run(make_and_keep, list(words), lambda: until(nodes[0]))
    return status, nodes[0] if nodes else None
