# SPDX-License-Identifier: Apache-2.0
"""The stress test would notice a fault."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from arm_dynamics import ArmModel, load_scene
from arm_sim import Recording, Simulator
from benchmarks.stress import judge
from benchmarks.stress.holding import measured
from benchmarks.stress.judge import (
    FORBIDDEN,
    NAN,
    REFUSED,
    SHOWN,
    SURVIVED,
    UNDETECTED,
    Result,
    Truth,
    examine,
)
from benchmarks.stress.scenes import PIECE, PIECES, Case, Way

BLANK = Result("features", 0, "rk4", 1e-3, REFUSED)


def test_two_truths_agree() -> None:
    """Of a chain with friction, stops and a payload, by the independent simulator."""
    results = examine("features", 0, 3, share=1.0)
    assert not {r.outcome for r in results} & {*FORBIDDEN}
    assert 0.0 < max(r.apart or 0.0 for r in results) < 1e-11


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
