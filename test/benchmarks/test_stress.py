# SPDX-License-Identifier: Apache-2.0
"""Random scenes are drawn as promised, and the stress test would notice a fault."""

import json
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from arm_dynamics import ArmModel, load_scene
from arm_dynamics.codegen import user_cache
from arm_sim import Recording, Simulator
from benchmarks.stress import judge, scenes, survey
from benchmarks.stress.holding import Held, measured, summary
from benchmarks.stress.judge import (
    CRASHED,
    FORBIDDEN,
    HUNG,
    NAN,
    REFUSED,
    SHOWN,
    SURVIVED,
    UNDETECTED,
    Result,
    Truth,
    examine,
)
from benchmarks.stress.report import write
from benchmarks.stress.scenes import HARDSHIPS, PIECE, PIECES, Case, Way, draw
from models.rotor import rotor

BLANK = Result("features", 0, "rk4", 1e-3, REFUSED)


def test_arms_are_as_hard_as_promised() -> None:
    arms = [draw("arms", seed) for seed in range(40)]
    joints, traits = [len(arm.v) for arm in arms], {t for arm in arms for t in arm.traits}
    assert min(joints) == 1 and max(joints) > 25
    assert {*HARDSHIPS, "no friction", "viscous friction", "dry friction"} <= traits
    inertias = (ArmModel(load_scene(arm.scene)).pin.inertias for arm in arms)
    masses = [[body.mass for body in list(of)[1:]] for of in inertias]
    assert max(max(of) / min(of) for of in masses) > 3e5
    assert max(abs(arm.v).max() for arm in arms) > 50.0


def test_features_and_ways_are_all_drawn() -> None:
    cases = [draw("features", seed) for seed in range(60)]
    assert {len(case.v) for case in cases} == {1, 2, 3, 7}
    features = {t for case in cases for t in case.traits if not t.endswith("joints")}
    assert len(features - {"no feature"}) == 15
    tried = {(way.method, way.dt) for way in draw("arms", 2).ways}
    assert tried >= {*product(scenes.METHODS, scenes.TICKS)}
    again = draw("features", 7)
    assert cases[7].scene == again.scene != cases[8].scene and cases[7].ways == again.ways
    np.testing.assert_array_equal(cases[7].command, again.command)


def test_cases_are_examined_in_processes_of_their_own(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    results = survey.apart(("features", 5, 3, 0.0), str(user_cache.folder().parent))
    assert len(results) == scenes.WAYS
    assert {r.outcome for r in results} <= {SURVIVED, SHOWN}
    [died] = survey.apart(("arms", 2, 3, 0.0), None)  # type: ignore[arg-type]  no folder
    monkeypatch.setattr(survey, "PATIENCE", 0.0)
    [hung] = survey.apart(("arms", 2, 3, 0.0), str(tmp_path))
    assert (hung.outcome, hung.seed, died.outcome) == (HUNG, 2, CRASHED)


def test_two_truths_agree() -> None:
    """Of a chain with friction, stops and a payload, by the independent simulator."""
    results = examine("features", 0, 3, share=1.0)
    assert not {r.outcome for r in results} & {*FORBIDDEN}
    assert 0.0 < max(r.apart or 0.0 for r in results) < 1e-11


def test_the_independent_simulator_gets_the_commands_of_the_pieces() -> None:
    command = np.repeat([[1.0], [-1.0]], PIECES // 2, axis=0)
    still = np.zeros(1)
    case = Case("features", 0, rotor(0.5), (), still[None], still, command, ())
    q = judge.independent(case, (still, still))
    assert q is not None
    half = PIECE * PIECES / 2
    np.testing.assert_allclose(q[[PIECES // 2, -1], 0], [half**2, 2 * half**2], rtol=1e-12)


@pytest.fixture(scope="module")
def run() -> Recording:
    sim = Simulator("pendulum", "rk4", 1e-3, backend="vm")
    return sim.run(PIECE * PIECES)


def truth_of(run: Recording, **other: Any) -> Truth:
    rows = slice(None, None, round(PIECE / 1e-3))
    return Truth(run.q[rows], run.v[rows], **other)


@pytest.mark.parametrize(
    ("doubt", "error", "outcome"),
    [("", 0.0, SURVIVED), ("", 1e-3, UNDETECTED), ("said", 1e-3, SURVIVED), ("said", 1.0, SHOWN)],
)
def test_errors_have_to_be_told_of(
    run: Recording, doubt: str, error: float, outcome: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Recording, "doubt", doubt)
    truth = truth_of(run)
    far = replace(truth, q=truth.q + error * np.linspace(0, 1, PIECES + 1)[:, None])
    found = judge.judged(BLANK, replace(run), far)
    assert (found.outcome, found.false_alarm) == (outcome, bool(doubt) and not error)
    second = judge.judged(BLANK, replace(run), replace(far, second=far.q + 1e-4))
    assert second.error == pytest.approx(error + 1e-4, rel=0.9)


def test_a_silent_nan_is_found(run: Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    broken = replace(run, v=np.where(np.arange(len(run))[:, None] == 5, np.nan, run.v))
    monkeypatch.setattr(Simulator, "run", lambda *arguments: broken)
    scene = load_scene("pendulum")
    start = run.q[0], run.v[0]
    case = Case("features", 0, {}, (), run.q[:1], run.v[0], np.zeros((PIECES, 1)), ())
    way = Way("rk4", 1e-3)
    result = judge.attempt(BLANK, ArmModel(scene), case, start, truth_of(run), way)
    assert result.outcome == NAN


@pytest.mark.parametrize("seed", [0, 1, 3, 5])  # of all families
def test_sets_let_go_where_a_linear_program_says(seed: int) -> None:
    found = next(measured(seed))
    assert found.good, found


def test_report(tmp_path: Path) -> None:
    survived = replace(BLANK, outcome=SURVIVED, kind="arms", rate=1.0, error=1e-9, stated=1e-8)
    bad = replace(BLANK, outcome=UNDETECTED, error=0.3, tolerance=1e-6)
    held = [Held("body", 3, 1.0, 1e-3, None, 0.0)]
    text = write([survived] * 9 + [bad], held, tmp_path).read_text()
    assert "**undetected**: features, seed 0, rk4 to 1e-06" in text
    assert "Held(family='body', seed=3" in summary(held) and summary(held) in text
    assert len(json.loads((tmp_path / "stability.json").read_text())["runs"]) == 10
    assert (tmp_path / "figures/stability.png").stat().st_size > 10_000
