# SPDX-License-Identifier: Apache-2.0
"""Random sets of features: they are drawn as specified, and a fault would be noticed."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from arm_dynamics import ArmModel, load_scene
from arm_sim import Recording, Simulator
from benchmarks.stress import page as arms_page
from benchmarks.stress.together import apart, judge, page, peer, survey, tables
from benchmarks.stress.together.cases import EXTREMES, FAMILIAR, HORIZON, Case, Drive, draw
from benchmarks.stress.together.judge import CRASHED, MUJOCO, PATIENCE, SLOW, WRONG, Result, Truth
from benchmarks.stress.verdict import NAN, REFUSED, SHOWN, SURVIVED, UNDETECTED, Setting
from models import features

SMOOTH = ("viscous", "armature", "spring", "payload", "point spring")
ROD = ("viscous", "bilateral")
SAME_MODEL = 1e-6  # [rad] between two programs: a payload needs an inertia in MuJoCo
BLANK = Result(0, 0, "rk4", 1e-3, "planar: viscous", REFUSED)


@pytest.fixture(scope="module")
def cases() -> list[Case]:
    return [draw(seed, 2) for seed in range(60)]


@pytest.fixture(scope="module")
def run() -> Recording:
    """A smooth fall of the planar arm."""
    return Simulator(features.scene("planar", ("viscous",)), "rk4", 1e-3, backend="vm").run(0.05)


def test_draws_are_as_promised(cases: list[Case]) -> None:
    assert {case.arm for case in cases} == {"planar", "panda"}
    sizes = [len(case.features) for case in cases]
    assert min(sizes) == 2 and max(sizes) == 8
    assert {e for case in cases for e in case.extremes} == {*EXTREMES}
    assert {d.kind for case in cases for d in case.drives} == {"constant", "chirp", "bang-bang"}
    assert {f for case in cases for f in case.features} == {*features.ALL, *features.TOUCHING}
    for case in cases:
        assert 0.25e-3 <= case.setting.dt <= 4e-3
        for drive in case.drives:
            assert len(drive.command) == round(HORIZON / case.setting.dt)


def test_a_seed_is_a_case(cases: list[Case]) -> None:
    again = draw(7, 2)
    assert again.scene == cases[7].scene and again.setting == cases[7].setting
    np.testing.assert_array_equal(again.drives[1].command, cases[7].drives[1].command)
    assert draw(8, 2).scene != again.scene


def test_extremes_reach_every_number_of_their_kind() -> None:
    drawn = (draw(seed, 1) for seed in range(200))
    stiff = (case for case in drawn if "stiffness x100" in case.extremes)
    case = next(case for case in stiff if {"spring", "point spring"} <= {*case.features})
    spring = case.scene["joints"][features.ARMS[case.arm]["joints"][1]]["spring"]
    assert spring["stiffness"] == 100 * features.JOINT["spring"][1]["spring"]["stiffness"]
    assert case.scene["springs"][0]["stiffness"] == 3000.0


def test_starts_are_within_the_stops(cases: list[Case]) -> None:
    stopped = [case for case in cases if "end stop" in case.features]
    assert stopped
    for case in stopped:
        about = features.ARMS[case.arm]
        names = ArmModel(load_scene(case.scene)).joint_names
        k = names.index(about["joints"][1])
        for drive in case.drives:
            assert (drive.q[:, k] >= about["stop"]["lower"]).all()
            assert (drive.q[:, k] <= about["stop"]["upper"]).all()


def test_a_right_motion_survives(run: Recording) -> None:
    found = judge._judged(BLANK, run, False, Truth(run.q, True))
    assert (found.outcome, found.error, found.told) == (SURVIVED, 0.0, ())


def test_a_wrong_motion_that_nothing_tells_is_undetected(run: Recording) -> None:
    truth = Truth(run.q * (1 + np.linspace(0, 4 * WRONG, len(run)))[:, None], True)
    assert judge._judged(BLANK, run, False, truth).outcome == UNDETECTED
    stated = replace(run, local_error=np.full(len(run), 1.0))
    assert judge._judged(BLANK, stated, True, truth).outcome == SHOWN
    piled = replace(run, time_stepped=np.ones(len(run)))
    assert judge._judged(BLANK, piled, False, truth).outcome == SHOWN
    assert judge._judged(BLANK, run, False, replace(truth, steady=False)).outcome == SURVIVED


def test_energy_from_nowhere_is_shown_or_a_false_alarm(run: Recording) -> None:
    faster = replace(run, v=run.v * np.linspace(1, 2, len(run))[:, None])
    assert judge._judged(BLANK, faster, False, Truth(run.q + 0.02, True)).outcome == SHOWN
    alarm = judge._judged(BLANK, faster, False, Truth(run.q, True))
    assert alarm.outcome == SURVIVED and alarm.false_alarm


def test_a_slow_tick_is_noticed(run: Recording) -> None:
    slow = replace(BLANK, slowest=2 * PATIENCE)
    assert judge._judged(slow, run, False, Truth(run.q, True)).outcome == SLOW


def test_a_silent_nan_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    sim = Simulator(features.scene("planar", ("viscous",)), "rk4", 1e-3, backend="vm")
    honest = sim.run(0.01)
    broken = replace(honest, v=np.where(np.arange(len(honest))[:, None] == 5, np.nan, honest.v))
    monkeypatch.setattr(Simulator, "run", lambda *arguments: broken)
    start, drive = (honest.q[0], honest.v[0]), Drive("constant", *[np.zeros((10, 3))] * 3)
    assert judge._attempt(BLANK, sim, start, drive, Truth(honest.q, True)).outcome == NAN


def test_the_same_in_any_process_and_mostly_right() -> None:
    seed = 31  # friction, armature and a motor: smooth
    [apart_] = survey([seed], 1, workers=1)
    once, again = (tables.plain(found) for found in (apart_, list(judge.examine(seed, 1))))
    assert once == again
    assert apart_[0].outcome == SURVIVED and apart_[0].steady
    assert apart_[0].error is not None and apart_[0].error < 1e-6


def test_a_case_that_does_not_end_is_a_result(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(apart, "PATIENCE", 0.0)
    [result] = apart._watched(0, 1, str(tmp_path))
    assert result.outcome == SLOW and result.label == draw(0, 1).label


def test_a_process_that_dies_is_a_result() -> None:
    [result] = apart._watched(0, 1, None)  # type: ignore[arg-type]  it cannot set its folder
    assert result.outcome == CRASHED


@pytest.mark.group("bench")
@pytest.mark.parametrize("chosen", [SMOOTH, ROD], ids=["smooth", "rod"])
def test_mujoco_gets_the_same_arm(chosen: tuple[str, ...]) -> None:
    assert {*chosen} <= {*FAMILIAR}
    scene = features.scene("planar", chosen)
    sim, dt = Simulator(scene, "dop853", 1e-3, 1e-10), 1e-4
    torque = np.array([features.command("planar", scene).get(n, 0.0) for n in sim.joint_names])
    start = np.array(sim.state.q), np.array(sim.state.v)
    wanted = sim.run(0.1, torque).q
    case = Case(0, "planar", chosen, (), scene, Setting("rk4", dt), ())
    q, warned = peer.follow(case, start, np.tile(torque, (1000, 1)), sim.joint_names)
    assert not warned
    np.testing.assert_allclose(q[::10], wanted, atol=SAME_MODEL)


def test_report(tmp_path: Path) -> None:
    ours = replace(BLANK, outcome=UNDETECTED, error=0.3, steady=True, slowest=1e-3)
    theirs = replace(BLANK, outcome=SURVIVED, program=MUJOCO, name="RK4", error=1e-3, steady=True)
    (tmp_path / "stability.md").write_text(f"before\n{page.BEGIN}\nearlier\n{page.END}\nafter\n")
    text = page.write([ours, theirs], tmp_path, None).read_text()
    assert "{{" not in text and "**undetected**: seed 0, run 0, rk4" in text
    assert "None of arm_sim's runs stopped." in text
    whole = (tmp_path / "stability.md").read_text()
    assert text.strip() in whole and "earlier" not in whole and whole.endswith("after\n")
    assert len(json.loads((tmp_path / "stability-features.json").read_text())) == 2


def test_the_page_of_arms_keeps_the_section(tmp_path: Path) -> None:
    path = tmp_path / "stability.md"
    assert page.within(path) == page.NONE
    path.write_text(page.spliced(arms_page.TEMPLATE.read_text(), "the section"))
    assert page.within(path) == "the section"
