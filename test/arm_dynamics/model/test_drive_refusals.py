# SPDX-License-Identifier: Apache-2.0
"""A drive that cannot be gives one clear error: the key, the value and what is wanted."""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, SceneError, load_scene

INF = float("inf")
WINDING = {"resistance": 1.0, "torque_constant": 0.05}
SOFT = {"stiffness": 100.0}
ROTOR = {"rotor_inertia": 1e-4}


def build(joint: dict[str, Any], name: str = "joint2", robot: str = "planar_3r") -> ArmModel:
    urdf = str(models.FOLDER / f"{robot}.urdf")
    return ArmModel(load_scene({"robot": {"urdf": urdf}, "joints": {name: joint}}))


def elastic(**transmission: Any) -> dict[str, Any]:
    return {"actuator": ROTOR | {"gear_ratio": -10}, "transmission": SOFT | transmission}


def motor(**actuator: Any) -> dict[str, Any]:
    return {"actuator": actuator}


REFUSED: list[tuple[dict[str, Any], str]] = [
    (motor(command="voltage", torque_constant=0.1), "joints.joint2.actuator.resistance.*voltage"),
    (motor(command="current"), "torque_constant.*current"),
    (motor(current_limit=3), "torque_constant.*current_limit"),
    (motor(voltage_limit=24, torque_constant=0.1), "resistance.*voltage_limit"),
    (
        motor(**ROTOR) | {"transmission": {"damping": 1}},
        "joints.joint2.transmission.stiffness.*missing",
    ),
    ({"actuator": WINDING, "transmission": SOFT}, "rotor_inertia.*more than zero"),
    (elastic(backlash=0.1, hysteresis={"torque": 1, "deflection": 0.1}), "backlash.*hysteresis"),
    (elastic(kinematic_error={"amplitude": 0.0501, "order": 2}), "0.0501.* = 1.002 must stay"),
]


@pytest.mark.parametrize(("joint", "said"), REFUSED)
def test_drives_that_cannot_be_are_refused(joint: dict[str, Any], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        build(joint)


def test_an_output_may_only_just_go_on() -> None:
    assert build(elastic(kinematic_error={"amplitude": 0.0499, "order": 2}))


BY_CURRENT, BY_VOLTAGE = {"command": "current"}, {"command": "voltage"}
WEAK = {"current_limit": 3, "voltage_limit": 4}  # at rest the voltage counts
LIMITED: list[tuple[dict[str, Any], float, float, str]] = [
    ({}, 40.0, 40.0, "N m"),
    ({"current_limit": 3}, 7.5, 7.5, "N m"),
    (WEAK, 5.0, 7.5, "N m"),
    (BY_CURRENT | WEAK, 5.0, 3.0, "A"),
    (BY_VOLTAGE | {"voltage_limit": 24}, 30.0, 24.0, "V"),
    (BY_VOLTAGE, 40.0, INF, "V"),
]


@pytest.mark.parametrize(("motor", "effort", "command", "unit"), LIMITED)
def test_the_narrowest_limit_counts(
    motor: dict[str, Any], effort: float, command: float, unit: str
) -> None:
    """2.5 N m for each ampere, whichever way the gear turns, and 2 Ω; the URDF says 40 N m."""
    winding = {"resistance": 2.0, "torque_constant": 0.05, "gear_ratio": -50}
    model = build({"actuator": winding | motor})
    np.testing.assert_allclose(model.effort_limit, [80.0, effort, 20.0], rtol=1e-15)
    np.testing.assert_allclose(model.command_limit, [80.0, command, 20.0], rtol=1e-15)
    assert model.command_unit == ("N m", unit, "N m")
    standing = {"N m": effort, "A": effort / 2.5, "V": command}[unit]
    np.testing.assert_allclose(model.standing_limit, [80.0, standing, 20.0], rtol=1e-15)


def test_a_follower_has_no_motor_of_its_own() -> None:
    with pytest.raises(SceneError, match="mimic"):
        build({"actuator": ROTOR}, "right_slide", "gripper")


def test_all_means_those_that_can_have_one() -> None:
    """``"*"`` gives motors to leaders and leaves followers alone."""
    model = build({"actuator": ROTOR | {"gear_ratio": 10}}, "*", "gripper")
    assert all(drive is not None for drive in model.drives)
    assert len(model.drives) == model.n


def test_entries_complete_each_other() -> None:
    """What stands under ``"*"`` and under the joint's name is checked together."""
    urdf = str(models.FOLDER / "planar_3r.urdf")
    joints = {
        "*": {"actuator": {"command": "voltage", **WINDING, "gear_ratio": 10}},
        "joint2": {"actuator": {"gear_ratio": -20, "voltage_limit": 48}},
    }
    model = ArmModel(load_scene({"robot": {"urdf": urdf}, "joints": joints}))
    assert [drive.motor.gear_ratio for drive in model.drives if drive] == [10, -20, 10]
    assert model.command_limit.tolist() == [float("inf"), 48.0, float("inf")]
