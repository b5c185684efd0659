# SPDX-License-Identifier: Apache-2.0
"""The controllers of the comparison, all tuned to one bandwidth on the nominal model."""

from collections.abc import Sequence

from arm_dynamics.arrays import Array
from arm_dynamics.control import AnyController, Settings, make_controller
from arm_dynamics.control.custom import Maker, load_controller
from benchmarks.controllers.cases import Arm

OMEGA = 15.0  # [rad/s], critically damped
OBSERVER = 40.0  # [1/s]

CONTENDERS: dict[str, str | Maker] = {
    "PD": "pd",
    "PID": "pid",
    "PD + gravity": "pd_gravity",
    "feed-forward + PD": "feed_forward",
    "computed torque": "computed_torque",
    "computed torque + observer": "computed_torque",
    "operational space": "operational_space",
    "joint impedance": "joint_impedance",
    "Cartesian impedance": "cartesian_impedance",
}


def contenders(own: Sequence[str] = ()) -> dict[str, str | Maker]:
    """Titles of all controllers, with their names or constructors."""
    return CONTENDERS | {name.partition(":")[2]: load_controller(name) for name in own}


def contender(title: str, arm: Arm, dt: float, limit: Array, name: str | Maker) -> AnyController:
    feeds = name in ("operational_space", "cartesian_impedance")
    settings = Settings(
        dt=dt, bandwidth=OMEGA, frame=arm.frame, axes=arm.axes, friction=feeds, limit=limit,
        observer=OBSERVER if title.endswith("observer") else 0.0,
    )  # fmt: skip
    return make_controller(name, arm.nominal, settings)
