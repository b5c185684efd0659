# SPDX-License-Identifier: Apache-2.0
"""A drive that cannot be gives one clear error: the key, the value and what is wanted."""

from __future__ import annotations

from typing import Any

import pytest

import models
from arm_dynamics import ArmModel, SceneError, load_scene

NAN, INF = float("nan"), float("inf")
WINDING = {"resistance": 1.0, "torque_constant": 0.05}
SOFT = {"stiffness": 100.0}
ROTOR = {"rotor_inertia": 1e-4}


def build(joint: dict[str, Any], name: str = "joint2", robot: str = "planar_3r") -> ArmModel:
    urdf = str(models.FOLDER / f"{robot}.urdf")
    return ArmModel(load_scene({"robot": {"urdf": urdf}, "joints": {name: joint}}))


MOTORS: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    "gear ratio zero": ({"gear_ratio": 0}, ("gear_ratio", "0", "any number but zero")),
    "gear ratio NaN": ({"gear_ratio": NAN}, ("gear_ratio", "nan", "finite")),
    "negative rotor": ({"rotor_inertia": -1e-4}, ("rotor_inertia", "-0.0001")),
    "negative damping": ({"rotor_damping": -1}, ("rotor_damping", "-1")),
    "negative inductance": ({"inductance": -1e-3}, ("inductance", "-0.001")),
    "resistance zero": ({"resistance": 0}, ("resistance", "0", "greater than 0")),
    "torque constant zero": ({"torque_constant": 0}, ("torque_constant", "greater than 0")),
    "torque constant negative": ({"torque_constant": -1}, ("torque_constant", "-1")),
    "efficiency zero": ({"efficiency": 0}, ("efficiency", "greater than 0")),
    "efficiency above one": (
        {"efficiency": 1.1},
        ("efficiency", "1.1", "less than or equal to 1"),
    ),
    "efficiency NaN": ({"efficiency": NAN}, ("efficiency", "nan")),
    "current limit infinite": ({"current_limit": INF}, ("current_limit", "inf", "finite")),
    "unknown command": ({"command": "speed"}, ("command", "'speed'", "'torque'", "'voltage'")),
    "unknown key": ({"resistence": 1}, ("resistence", "resistance", "cogging")),
    "unknown key of cogging": ({"cogging": {"amplitude": 1, "teeth": 3}}, ("teeth", "order")),
    "cogging order zero": ({"cogging": {"amplitude": 1, "order": 0}}, ("order", "greater than 0")),
    "voltage without resistance": (
        {"command": "voltage", "torque_constant": 0.1},
        ("joints.joint2.actuator.resistance", "command: voltage"),
    ),
    "voltage without torque constant": (
        {"command": "voltage", "resistance": 1},
        ("joints.joint2.actuator.torque_constant", "command: voltage"),
    ),
    "current without torque constant": ({"command": "current"}, ("torque_constant", "current")),
    "current limit without torque constant": (
        {"current_limit": 3},
        ("torque_constant", "current_limit"),
    ),
    "voltage limit without resistance": (
        {"voltage_limit": 24, "torque_constant": 0.1},
        ("resistance", "voltage_limit"),
    ),
}


@pytest.mark.parametrize(("motor", "words"), MOTORS.values(), ids=MOTORS)
def test_bad_motor(motor: dict[str, Any], words: tuple[str, ...]) -> None:
    with pytest.raises(SceneError) as caught:
        build({"actuator": motor})
    for word in words:
        assert word in str(caught.value)


COUPLINGS: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    "no stiffness": ({"damping": 1}, ("joints.joint2.transmission.stiffness", "missing")),
    "stiffness zero": ({"stiffness": 0}, ("stiffness", "greater than 0")),
    "stiffness NaN": ({"stiffness": NAN}, ("stiffness", "nan")),
    "negative damping": (SOFT | {"damping": -0.3}, ("damping", "-0.3")),
    "negative backlash": (SOFT | {"backlash": -1}, ("backlash", "-1")),
    "negative stiffening": (SOFT | {"stiffening": -1}, ("stiffening", "-1")),
    "unknown key": (SOFT | {"slack": 1}, ("slack", "backlash")),
    "hysteresis without deflection": (
        SOFT | {"hysteresis": {"torque": 1}},
        ("hysteresis.deflection",),
    ),
    "hysteresis without sharpness": (
        SOFT | {"hysteresis": {"torque": 1, "deflection": 0.1, "sharpness": 0.5}},
        ("sharpness", "0.5"),
    ),
    "play in a hysteresis": (
        SOFT | {"backlash": 0.1, "hysteresis": {"torque": 1, "deflection": 0.1}},
        ("backlash", "hysteresis"),
    ),
    "an output that turns back": (
        SOFT | {"kinematic_error": {"amplitude": 0.1, "order": 2}},
        ("kinematic_error", "below 1"),
    ),
}


@pytest.mark.parametrize(("coupling", "words"), COUPLINGS.values(), ids=COUPLINGS)
def test_bad_transmission(coupling: dict[str, Any], words: tuple[str, ...]) -> None:
    with pytest.raises(SceneError) as caught:
        build({"actuator": ROTOR | {"gear_ratio": 10}, "transmission": coupling})
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize("motor", [{}, {"actuator": WINDING}, {"actuator": {"rotor_inertia": 0}}])
def test_flexible_transmission_needs_a_rotor(motor: dict[str, Any]) -> None:
    with pytest.raises(SceneError, match="rotor_inertia.*more than zero"):
        build(motor | {"transmission": SOFT})


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
