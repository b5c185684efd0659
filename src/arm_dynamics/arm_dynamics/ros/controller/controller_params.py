# SPDX-License-Identifier: Apache-2.0
"""Parameters of the controller node."""

from dataclasses import dataclass, field

from arm_dynamics.control.factory import NAMES, Settings
from arm_dynamics.ros.common.params import SCENE, parameter
from arm_dynamics.ros.common.robot_source import DescriptionParams
from arm_dynamics.ros.common.threads.privileges import ThreadParams


@dataclass(frozen=True)
class ControllerParams(ThreadParams, DescriptionParams):
    """Parameters of the controller node."""

    scene: str = parameter("", f"{SCENE}; the controller's model of the arm")
    controller: str = parameter(
        "computed_torque", f"Control law: {', '.join(NAMES)}, or a user-defined controller as "
        "package.module:Class, named here or in 'controllers' when the node starts",
        read_only=False,
    )  # fmt: skip
    controllers: list[str] = parameter(
        [], "User-defined controllers that may be selected in motion, as package.module:Class"
    )
    cartesian_speed: float = parameter(
        0.25, "Speed of Cartesian goals [m/s]; rotations count 0.25 m/rad", low=1e-6, high=100.0,
        read_only=False,
    )  # fmt: skip
    cartesian_acceleration: float = parameter(
        1.0, "Acceleration of Cartesian goals along their path [m/s²]", low=1e-6, high=1e4,
        read_only=False,
    )  # fmt: skip
    cartesian_timing: str = parameter(
        "smooth", "smooth, or time_optimal: as fast as limits of the joints and their motors "
        "allow", choices=("smooth", "time_optimal"), read_only=False,
    )  # fmt: skip
    switch_time: float = parameter(
        0.2, "Duration of the transition to another controller [s]", low=0.0, high=60.0
    )
    acceleration_limit: float = parameter(
        0.0, "Largest acceleration of a trajectory [rad/s²]; 0: no limit", low=0.0, high=1e6
    )
    gap_limit: float = parameter(
        1.0, "Longest time between joint states; after a longer gap the arm is held at its "
        "position and the motion is not resumed [s]; 0: any",
        low=0.0, high=1e6, read_only=False,
    )  # fmt: skip
    jump_limit: float = parameter(
        0.5,
        "Largest displacement of a joint between two states beyond that by its velocity; after a "
        "larger one (a reset, or a joint that was repositioned) the arm is held [rad, m]; 0: any",
        low=0.0, high=1e6, read_only=False,
    )  # fmt: skip
    velocities: str = parameter(
        "states", "Where velocities come from: states, or positions, for robots whose states have "
        "none or useless ones; they are then differences, filtered, and late by half a state and "
        "the filter's delay", choices=("states", "positions"),
    )  # fmt: skip
    velocity_cutoff: float = parameter(
        50.0, "Cut-off frequency of that filter [Hz]; 0: none", low=0.0, high=1e5
    )
    state_period: float = parameter(
        0.02, "Shortest time between messages on ~/state [s]", low=0.0, high=10.0
    )
    settings: Settings = field(default_factory=Settings)  # parameters of the controller itself
