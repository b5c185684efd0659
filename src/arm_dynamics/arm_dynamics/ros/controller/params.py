# SPDX-License-Identifier: Apache-2.0
"""Parameters of the controller node."""

from __future__ import annotations

from dataclasses import dataclass, field

from arm_dynamics.control.factory import NAMES, Settings
from arm_dynamics.ros.common.params import SCENE, parameter
from arm_dynamics.ros.common.privileges import ThreadParams
from arm_dynamics.ros.common.robot_source import DescriptionParams


@dataclass(frozen=True)
class ControllerParams(ThreadParams, DescriptionParams):
    """Parameters of the controller node."""

    scene: str = parameter("", f"{SCENE}; the controller's model of the arm")
    controller: str = parameter(
        "computed_torque",
        f"What makes the torque: {', '.join(NAMES)}, or a controller of one's own as "
        "package.module:Class, named here or in 'controllers' when the node is started",
        read_only=False,
    )
    controllers: list[str] = parameter(
        [], "Controllers of one's own that may be selected in motion, as package.module:Class"
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
    switch_time: float = parameter(
        0.2, "Time that a change of the law takes [s]", low=0.0, high=60.0
    )
    acceleration_limit: float = parameter(
        0.0, "Greatest acceleration of a trajectory [rad/s²]; 0: none", low=0.0, high=1e6
    )
    gap_limit: float = parameter(
        1.0,
        "Time from one joint state to the next after which the arm is held where it is, instead "
        "of being led to where it should have come meanwhile [s]; 0: any",
        low=0.0,
        high=1e6,
        read_only=False,
    )
    jump_limit: float = parameter(
        0.5,
        "How far a joint may be from one state to the next from where its speed can have brought "
        "it; where it is farther (it was put there, or reset), the arm is held [rad, m]; 0: any",
        low=0.0,
        high=1e6,
        read_only=False,
    )
    state_period: float = parameter(
        0.02, "Least time between messages on ~/state [s]", low=0.0, high=10.0
    )
    settings: Settings = field(default_factory=Settings)  # parameters of the controller itself
