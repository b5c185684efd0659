# SPDX-License-Identifier: Apache-2.0
"""A scene whose code is known starts without its equations, and only then."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, load_scene
from arm_dynamics.codegen import compiler, recall
from arm_sim import Simulator
from arm_sim.plant.plant import Plant

SCENE: dict[str, Any] = {
    "robot": {"urdf": str(models.SCENES / "two_link.urdf")},
    "joints": {"*": {"friction": {"coulomb": 0.3, "viscous": 0.2}}},
}


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
