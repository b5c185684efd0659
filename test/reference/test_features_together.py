# SPDX-License-Identifier: Apache-2.0
"""A few sets of features of every seed's own choice, against independent solutions.

All of them: ``./arm python -m benchmarks.matrix``.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.matrix import cli, measure, page
from models import features
from reference import make_features_together as solutions
from reference.independent import simulate

QUICK = tuple(f for f in features.ALL if f not in ("lugre", "voltage", "harmonic", "flexible"))


@cache
def known() -> dict[str, Any]:
    return measure.reference()


def verified(arm: str, chosen: tuple[str, ...]) -> None:
    print("features:", arm, *chosen)
    found = measure.measured(arm, chosen, known())
    assert found["position"] <= measure.POSITION
    assert found["account"] <= measure.ACCOUNT


@pytest.mark.parametrize(("arm", "place"), [("planar", 0), ("planar", 1), ("panda", 0)])
def test_two_features(arm: str, place: int, rng: np.random.Generator) -> None:
    verified(arm, features.sets(2)[rng.integers(len(features.sets(2)))])


def test_many_features(rng: np.random.Generator) -> None:
    verified("planar", features.many(12)[rng.integers(12)])


def test_a_solution_is_found_again(rng: np.random.Generator) -> None:
    """The file is what the independent simulator makes, of a set that it makes quickly."""
    pairs = [pair for pair in features.sets(2) if set(pair) <= set(QUICK)]
    chosen = pairs[rng.integers(len(pairs))]
    print("features:", *chosen)
    scene, command, _ = solutions.given("planar", chosen)
    loads = [load | features.LOAD for load in scene.get("payloads", ())]
    motion = simulate(scene, command, solutions.TIMES, loads)
    stored = known()["planar"][solutions.label(chosen)]
    np.testing.assert_allclose(motion.q, stored["q"], rtol=0.0, atol=1e-9)
    assert abs(motion.balance).max() < 1e-9


@pytest.mark.parametrize("arm", features.ARMS)
def test_every_set_is_there_and_belongs_to_its_scene(arm: str) -> None:
    for _, chosen in solutions.jobs([arm]):
        assert known()[arm][solutions.label(chosen)]["scene"] == solutions.given(arm, chosen)[2]


@pytest.mark.parametrize("arm", features.ARMS)
def test_every_feature_of_a_pair_matters(arm: str) -> None:
    """It changes positions; contacts close and stops are hit, and dry friction holds at least once
    in all solutions but one.
    """
    for pair in features.sets(2):
        changes = measure.effect(arm, pair, known())
        assert min(changes.values()) > page.MATTERS, (pair, changes)
    events = {pair: known()[arm][solutions.label(pair)]["events"] for pair in features.sets(2)}
    for feature, kind in {"contact": "impact", "end stop": "hit"}.items():
        assert all(found.get(kind) for pair, found in events.items() if feature in pair)
    holds = [bool(found.get("sticks")) for pair, found in events.items() if "coulomb" in pair]
    assert holds.count(False) <= 1


def test_what_is_off_fails_or_does_not_matter_is_said() -> None:
    good = {"position": 0.0, "account": 0.0, "moved": 1.0, "events": {}}
    results = {"planar": {"coulomb, contact": good, "viscous": good | {"position": 2e-7}}}
    assert "planar: viscous" in cli.complaints(results, known())[0]
    assert "fails" in page._cell({"failed": "x"}, "position")
    same = {"q": [[0.0]]}
    idle = {
        "planar": {solutions.label(s): same for s in [(), *features.sets(1), *features.sets(2)]}
    }
    lines = cli.complaints({"planar": {}}, idle)
    assert len(lines) == 2 * len(features.sets(2)) and "does not matter" in lines[0]


def test_page(tmp_path: Path) -> None:
    good = {"position": 1e-9, "account": 1e-12, "moved": 1.0, "events": {"sticks": 3}}
    results = {"planar": {"coulomb, contact": good, "viscous": {"failed": "x"}}, "elapsed_s": 60.0}
    results["planar"][solutions.label(features.many(1)[0])] = good
    text = page.write(results, tmp_path, None).read_text()
    assert "{{" not in text and "**fails**" in text and "sticks 3×" in text
    assert json.loads((tmp_path / "features-together.json").read_text()) == results
