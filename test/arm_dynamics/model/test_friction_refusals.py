# SPDX-License-Identifier: Apache-2.0
"""Impossible friction gives one clear error: the key, the value and what is allowed."""

from typing import Any

import pytest

import models
from arm_dynamics import ArmModel, SceneError, load_scene
from arm_dynamics.actuation.lugre_joints import LugreFriction

LUGRE = {"lugre": {"sigma0": 1e4}}
LOAD = {"load": {"at": [0, 10], "factor": [1, 1.1]}}
WAVY = {"position": {"at": [0, 1], "factor": [1, 2]}}
UNEQUAL = {"positive": 1.0, "negative": 2.0}


def build(
    friction: dict[str, Any], name: str = "joint2", robot: str = "planar_3r", **more: Any
) -> ArmModel:
    urdf = str(models.FOLDER / f"{robot}.urdf")
    joints = {name: {"friction": friction, **more}}
    return ArmModel(load_scene({"robot": {"urdf": urdf}, "joints": joints}))


def refusal(friction: dict[str, Any], *where: str, **more: Any) -> str:
    with pytest.raises(SceneError) as caught:
        LugreFriction.of(build(friction, *where, **more))
    return str(caught.value).removeprefix("scene: 'joints.")


def test_friction_by_load_must_not_lock_a_lossy_gear() -> None:
    friction = {"coulomb": 1.0, "load": {"at": [0, 10], "factor": [1, 4]}}
    assert build(friction).friction.by_load
    said = refusal(friction, actuator={"efficiency": 0.5})
    assert said.startswith("joint2.friction.load': friction grows by 0.45 of the load")
    assert "allowed: up to 0.25, half of the gear's efficiency 0.5" in said


RISES = {"stribeck_velocity": 0.1}
STATIC: list[tuple[dict[str, Any], str | None]] = [
    ({"coulomb": 0.5, "static": 0.5}, None),
    ({"coulomb": 0.5, "static": 0.499}, "static' = 0.499: at least coulomb, 0.5, is"),
    ({"static": 0.199}, "static' = 0.199: at least coulomb, 0.2, is"),  # that of the URDF
    ({"coulomb": UNEQUAL, "static": {"positive": 3, "negative": 1.75}}, "at least coulomb, pos"),
    ({"coulomb": 0.5, "static": 0.1} | RISES, None),
    ({"coulomb": 0.5, "static": 0.0} | RISES, "static' = 0.0: more than 0 is expected"),
    ({"coulomb": 0.5, "static": 0.4} | RISES | LUGRE, "static' = 0.4: at least coulomb, 0.5, is"),
]


@pytest.mark.parametrize(("friction", "said"), STATIC)
def test_levels_at_rest_and_in_motion_go_together(
    friction: dict[str, Any], said: str | None
) -> None:
    if said is None:
        assert build(friction).friction.has_dry
    else:
        assert said in refusal(friction)


FLAT = {"speed": [0, 1], "torque": [1, 2]}
OWN: dict[str, Any] = {
    "static": 1.0, **WAVY, **LOAD, **LUGRE, "stribeck_velocity": 0.1, "table": FLAT
}  # fmt: skip


def test_a_follower_has_no_law_of_its_own_and_no_sides() -> None:
    for key, law in OWN.items():
        said = refusal({key: law}, "right_slide", "gripper")
        assert said == f"right_slide.friction.{key}': a mimic joint has none of its own"
    for key in ("viscous", "coulomb"):
        assert f"right_slide.friction.{key}'" in refusal({key: UNEQUAL}, "right_slide", "gripper")
        assert build({key: 1.0}, "right_slide", "gripper")
        assert build({key: UNEQUAL}, "left_slide", "gripper")


# What is said, how it is refused, and what makes it mean something.
SILENT: list[tuple[dict[str, Any], str, dict[str, Any]]] = [
    ({"coulomb": UNEQUAL, "static": UNEQUAL} | RISES, "stribeck_velocity' = 0.1", {"static": 2.1}),
    ({"coulomb": 0.0} | WAVY, "position' = {'at'", {"coulomb": 0.1}),
    (
        {"coulomb": 1.0, "lugre": {"sigma0": 1e4, "sigma1_velocity": 0.1}},
        "lugre.sigma1_velocity' = 0.1",
        {"lugre": {"sigma0": 1e4, "sigma1": 1.0, "sigma1_velocity": 0.1}},
    ),
]


@pytest.mark.parametrize(("friction", "said", "more"), SILENT)
def test_what_would_be_without_effect_is_refused(
    friction: dict[str, Any], said: str, more: dict[str, Any]
) -> None:
    for name in ("joint2", "*"):
        refused = refusal(friction, name)
        assert refused.startswith(f"{name}.friction.{said}") and "without effect" in refused
        assert build(friction | more, name)


def test_what_is_said_of_all_joints_needs_one_that_has_use_of_it() -> None:
    urdf = str(models.FOLDER / "planar_3r.urdf")
    joints = {"*": {"friction": {"stribeck_velocity": 0.1}}, "joint2": {"friction": {"static": 2}}}
    model = ArmModel(load_scene({"robot": {"urdf": urdf}, "joints": joints}))
    assert model.friction.excess.mean.astype(bool).tolist() == [False, True, False]


def growing(slope: float) -> dict[str, Any]:
    """A factor whose steepest rise over the load is ``slope``: 3/2 of the mean between points."""
    return {"load": {"at": [2, 5], "factor": [1, 1 + 2 * slope]}}


@pytest.mark.parametrize(
    "levels",
    [
        {"coulomb": {"positive": 1.0, "negative": 2.0}},
        {"coulomb": 2.0} | LUGRE,
        {"coulomb": 0.5, "static": 1.0, "position": {"at": [0, 1, 2], "factor": [1, 2, 0.5]}},
    ],
)
def test_friction_by_load_grows_by_less_than_half_of_the_load(levels: dict[str, Any]) -> None:
    """Of the largest level, 2 N m: 0.499 of the load may be, 0.501 not."""
    model = build(levels | growing(0.2495))
    assert model.friction.by_load or LugreFriction.of(model)
    said = refusal(levels | growing(0.2505))
    assert said.startswith("joint2.friction.load': friction grows by 0.501 of the load")


TWICE = {"speed": [0, 1], "torque": [[1, 2], [2, 3]], "position": [0, 1]}
TABLES: list[tuple[dict[str, Any], str]] = [
    ({"speed": [0.1, 1], "torque": [1, 2]}, "speed = (0.1, 1.0): 0 is expected"),
    ({"speed": [0, 2, 1], "torque": [1, 2, 3]}, "'speed' must increase"),
    ({"speed": [0, 1e-300, 1], "torque": [1, 2, 3]}, "a slope of 1e+300 between two points"),
    ({"speed": [0, 1, 2], "torque": [1, 2]}, "3 points of 'speed', but 2 of"),
    ({**FLAT, "torque": [[1, 2], [1, 2]]}, "positions = 1, rows of"),
    (TWICE | {"period": 1}, "period = 1.0: longer than 'position' is"),
    (FLAT | {"period": 6.3}, "'position' is missing, which repeats"),
    (TWICE | {"torque": [[1, 2], [0, 3]]}, "torque at speed 0 = [1.0, 0.0]: more than 0 at every"),
]


@pytest.mark.parametrize(("table", "why"), TABLES)
def test_a_table_by_speed(table: dict[str, Any], why: str) -> None:
    said = refusal({"table": table})
    assert said.startswith("joint2.friction.table")
    assert why in said


@pytest.mark.parametrize(
    "beside", [{"coulomb": 1.0}, {"static": 1.0}, {"stribeck_velocity": 0.1}, WAVY, LOAD, LUGRE]
)
def test_a_table_contains_all_friction_but_viscous(beside: dict[str, Any]) -> None:
    said = refusal({"table": FLAT, **beside})
    assert said.startswith(f"joint2.friction.{next(iter(beside))}' = ")
    assert said.endswith("'friction.table' of the joint contains it; allowed beside it: 'viscous'")


def test_a_table_replaces_the_friction_of_the_robot_description() -> None:
    for beside, viscous in (({}, 0.0), ({"viscous": 0.5}, 0.5)):
        friction = build({"table": FLAT, **beside}).friction
        assert (friction.viscous.mean[1], friction.coulomb.mean[1]) == (viscous, 1.0)


def lugre(**changes: Any) -> dict[str, Any]:
    own = {key: changes.pop(key) for key in ("sigma1", "sigma1_velocity") if key in changes}
    return {"coulomb": 2.0, "viscous": 0.0, **changes, "lugre": {"sigma0": 1e4, **own}}


def test_bristles_with_a_stribeck_effect_have_its_speed() -> None:
    assert "needs a 'stribeck_velocity'" in refusal(lugre(static=2.001))
    assert "needs coulomb above zero" in refusal(lugre(coulomb={"positive": 1.0, "negative": 0.0}))
    assert LugreFriction.of(build(lugre(static=2.0)))
    assert LugreFriction.of(build(lugre(static=2.001, stribeck_velocity=0.1)))


def test_bristles_are_passive_in_each_direction() -> None:
    """8 · (3.5 - 2) / 2 = 6 one way, 8 · (6 - 5) / 5 = 1.6 the other way."""
    given = {
        "coulomb": {"positive": 2.0, "negative": 5.0}, "stribeck_velocity": 0.1,
        "static": {"positive": 3.5, "negative": 6.0}, "sigma1": 8.0,
    }  # fmt: skip
    assert LugreFriction.of(build(lugre(viscous={"positive": 6.0, "negative": 1.601}, **given)))
    said = refusal(lugre(viscous={"positive": 5.999, "negative": 6.0}, **given))
    assert "coulomb = 6 is expected, got 5.999;" in said and "sigma1 = 2.332, got None" in said
    said = refusal(lugre(viscous={"positive": 6.0, "negative": 1.599}, **given))
    assert "coulomb = 1.6 is expected, got 1.599;" in said


def test_bristles_are_passive_at_every_position_and_load() -> None:
    """Bent where static is 3 · 2 · 1.2, they come to where coulomb is 2 · 0.5: 8 · 6.2 = 49.6."""
    given = {
        "position": {"at": [0, 1, 2], "factor": [1, 2, 0.5]}, "static": 3.0, "sigma1": 8.0,
        "load": {"at": [0, 10], "factor": [1, 1.2]}, "stribeck_velocity": 0.1,
    }  # fmt: skip
    assert LugreFriction.of(build(lugre(viscous=49.6, **given)))
    said = refusal(lugre(viscous=49.59, sigma1_velocity=1.166, **given))
    assert "coulomb = 49.6 is expected, got 49.59;" in said
    assert "sigma1 = 1.166, got 1.166" in said
    assert LugreFriction.of(build(lugre(sigma1_velocity=1.1658, **given)))
