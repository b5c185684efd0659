# SPDX-License-Identifier: Apache-2.0
"""``./arm urdf``: print the robot description of a scene, for nodes that need it as text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Literal
from xml.etree import ElementTree

import click

from arm_sim.cli.arguments import Scene
from arm_sim.cli.command import command

if TYPE_CHECKING:
    from arm_dynamics import ArmModel

TOPICS = "joint_state_topic_hardware_interface/JointStateTopicSystem"
LIBRARY = "arm_ros2_control/ArmSystem"
STATES = ("position", "velocity", "effort")


@command(
    "./arm urdf panda > panda.urdf",
    "./arm urdf panda --ros2-control position",
    "./arm urdf panda --ros2-control effort --library $PWD/build/libpanda.so",
)
def urdf(
    scene: Scene,
    *,
    interface: Annotated[
        Literal["position", "velocity", "effort"] | None, "--ros2-control"
    ] = None,
    library: Annotated[
        str | None, click.Path(exists=True, dir_okay=False, resolve_path=True), "--library FILE"
    ] = None,
    commands_topic: str = "/robot_joint_commands",
    states_topic: str = "/robot_joint_states",
) -> None:
    """Print the URDF of SCENE: the name of a bundled scene, a scene file, or a package:// URI.

    Args:
        interface: Add a ros2_control tag with this command interface, for the JointState-topic
            hardware.
        library: The hardware is arm_ros2_control with this shared library, made of SCENE by ./arm
            export --tick or --servo.
        commands_topic: Topic on which the hardware publishes commands.
        states_topic: Topic on which the hardware receives joint states.
    """
    from arm_dynamics import ArmModel, load_scene

    loaded = load_scene(scene)
    if interface is None:
        click.echo(loaded.description)
        return
    if library is not None:
        plugin, parameters = LIBRARY, {"library": library}
    else:  # not positive: it always publishes, since missing messages would be stopped commands
        plugin, parameters = TOPICS, {
            "joint_commands_topic": commands_topic, "joint_states_topic": states_topic,
            "trigger_joint_command_threshold": "-1",
        }  # fmt: skip
    click.echo(with_hardware(ArmModel(loaded), interface, plugin, parameters))


def with_hardware(
    model: ArmModel, command: str, plugin: str, parameters: Mapping[str, str]
) -> str:
    """The arm's URDF with the tag of its hardware.

    Args:
        model: The arm; locked and mimic joints are not commanded.
        command: Command interface of its joints.
        plugin: The hardware's plugin.
        parameters: Its parameters.

    Source: README of joint_state_topic_hardware_interface (ros-controls).
    """
    from arm_dynamics.scene.urdf.xml import xml_root

    robot = xml_root(model.scene.description)
    for other in robot.findall("ros2_control"):  # remove the tag of the real robot's hardware
        robot.remove(other)
    tag = ElementTree.SubElement(robot, "ros2_control", name="arm", type="system")
    hardware = ElementTree.SubElement(tag, "hardware")
    ElementTree.SubElement(hardware, "plugin").text = plugin
    for name, value in parameters.items():
        ElementTree.SubElement(hardware, "param", name=name).text = value
    for name, start in zip(model.joint_names, model.q0, strict=True):
        joint = ElementTree.SubElement(tag, "joint", name=name)
        ElementTree.SubElement(joint, "command_interface", name=command)
        for state in STATES:
            interface = ElementTree.SubElement(joint, "state_interface", name=state)
            if state == "position":
                initial = ElementTree.SubElement(interface, "param", name="initial_value")
                initial.text = repr(float(start))
    ElementTree.indent(tag)
    return ElementTree.tostring(robot, encoding="unicode")
