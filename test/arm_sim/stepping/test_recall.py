# SPDX-License-Identifier: Apache-2.0
"""A scene whose code is known starts without its equations, and only then."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, load_scene
from arm_dynamics.codegen import compiler, recall
from arm_sim import Simulator
from arm_sim.plant import plant as equations
from arm_sim.plant.plant import Plant

URDF = (models.SCENES / "two_link.urdf").read_text()
SCENE: dict[str, Any] = {
    "robot": {"urdf": URDF},
    "joints": {"*": {"friction": {"coulomb": 0.3, "viscous": 0.2}}},
}
STOPS: dict[str, Any] = {
    "robot": {"urdf": URDF},
    "joints": {
        "shoulder": {"limits": {"lower": -0.01, "upper": 0.01, "stop": {"restitution": 0.4}}},
        "elbow": {"limits": {"lower": -0.01, "upper": 0.02, "stop": {"stiffness": 1e3}}},
    },
}


@pytest.fixture(autouse=True)
def short_arms(monkeypatch: pytest.MonkeyPatch) -> None:
    """Short arms are recalled as long ones are, even by software written a moment ago."""
    monkeypatch.setattr(equations, "RECALLED_ABOVE", 0)
    monkeypatch.setattr(recall, "BEGAN", np.inf)


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache of this test's own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("ARM_CACHE", raising=False)
    return compiler.cache_folder()


@pytest.fixture
def written(monkeypatch: pytest.MonkeyPatch) -> list[ArmModel]:
    """The arms whose equations were written."""
    arms: list[ArmModel] = []
    write = Plant._write

    def note(plant: Plant, model: ArmModel) -> None:
        arms.append(model)
        write(plant, model)

    monkeypatch.setattr(Plant, "_write", note)
    return arms


def end(simulator: Simulator) -> np.ndarray:
    return np.array(simulator.run(0.05, np.array([0.5, -0.2])).q[-1])


def test_second_start_writes_no_equations(cache: Path, written: list[ArmModel]) -> None:
    first = end(Simulator(SCENE))
    assert len(written) == 1
    second = Simulator(SCENE)
    np.testing.assert_array_equal(end(second), first)
    assert len(written) == 1
    assert second.plan.operations == Simulator(SCENE).plan.operations > 0


def test_an_arm_at_its_stops_moves_by_code_that_is_recalled(
    cache: Path, written: list[ArmModel]
) -> None:
    first, second = Simulator(STOPS), Simulator(STOPS)
    runs = [simulator.run(0.3).q for simulator in (first, second)]
    assert len(written) == 2  # away from its stops and at them, once each
    np.testing.assert_array_equal(*runs)
    np.testing.assert_array_equal(first.stop_torque, second.stop_torque)
    assert second.stop_torque.any() and second.impacts == first.impacts > 0


def test_short_arms_are_written_anew(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(equations, "RECALLED_ABOVE", 2)
    Simulator(SCENE)
    assert not list(cache.glob("*.json"))


def test_equations_are_written_when_asked_for(cache: Path, written: list[ArmModel]) -> None:
    state = Simulator(SCENE).state
    expected = Simulator(SCENE, backend="native").linearize(state, [0.1, 0.2])
    found = Simulator(SCENE).linearize(state, [0.1, 0.2])
    for ours, theirs in zip(found, expected, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    assert len(written) == 3


def test_another_scene_method_or_friction_is_other_code(cache: Path) -> None:
    model = ArmModel(load_scene(SCENE))
    heavy = {**SCENE, "gravity": [0, 0, -20.0]}
    ends = [
        end(Simulator(SCENE)),
        end(Simulator(heavy)),
        end(Simulator(SCENE, integrator="euler")),
        end(Simulator(model.with_viscous(np.array([2.0, 3.0])))),
    ]
    again = [
        end(Simulator(SCENE)),
        end(Simulator(heavy)),
        end(Simulator(SCENE, integrator="euler")),
        end(Simulator(model.with_viscous(np.array([2.0, 3.0])))),
    ]
    np.testing.assert_array_equal(again, ends)
    assert len({tuple(q) for q in ends}) == 4


@pytest.mark.parametrize("damage", ["changed", "emptied", "gone", "without code"])
def test_a_note_that_is_not_as_it_was_written_is_worth_nothing(
    cache: Path, written: list[ArmModel], damage: str
) -> None:
    first = end(Simulator(SCENE))
    (note,), (code,) = cache.glob("*.json"), cache.glob("*.so")
    text = note.read_bytes()
    if damage == "changed":
        note.write_bytes(text.replace(b'"work":[', b'"work":[1'))
    elif damage == "emptied":
        note.write_bytes(b"")
    else:
        (note if damage == "gone" else code).unlink()
    np.testing.assert_array_equal(end(Simulator(SCENE)), first)
    assert len(written) == 2
    assert note.read_bytes() == text and code.exists()


def test_another_version_of_the_software_writes_them_again(
    cache: Path, written: list[ArmModel], monkeypatch: pytest.MonkeyPatch
) -> None:
    Simulator(SCENE)
    monkeypatch.setattr(recall, "software", lambda packages: "another")
    Simulator(SCENE)
    assert len(written) == 2


def test_the_version_is_that_of_every_source(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text("x = 1\n")
    digests = {recall.software((tmp_path,))}
    recall.software.cache_clear()
    (tmp_path / "a.py").write_text("x = 2\n")
    digests.add(recall.software((tmp_path,)))
    recall.software.cache_clear()
    (tmp_path / "b.c").write_text("int x;\n")
    digests.add(recall.software((tmp_path,)))
    recall.software.cache_clear()
    assert len(digests) == 3


def scene_with(**more: Any) -> dict[str, Any]:
    return {**STOPS, **more}


def elbow(**more: Any) -> dict[str, Any]:
    return scene_with(joints={**STOPS["joints"], "elbow": more})


OTHER_SCENES = {
    "mass": scene_with(robot={"urdf": URDF.replace('value="1.5"', 'value="1.5000000000000002"')}),
    "limit": elbow(limits={"lower": -0.01, "upper": 0.03, "stop": {"stiffness": 1e3}}),
    "kind of stop": elbow(limits={"lower": -0.01, "upper": 0.02}),
    "rebound": elbow(limits={"lower": -0.01, "upper": 0.02, "stop": {"restitution": 0.1}}),
    "no stop": elbow(limits={"stop": False}),
    "stiffness": elbow(limits={"lower": -0.01, "upper": 0.02, "stop": {"stiffness": 1001}}),
    "spring": elbow(spring={"stiffness": 2.0}),
    "effort": elbow(limits={"effort": 3.0}),
    "friction": elbow(friction={"viscous": 0.1}),
    "payload": scene_with(payloads=[{"frame": "tip", "mass": 1.0}]),
    "tunable": scene_with(tunable=["gravity"]),
    "gravity": scene_with(gravity=[0, 0, -9.0]),
    "armature": elbow(armature=0.1),
    "lines": scene_with(springs=[{"frames": ["tip", "world"], "stiffness": 3.0}]),
}


@pytest.mark.parametrize("what", OTHER_SCENES)
def test_whatever_a_scene_says_is_described(what: str) -> None:
    here, there = (
        Plant(ArmModel(load_scene(scene))).described() for scene in (STOPS, OTHER_SCENES[what])
    )
    assert here and there and here != there


def by_an_ulp(values: np.ndarray) -> np.ndarray:
    found = np.array(values)
    found.flat[-1] = np.nextafter(found.flat[-1], np.inf)
    return found


def heavier(model: ArmModel) -> None:
    body = model.pin.inertias[1]
    body.mass = np.nextafter(body.mass, np.inf)
    model.pin.inertias[1] = body


BY_HAND: dict[str, Callable[[ArmModel], object]] = {
    "mass": heavier,
    "stop": lambda m: vars(m).update(stops=replace(m.stops, place=by_an_ulp(m.stops.place))),
    "spring": lambda m: vars(m).update(springs=replace(m.springs, rest=by_an_ulp(m.springs.rest))),
    "limit": lambda m: vars(m).update(command_limit=by_an_ulp(m.command_limit)),
    "friction": lambda m: vars(m).update(friction=m.friction.with_viscous(by_an_ulp(m.viscous))),
}


@pytest.mark.parametrize("what", BY_HAND)
def test_what_was_changed_by_hand_is_described(what: str) -> None:
    scene = load_scene({**STOPS, "joints": {"*": {"limits": {"effort": 3.0}}}})
    model = ArmModel(scene)
    before = Plant(model).described()
    assert before == Plant(ArmModel(scene)).described()
    BY_HAND[what](model)
    after = Plant(model).described()
    assert before and after and before != after


def test_a_plant_without_its_stops_is_another() -> None:
    model = ArmModel(load_scene(STOPS))
    assert Plant(model).described() != Plant(model, stops=False).described()


def test_what_cannot_be_described_is_made(cache: Path, written: list[ArmModel]) -> None:
    for _ in range(2):
        model = ArmModel(load_scene(SCENE))
        vars(model)["more"] = object()
        assert Plant(model).described() is None
        Simulator(model)
    assert len(written) == 2 and not list(cache.glob("*.json"))


def test_values_that_differ_read_differently() -> None:
    values: list[Any] = [0.0, -0.0, 0, False, None, "0", "None", (0,), [0], {0: 0}, ((0,), 0)]
    values += [0.1 + 0.2, 0.3, float("nan")]
    values += [np.zeros(1), np.zeros((1, 1)), np.zeros(1, np.float32)]
    values += [("a", "b"), ("a', 'b",), {"a": "b"}, (1, 23), (12, 3)]
    assert len({recall.exact(value) for value in values}) == len(values)
    assert recall.exact([0, {1, 2}]) is None


@pytest.mark.parametrize("when", ["before it is made", "while it is made"])
def test_software_that_changed_since_the_process_began_leaves_no_note(
    cache: Path, monkeypatch: pytest.MonkeyPatch, when: str
) -> None:
    write = Plant._write

    def edited(plant: Plant, model: ArmModel) -> None:
        monkeypatch.setattr(recall, "BEGAN", 0.0)
        write(plant, model)

    if when == "while it is made":
        monkeypatch.setattr(Plant, "_write", edited)
    else:
        monkeypatch.setattr(recall, "BEGAN", 0.0)
    Simulator(SCENE)
    assert not list(cache.glob("*.json"))


def test_a_source_that_is_newer_than_the_process_has_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recall, "PACKAGES", ())
    source = tmp_path / "inner" / "law.py"
    source.parent.mkdir()
    source.write_text("x = 1\n")
    monkeypatch.setattr(recall, "BEGAN", time.time() + 1.0)
    assert not recall.changed((tmp_path,))
    monkeypatch.setattr(recall, "BEGAN", source.stat().st_ctime - 1.0)
    assert recall.changed((tmp_path,))
