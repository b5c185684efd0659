# SPDX-License-Identifier: Apache-2.0
"""A drive that cannot be gives one clear error: the key, the value and what is wanted."""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, SceneError, load_scene
from arm_dynamics.model.drive import JointDrive
from arm_dynamics.scene.drive import Actuator

NAN, INF = float("nan"), float("inf")
WINDING = {"resistance": 1.0, "torque_constant": 0.05}
SOFT = {"stiffness": 100.0}
ROTOR = {"rotor_inertia": 1e-4}


def build(joint: dict[str, Any], name: str = "joint2", robot: str = "planar_3r") -> ArmModel:
    urdf = str(models.FOLDER / f"{robot}.urdf")
    return ArmModel(load_scene({"robot": {"urdf": urdf}, "joints": {name: joint}}))


MOTORS: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
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
    "play in a hysteresis": (
        SOFT | {"backlash": 0.1, "hysteresis": {"torque": 1, "deflection": 0.1}},
        ("backlash", "hysteresis"),
    ),
    "an output that turns back": (
        SOFT | {"kinematic_error": {"amplitude": 0.125, "order": 2}},
        ("joints.joint2.transmission.kinematic_error.amplitude' = 0.125", "= 2.5 must stay below"),
    ),
    "an output that stops": (
        SOFT | {"kinematic_error": {"amplitude": 0.05, "order": 2}},
        ("kinematic_error.amplitude' = 0.05", "= 1 must stay below 1"),
    ),
}


@pytest.mark.parametrize(("coupling", "words"), COUPLINGS.values(), ids=COUPLINGS)
def test_bad_transmission(coupling: dict[str, Any], words: tuple[str, ...]) -> None:
    with pytest.raises(SceneError) as caught:
        build({"actuator": ROTOR | {"gear_ratio": 10}, "transmission": coupling})
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize("ratio", [10, -10])
def test_an_output_that_only_just_goes_on(ratio: float) -> None:
    error = {"amplitude": 0.0499, "order": 2}
    motor = ROTOR | {"gear_ratio": ratio}
    assert build({"actuator": motor, "transmission": SOFT | {"kinematic_error": error}})
    with pytest.raises(SceneError, match=r"\|gear_ratio\| = 1.002 must stay below 1"):
        error["amplitude"] = 0.0501
        build({"actuator": motor, "transmission": SOFT | {"kinematic_error": error}})


@pytest.mark.parametrize(
    "coupling", [{}, {"backlash": 0.1}, {"hysteresis": {"torque": 1, "deflection": 0.1}}]
)
def test_play_or_hysteresis_alone(coupling: dict[str, Any]) -> None:
    (drive,) = filter(None, build({"actuator": ROTOR, "transmission": SOFT | coupling}).drives)
    assert drive.coupling is not None


LIMITED: dict[str, tuple[dict[str, Any], float, float, str]] = {
    "of the joint": ({}, 40.0, 40.0, "N m"),
    "of the current": ({"current_limit": 3}, 7.5, 7.5, "N m"),
    "of the voltage, only at rest": ({"voltage_limit": 24}, 30.0, 40.0, "N m"),
    "of the current, below that of the voltage": (
        {"current_limit": 3, "voltage_limit": 24},
        7.5,
        7.5,
        "N m",
    ),
    "of the voltage, at rest below that of the current": (
        {"current_limit": 3, "voltage_limit": 4},
        5.0,
        7.5,
        "N m",
    ),
    "of the joint, below that of the current": ({"current_limit": 20}, 40.0, 40.0, "N m"),
    "of a current that the joint bears": ({"command": "current"}, 40.0, 16.0, "A"),
    "of a current": ({"command": "current", "current_limit": 3}, 7.5, 3.0, "A"),
    "of a current, at rest below that of the current": (
        {"command": "current", "current_limit": 3, "voltage_limit": 4},
        5.0,
        3.0,
        "A",
    ),
    "of a voltage": ({"command": "voltage", "voltage_limit": 24}, 30.0, 24.0, "V"),
    "of no voltage": ({"command": "voltage"}, 40.0, INF, "V"),
}


@pytest.mark.parametrize("ratio", [50, -50])
@pytest.mark.parametrize(("motor", "effort", "command", "unit"), LIMITED.values(), ids=LIMITED)
def test_the_narrowest_limit_counts(
    motor: dict[str, Any], effort: float, command: float, unit: str, ratio: float
) -> None:
    """2.5 N m for each ampere, whichever way the gear turns, and 2 Ω; the URDF says 40 N m."""
    winding = {"resistance": 2.0, "torque_constant": 0.05, "gear_ratio": ratio}
    model = build({"actuator": winding | motor})
    np.testing.assert_allclose(model.effort_limit, [80.0, effort, 20.0], rtol=1e-15)
    np.testing.assert_allclose(model.command_limit, [80.0, command, 20.0], rtol=1e-15)
    assert model.command_unit == ("N m", unit, "N m")
    standing = {"N m": effort, "A": effort / 2.5, "V": command}[unit]
    np.testing.assert_allclose(model.standing_limit, [80.0, standing, 20.0], rtol=1e-15)


@pytest.mark.parametrize(("effort", "expected"), [(5.0, 2.0), (7.5, 3.0), (8.0, 3.0), (INF, 3.0)])
def test_a_current_is_limited_by_itself_and_by_its_torque(effort: float, expected: float) -> None:
    motor = Actuator(command="current", torque_constant=0.05, gear_ratio=-50, current_limit=3)
    assert JointDrive(motor, None).command_limit(effort) == pytest.approx(expected, rel=1e-15)


def test_a_motor_of_which_nothing_is_said_gives_any_torque() -> None:
    drive = JointDrive(Actuator(), None)
    assert (drive.torque_limit, drive.command_limit(5.0), drive.command_limit(INF)) == (
        INF,
        5,
        INF,
    )


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
