# SPDX-License-Identifier: Apache-2.0
"""The bench of missed events: its blind engines, its second truth, and its verdicts."""

from __future__ import annotations

import numpy as np
import pytest

from arm_sim import Simulator
from arm_sim.stepping import engine
from benchmarks.missed_events.blind import GUARDS, switched_off
from benchmarks.missed_events.cases import Case, draw
from benchmarks.missed_events.judge import RIGHT, examine
from benchmarks.missed_events.second_truth import solve
from models.rotor import rotor


@pytest.mark.parametrize("name", GUARDS)
def test_every_guard_stands_once_in_the_engine(name: str) -> None:
    assert (engine.NATIVE / "events/segments.h").read_text().count(GUARDS[name][0]) == 1


def test_an_engine_without_a_guard_passes_its_event_over() -> None:
    """Without the guard of upper stops a wheel is not stopped within a tick."""
    seed = next(k for k in range(100) if _blinded(k) == "upper stop")
    limits = {"lower": -1.0, "upper": 0.05}
    scene = rotor(0.1) | {"joints": {"axle": {"limits": limits}}}
    with switched_off(seed, "rigid stop"):
        blind = Simulator(scene, dt=0.1)
    for sim, stops in ((blind, False), (Simulator(scene, dt=0.1), True)):
        sim.reset(v=[1.0])
        assert (sim.run(0.1).v[-1, 0] == 0.0) == stops


def test_a_case_that_both_truths_know() -> None:
    found = examine(11, share=1.0)
    assert found.outcome == RIGHT and found.apart < 1e-12


def test_a_case_that_the_second_truth_does_not_know() -> None:
    case = draw(0)
    why = solve(case, (case.q, case.v))
    assert "current_limit" in why


def test_commands_of_the_second_truth_are_those_of_the_ticks() -> None:
    command = np.array([[1.0], [-1.0]])
    case = Case(rotor(0.5), None, 0.1, None, np.zeros(1), np.zeros(1), command, "")
    scene = case.scene | {"robot": {"urdf": case.scene["robot"]["urdf"].replace("axle", "j0")}}
    case = Case(scene | {"joints": {}}, None, 0.1, None, case.q, case.v, command, "")
    q = solve(case, (case.q, case.v))
    np.testing.assert_allclose(np.asarray(q)[:, 0], [0.0, 0.01, 0.02], atol=1e-12)


def _blinded(seed: int) -> str:
    with switched_off(seed, "rigid stop") as name:
        return name
