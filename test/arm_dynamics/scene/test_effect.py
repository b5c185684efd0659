# SPDX-License-Identifier: Apache-2.0
"""Entries that would change nothing are refused: the key, its value and what would make it act."""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, SceneError, load_scene

URDF = (models.FOLDER / "planar_3r.urdf").read_text()
ENDLESS = URDF.replace('name="joint2" type="revolute"', 'name="joint2" type="continuous"')
MOTOR = {"rotor_inertia": 1e-4, "torque_constant": 0.05}
CORD = {"frames": ["link3", "world"], "points": [[0, 0, 0], [0, 0, 2]]}


def scene(**content: Any) -> dict[str, Any]:
    return {"robot": {"urdf": ENDLESS}, **content}


def refusal(source: dict[str, Any]) -> str:
    with pytest.raises(SceneError) as caught:
        load_scene(source)
    return str(caught.value).removeprefix("scene: '")


def cogging(amplitude: float) -> dict[str, Any]:
    return {"actuator": MOTOR | {"cogging": {"amplitude": amplitude, "order": 7}}}


def stop(stop: Any, **limits: float) -> dict[str, Any]:
    return {"limits": {"stop": stop, **limits}}


def servo(**more: float) -> dict[str, Any]:
    return {"servo": {"stiffness": 500.0, "damping_ratio": 0.8, **more}}


def hysteresis(torque: float) -> dict[str, Any]:
    bend = {"torque": torque, "deflection": 1e-3}
    return {"actuator": MOTOR, "transmission": {"stiffness": 100.0, "hysteresis": bend}}


def spring(stiffness: float) -> dict[str, Any]:
    return {"spring": {"stiffness": stiffness, "damping": 1.0, "rest": 0.3}}


# What is said of joint2, how it is refused, and what makes it act.
OF_A_JOINT: list[tuple[dict[str, Any], str, dict[str, Any]]] = [
    (stop({"restitution": 0.5}), "limits.stop' = {'rest", stop({"restitution": 0.5}, upper=1.0)),
    (stop(True), "limits.stop' = True", stop(True, lower=-1.0, upper=1.0)),
    (servo(damping=20.0), "servo.damping_ratio' = 0.8", servo()),
    (spring(0), "spring.rest' = 0.3", spring(2.0)),
    (hysteresis(0), "transmission.hysteresis.deflection' = 0.001", hysteresis(0.1)),
    (cogging(0.0), "actuator.cogging.order' = 7.0", cogging(0.1)),
]


@pytest.mark.parametrize(("joint", "said", "acting"), OF_A_JOINT)
def test_of_a_joint(joint: dict[str, Any], said: str, acting: dict[str, Any]) -> None:
    refused = refusal(scene(joints={"joint2": joint}))
    assert refused.startswith(f"joints.joint2.{said}") and "is without effect: " in refused
    assert ArmModel(load_scene(scene(joints={"joint2": acting})))
    endless = {"robot": {"urdf": URDF.replace("revolute", "continuous")}}
    assert refusal({**endless, "joints": {"*": joint}}).startswith(f"joints.*.{said}")
    assert load_scene({**endless, "joints": {"*": acting}})


def test_under_all_one_joint_that_has_use_of_it_is_enough() -> None:
    stop = {"limits": {"stop": {"restitution": 0.5}}}
    model = ArmModel(load_scene(scene(joints={"*": stop})))
    assert (model.stops.restitution == [[0.5, 0.0, 0.5]] * 2).all()
    servo = {"*": {"servo": {"damping_ratio": 0.7}}, "joint1": {"servo": {
        "stiffness": 500.0, "damping": 20.0}}}  # fmt: skip
    assert load_scene(scene(joints=servo))


def test_a_joint_may_be_without_what_all_others_have() -> None:
    own = {"transmission": {"hysteresis": {"torque": 0.0, "deflection": 1e-3}}}
    assert ArmModel(load_scene(scene(joints={"*": hysteresis(0.1), "joint1": own})))


def test_a_follower_that_stands_still_has_no_stop() -> None:
    urdf = (models.FOLDER / "gripper.urdf").read_text()
    joints = {"right_slide": {"limits": {"stop": {"restitution": 0.5}}}}
    assert load_scene({"robot": {"urdf": urdf}, "joints": joints})
    still = urdf.replace('multiplier="-0.7"', 'multiplier="0"')
    said = refusal({"robot": {"urdf": still}, "joints": joints})
    assert said.startswith("joints.right_slide.limits.stop'")


def test_of_a_spring_between_points() -> None:
    fine, own = CORD | {"stiffness": 1.0, "name": "first"}, CORD | {"damping": 1.0}
    own["rest_length"] = 0.2
    assert refusal(scene(springs=[fine, own])) == (
        "springs.1.rest_length' = 0.2 is without effect: 'stiffness' is 0; more than 0 is expected"
    )
    assert load_scene(scene(springs=[fine, own | {"stiffness": 1.0}]))


ROUGH, ORDER = {"position": {"resolution": 1e-3}}, {"order": 2}
OF_SENSORS: list[tuple[dict[str, Any], str, dict[str, Any]]] = [
    ({"velocity": ORDER}, "velocity.order' = 2", {"velocity": ORDER | {"cutoff": {"joint2": 50}}}),
    ({"seed": 3, "delay": 0.01} | ROUGH, "seed' = 3", {"seed": 3, "loss": 0.1} | ROUGH),
]


@pytest.mark.parametrize(("sensors", "said", "acting"), OF_SENSORS)
def test_of_sensors(sensors: dict[str, Any], said: str, acting: dict[str, Any]) -> None:
    assert refusal(scene(sensors=sensors)).startswith(f"sensors.{said}")
    assert load_scene(scene(sensors=acting))
    assert load_scene(scene(sensors={"seed": 3}, commands={"jitter": 0.01}))


def test_loads_have_no_sign() -> None:
    table = {"at": [-5, 0, 10], "factor": [1, 1, 1.1]}
    friction = {"coulomb": 1.0, "load": table}
    said = refusal(scene(joints={"joint2": {"friction": friction}}))
    assert said.startswith("joints.joint2.friction.load' = ")
    assert "at = -5 is never reached" in said
    table.update(at=[0, 5, 10])
    assert load_scene(scene(joints={"joint2": {"friction": friction}}))


def test_a_limit_on_one_side_gives_a_stop_something_to_do() -> None:
    """Descriptions write numbers like 1e16 for no limit."""
    joints = {"joint1": {"limits": {"stop": {"restitution": 0.5}}}}
    for lower, counts in ((-1e15, True), (-1e16, False)):
        urdf = URDF.replace('lower="-3" upper="3"', f'lower="{lower}" upper="1e16"')
        given = {"robot": {"urdf": urdf}, "joints": joints}
        if counts:
            assert np.isfinite(ArmModel(load_scene(given)).stops.place[:, 0]).any()
        else:
            assert "is without effect: the joint has no position limit" in refusal(given)
