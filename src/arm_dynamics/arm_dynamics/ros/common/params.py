# SPDX-License-Identifier: Apache-2.0
"""Parameters as frozen dataclasses, declared with range, and changed together or not at all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from arm_dynamics.control.factory import NAMES
from arm_dynamics.exceptions import ArmError, InvalidInput
from arm_dynamics.ros.common.privileges import Privileges, read_cpus


def parameter(
    default: Any,
    description: str,
    *,
    low: float | None = None,
    high: float | None = None,
    choices: tuple[str, ...] = (),
    read_only: bool = True,
) -> Any:
    """Describe one field of a parameter dataclass.

    Args:
        default: Value when nobody sets it; its type is the parameter's type.
        description: What it is, with unit.
        low: Least value allowed, with ``high``.
        high: Greatest value allowed.
        choices: The texts that are allowed, if only some are.
        read_only: Whether it is fixed once the node runs.
    """
    descriptor = ParameterDescriptor(description=description, read_only=read_only)
    if choices:
        descriptor.additional_constraints = "one of " + ", ".join(choices)
    if low is not None and high is not None:
        if isinstance(default, int):
            descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high))]
        else:
            descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    metadata = {"descriptor": descriptor, "choices": choices}
    if isinstance(default, list):
        descriptor.dynamic_typing = True  # [30] and 30 mean what [30.0] means
        return field(default_factory=lambda: list(default), metadata=metadata)
    return field(default=default, metadata=metadata)


def one_or_all(values: Sequence[Any]) -> Any:
    """Give the value of a list of one, else all of them, as the core takes them."""
    return values[0] if len(values) == 1 else list(values)


def declare[P](node: Node, kind: type[P]) -> P:
    """Declare the parameters of ``kind`` and read their values.

    Raises:
        InvalidInput: If a value given at start is of a wrong type or not allowed.
    """
    values = {}
    for item in fields(kind):  # type: ignore[arg-type]
        default = getattr(kind(), item.name)
        try:
            declared = node.declare_parameter(item.name, default, item.metadata["descriptor"])
        except (InvalidParameterValueException, InvalidParameterTypeException) as error:
            raise InvalidInput(f"parameter '{item.name}': {error}") from error
        values[item.name] = _plain(item.name, declared.value, default)
    return _checked(kind(**values))


def watch[P](node: Node, current: Callable[[], P], apply: Callable[[P], None]) -> None:
    """Take changes at run time: all parameters of one request together, or none of them.

    Args:
        node: The node that declared the parameters.
        current: Gives the dataclass in force.
        apply: Puts a new one in force; an ``ArmError`` refuses the request, and must leave the old
            one in force.
    """

    def on_set(parameters: list[Parameter]) -> SetParametersResult:
        present = current()
        changed = [p for p in parameters if hasattr(present, p.name)]
        try:
            values = {p.name: _plain(p.name, p.value, getattr(present, p.name)) for p in changed}
            if values:
                apply(_checked(replace(present, **values)))  # type: ignore[type-var]
        except ArmError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(on_set)


def _plain(name: str, value: Any, like: Any) -> Any:
    """Give a parameter's value the type of ``like``; one number will do for a list of them."""
    if value is None:
        raise InvalidInput(f"parameter '{name}' has no value; it cannot be taken away")
    if not isinstance(like, list):
        return value
    return [value] if isinstance(value, (bool, int, float, str)) else list(value)


def _checked[P](params: P) -> P:
    for item in fields(params):  # type: ignore[arg-type]
        value, choices = getattr(params, item.name), item.metadata["choices"]
        if choices and value not in choices:
            raise InvalidInput(
                f"parameter '{item.name}' is '{value}'; allowed is one of {', '.join(choices)}"
            )
    return params


def task_axes(params: ControllerParams) -> Any:
    """Give the axes of the task as the core takes them."""
    return one_or_all(params.task_axes.replace(",", " ").split())


SCENE = "Scene file or URDF: a path, a package:// URI or URDF text"


@dataclass(frozen=True)
class ThreadParams:
    """Parameters of the thread that keeps a node's deadlines."""

    priority: int = parameter(
        0, "Real-time priority of the loop (SCHED_FIFO); 0: an ordinary thread", low=0, high=99
    )
    cpus: str = parameter("", "Processors that the loop may run on, such as '0, 2'; empty: all")
    lock_memory: bool = parameter(False, "Keep the process's memory from being swapped")
    freeze_garbage: bool = parameter(
        True,
        "Take what exists at the start out of the garbage collector's rounds, where the node has "
        "a process of its own",
    )


def privileges(params: ThreadParams) -> Privileges:
    """What these parameters ask of the system.

    Raises:
        InvalidInput: If ``cpus`` cannot be read.
    """
    cpus = read_cpus(params.cpus)
    return Privileges(params.priority, cpus, params.lock_memory)


@dataclass(frozen=True)
class DynamicsParams:
    """Parameters of the dynamics node."""

    scene: str = parameter("", f"{SCENE}; empty: the robot description says what the arm is")
    robot_description: str = parameter(
        "", "URDF text; empty: it comes from the topic robot_description", read_only=False
    )


@dataclass(frozen=True)
class ControllerParams(ThreadParams):
    """Parameters of the controller node."""

    scene: str = parameter("", f"{SCENE}; what the controller believes the arm to be")
    controller: str = parameter(
        "computed_torque", "The law that makes the torque", choices=NAMES, read_only=False
    )
    bandwidth: list[float] = parameter(
        [20.0], "How fast errors vanish [rad/s]: one, or one for each joint", read_only=False
    )
    damping_ratio: list[float] = parameter(
        [1.0], "Damping of errors, 1 is critical: one, or one for each joint", read_only=False
    )
    task_frame: str = parameter(
        "", "Frame that laws in task space lead; empty: none", read_only=False
    )
    task_axes: str = parameter(
        "pose",
        'Axes that they lead: pose, position, orientation, or some of "x y z rx ry rz"',
        read_only=False,
    )
    cartesian_speed: float = parameter(
        0.25, "Speed of Cartesian goals [m/s]; a turn counts 0.25 m/rad", low=1e-6, high=100.0,
        read_only=False,
    )  # fmt: skip
    cartesian_acceleration: float = parameter(
        1.0, "Acceleration of Cartesian goals along their way [m/s²]", low=1e-6, high=1e4,
        read_only=False,
    )  # fmt: skip
    cartesian_timing: str = parameter(
        "smooth",
        "smooth, or time_optimal: as quick as joint limits allow (needs the library toppra)",
        choices=("smooth", "time_optimal"),
        read_only=False,
    )
    force: float = parameter(
        0.0, "Force with which motion_force presses [N]", low=-1e4, high=1e4, read_only=False
    )
    force_direction: list[float] = parameter(
        [0.0, 0.0, -1.0], "Direction in the world along which it presses", read_only=False
    )
    friction: bool = parameter(
        False, "Feed the scene's friction forward (computed_torque always does)", read_only=False
    )
    observer: float = parameter(
        0.0, "Bandwidth of a disturbance observer [1/s]; 0: none", low=0.0, high=1e4,
        read_only=False,
    )  # fmt: skip
    saturate: bool = parameter(
        False, "Cut torques at the scene's effort limits and say so", read_only=False
    )
    switch_time: float = parameter(
        0.2, "Time that a change of the law takes [s]", low=0.0, high=60.0
    )
    control_period: float = parameter(
        1e-3, "Time between joint states, for laws that remember [s]", low=1e-6, high=1.0
    )
    acceleration_limit: float = parameter(
        0.0,
        "Greatest acceleration of a trajectory [rad/s²]; 0: none",
        low=0.0,
        high=1e6,
        read_only=True,
    )
    gap_limit: float = parameter(
        1.0,
        "Time from one joint state to the next after which the arm is held where it is, instead "
        "of being led to where it should have come meanwhile [s]; 0: any",
        low=0.0,
        high=1e6,
        read_only=False,
    )
    state_period: float = parameter(
        0.02, "Least time between messages on ~/state [s]", low=0.0, high=10.0
    )
