# SPDX-License-Identifier: Apache-2.0
"""Values that no arm has are told once, as probably in another unit; real ones are not."""

import logging
import re
from collections.abc import Callable, Mapping
from typing import Any

import pytest
from samples import sampled

import models
from arm_dynamics import Dynamics
from arm_dynamics.scene.files import ready_scenes
from arm_dynamics.scene.load import SceneSource
from arm_sim import ClosedLoop, Simulator

URDF = (models.FOLDER / "planar_3r.urdf").read_text()
LENGTH, MASS, INERTIA = (
    r'(?<=xyz=")([-\d.]+)(?= 0 0")',
    r'(?<=mass value=")([\d.]+)',
    (r'(?<=i[xyz][xyz]=")([\d.]+)'),
)


def times(factor: float, *numbers: str) -> str:
    """The arm with all numbers of some kinds multiplied."""
    text = URDF
    for number in numbers:
        text = re.sub(number, lambda found: f"{float(found[0]) * factor:g}", text)
    return text


def changed(old: str, new: str) -> str:
    assert old in URDF
    return URDF.replace(old, new)


def about(urdf: str = URDF, **keys: Any) -> Mapping[str, Any]:
    return {"robot": {"urdf": urdf}, **keys}


def joint(**keys: Any) -> Mapping[str, Any]:
    return about(joints={"joint2": keys})


def motor(**keys: Any) -> Mapping[str, Any]:
    return joint(actuator={"gear_ratio": 100, **keys})


def told(
    source: SceneSource, caplog: pytest.LogCaptureFixture, build: Callable[..., Any] = Dynamics
) -> list[str]:
    """What building says of a scene."""
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        build(source)
    return [record.getMessage() for record in caplog.records]


BALL = {"type": "contact", "frame": "link3", "radius": 20, "plane": {"point": [0, 0, -50]}}
CORD = {"frames": ["link3", "world"], "stiffness": 1e-6, "rest_length": 20}
LONG_STROKE = (models.FOLDER / "gripper.urdf").read_text().replace('upper="0.05"', 'upper="50"')
HEAVY = {"gear_ratio": 100, "rotor_inertia": 33.3}
VOLTAGE = {"command": "voltage", "torque_constant": 0.05}
MISTAKEN: list[tuple[SceneSource, str]] = [
    (times(1e6, INERTIA), "link 'link1': radius of gyration of 115 m"),
    (times(1e3, LENGTH), "joint 'joint2': <origin> 400 m away, far for an arm of 6.2 kg"),
    (changed('"0.1 0 0"', '"100 0 0"'), "link 'link3': <origin> 100 m"),
    (times(1e3, MASS), "'joint1' (and joint2, joint3): its own weight needs up to 2.44e+04 N m"),
    (changed("2.5", "170"), "position limits, joint 'joint2' from -170 to 170, joint 'joint3'"),
    (LONG_STROKE, "from 0 to 50, are far for an arm of 0.355 m; lengths are in m"),
    (about(sensors={"position": {"resolution": 4096}}), "= 4096 is 652 turns; angles are in rad"),
    (about(sensors={"delay": 2}, commands={"delay": 1}), "'commands.delay': 3 s in all"),
    (about(constraints=[BALL]), "'constraints.0.radius' is 20 m; lengths are in m"),
    (about(springs=[{**CORD, "rest_length": 0, "points": [[20, 0, 0], [0, 0, 0]]}]), "points.0"),
    (about(springs=[CORD]), "'springs.0.rest_length' is 20 m; lengths are in m"),
    (about(payloads=[{"frame": "link3", "mass": 1e-6, "com": [0, 20, 0]}]), "'payloads.0.com' is"),
    (joint(spring={"stiffness": 1, "rest": 45}), "spring.rest' = 45 is 7.16 turns"),
    (about(payloads=[{"frame": "link3", "mass": 1500}]), "payload needs up to 1.02e+04 N m"),
    (joint(armature=2000), "its drive has 2e+03 at the joint"),
    (
        joint(actuator=HEAVY, transmission={"stiffness": 1e4}),
        "its drive has 3.33e+05 at the joint",
    ),
    (motor(gear_ratio=0.01), "gear_ratio = 0.01; it is the motor's turns over the joint's"),
    (motor(command="current", torque_constant=53.8), "torque_constant = 53.8; it is in N m/A"),
    (motor(resistance=0.6, inductance=0.8, **VOLTAGE), "inductance = 0.8 with resistance = 0.6"),
    (joint(friction={"coulomb": 300}), "dry friction of 300 N m is above its effort limit, 40"),
]


@pytest.mark.parametrize(("source", "words"), MISTAKEN)
def test_units_that_cannot_be_are_told_once(
    source: SceneSource, words: str, caplog: pytest.LogCaptureFixture
) -> None:
    (remark,) = told(source, caplog)
    assert words in remark


POSSIBLE: list[SceneSource] = [
    URDF,
    changed('<child link="link1"/>', '<child link="link1"/><origin xyz="30 -20 0"/>'),
    about(changed("2.5", "170"), joints={"*": {"limits": {"lower": -3, "upper": 3}}}),
    joint(limits={"effort": 0}),
    about(times(1e3, MASS), gravity=[0, 0, 0]),
    about(times(50, MASS), joints={"joint1": {"spring": {"stiffness": 1e4}}}),
    changed('effort="20"', 'effort="1"').replace('"0.05"', '"0"'),  # a placeholder
]


@pytest.mark.parametrize("source", POSSIBLE)
def test_what_is_possible_is_not_told(
    source: SceneSource, caplog: pytest.LogCaptureFixture
) -> None:
    assert told(source, caplog) == []


@pytest.mark.parametrize("build", [Dynamics, Simulator, ClosedLoop])
def test_it_is_told_once_wherever_an_arm_is_built(
    build: Callable[..., Any], caplog: pytest.LogCaptureFixture
) -> None:
    heavy = about(times(1e6, INERTIA), payloads=[{"frame": "link3", "mass": 900}])
    of_link, of_payload = told(heavy, caplog, build)
    assert "gyration" in of_link and "payload" in of_payload


@pytest.mark.parametrize("name", sampled(ready_scenes(), 12))
def test_ready_scenes_have_none(name: str, caplog: pytest.LogCaptureFixture) -> None:
    assert [x for x in told(name, caplog) if "no rigid body has" not in x] == []


def test_angles_in_degrees_of_the_first_calls(caplog: pytest.LogCaptureFixture) -> None:
    dynamics = Dynamics(models.FOLDER / "gantry.urdf")
    dynamics.gravity([90.0, 90.0])
    assert not caplog.text  # they are metres
    dynamics = Dynamics("ur5e")
    dynamics.mass_matrix([[0.1, 0.0, 0.0, 0.0, 0.0, 0.0], [45.0, -90.0, 0.0, 0.0, 0.0, 0.0]])
    dynamics.gravity([45.0, -90.0, 0.0, 0.0, 0.0, 0.0])
    assert caplog.text.count("'shoulder_lift_joint': 90 is 14.3 turns; angles are in rad") == 1
    caplog.clear()
    Dynamics("four_bar").gravity([58.5686, 1.2, 0.3])  # where a crank may have turned
    assert not caplog.text
