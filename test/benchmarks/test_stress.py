# SPDX-License-Identifier: Apache-2.0
"""On a few random arms nothing fails silently; and the stress test would notice it."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp

from arm_dynamics import ArmModel, load_scene
from arm_sim import Recording, Simulator
from arm_sim.integrators.methods import METHODS
from benchmarks.stress import verdict
from benchmarks.stress.arms import HARDSHIPS, Arm, draw
from benchmarks.stress.balances import energy_balance, impulse_balance
from benchmarks.stress.cli import main
from benchmarks.stress.motion import HORIZON, solve
from benchmarks.stress.page import page, plain, write
from benchmarks.stress.survey import Found, Plan, examine, survey
from benchmarks.stress.verdict import (
    ENERGY,
    FORBIDDEN,
    IMPULSE,
    NAN,
    SHOWN,
    STOPPED,
    SURVIVED,
    UNDETECTED,
    Result,
    Setting,
    attempt,
)

SMALL = Plan((1e-2, 1e-3), (1e-6,), most_joints=3, horizon=0.1, backend="vm")
ABSURD = (7,)  # torques that no method can follow; without a compiler giving up takes long
SEEDS = sorted({*range(12)} - {*ABSURD})
EASY = [seed for seed in SEEDS if not draw(seed, SMALL.most_joints).dry][:3]
DRY = [seed for seed in SEEDS if draw(seed, SMALL.most_joints).dry][:1]  # needs a compiler
ROUGH = replace(SMALL, steps=(1e-2,))
COMPILED = replace(ROUGH, backend="auto")
ONE_STEP = replace(SMALL, steps=(1e-3,), backend="auto")
QUIET = Setting("euler", 1e-2)  # throws a light link about; the heavy one's energy hides it
AGREE = 1e-8  # the reference against SciPy on Pinocchio


@pytest.fixture(scope="module")
def found() -> list[Found]:
    easy = [examine(seed, SMALL) for seed in EASY]
    dry = [examine(seed, ONE_STEP) for seed in DRY]
    return easy + dry + [examine(seed, COMPILED) for seed in ABSURD]


def test_nothing_fails_silently(found: list[Found]) -> None:
    bad = [(r.seed, r.name, r.dt, r.outcome) for one in found for r in one.results
           if r.outcome in FORBIDDEN]  # fmt: skip
    assert bad == []


def test_every_method_is_tried_and_most_survive(found: list[Found]) -> None:
    assert {s.method for s in SMALL.settings()} == set(METHODS)
    assert {s.tolerance for s in SMALL.settings()} == {None, 1e-6}
    count = Counter(r.outcome for one in found if one.seed not in ABSURD for r in one.results)
    assert count.total() == len(EASY) * len(SMALL.settings()) + len(ONE_STEP.settings())
    assert count[SURVIVED] > 0.8 * count.total()
    stopped = [r for one in found if one.seed in ABSURD for r in one.results]
    assert sum(r.outcome == STOPPED for r in stopped) > 0.8 * len(stopped)
    assert all("cannot be computed" in r.message for r in stopped if r.outcome == STOPPED)


def test_error_control_delivers(found: list[Found]) -> None:
    """On motions that do not magnify errors, ten times the tolerance of a sub-step at most."""
    errors = [r.error for one in found if one.motion.sensitivity < 100
              for r in one.results if r.claimed is not None]  # fmt: skip
    assert len(errors) > 15
    assert max(error for error in errors if error is not None) < 1e-5


def test_the_same_for_a_seed_in_any_process() -> None:
    [apart] = survey(EASY[:1], ROUGH, workers=1)
    here = [examine(seed, ROUGH) for seed in EASY[:2]]
    once, again, other = (plain([one], ROUGH, 3) for one in (apart, *here))
    assert once == again != other


def test_arms_are_as_hard_as_promised() -> None:
    arms = [draw(seed) for seed in range(150)]
    joints, traits = [arm.n for arm in arms], {t for arm in arms for t in arm.traits}
    assert min(joints) == 1 and max(joints) == 30
    assert {*HARDSHIPS, "no friction", "viscous friction", "dry friction"} <= traits
    masses = [[body.mass for body in list(model.pin.inertias)[1:]] for model in map(_model, arms)]
    assert max(max(of) / min(of) for of in masses) > 3e5
    assert max(abs(arm.v).max() for arm in arms) > 50.0


def test_reference_agrees_with_another_program() -> None:
    arm = draw(42, most_joints=3)
    model = _model(arm)
    motion = solve(arm, model, "vm")
    dynamics = Simulator(model, "euler", backend="vm").dynamics

    def rhs(_t: float, x: np.ndarray) -> np.ndarray:
        q, v = np.split(x, 2)
        return np.concatenate([v, dynamics.forward(q, v, arm.tau)])

    start = np.concatenate([arm.q, arm.v])
    end = solve_ivp(rhs, (0.0, HORIZON), start, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    assert motion.q is not None and motion.known
    np.testing.assert_allclose(motion.q[-1], end[: arm.n], atol=AGREE)
    assert motion.travel > 0.01


def test_balances_of_a_true_motion_are_zero() -> None:
    run = _run(draw(42, 3), Setting("rk4", 1e-4))
    assert energy_balance(run) < 1e-6
    assert impulse_balance(run) < 1e-6


def test_energy_from_nowhere_is_noticed() -> None:
    run = _run(draw(42, 3), Setting("rk4", 1e-3))
    faster = np.linspace(1.0, 2.0, len(run))[:, None] * run.v
    assert energy_balance(replace(run, v=faster)) > ENERGY


def test_a_light_link_is_too_light_for_the_energy_balance() -> None:
    """Its impulse balance gives it away, so the run is not taken for sound."""
    result = _quiet_blow_up()
    assert result.speed is not None and result.speed > 10.0
    assert result.energy is not None and result.energy < ENERGY
    assert result.impulse is not None and result.impulse > IMPULSE
    assert result.outcome == SHOWN and not result.false_alarm


def test_a_blow_up_that_no_balance_shows_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("energy_balance", "impulse_balance"):
        monkeypatch.setattr(verdict, name, lambda run: 0.0)
    assert _quiet_blow_up().outcome == UNDETECTED


def test_a_silent_nan_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    arm = draw(3, 3)
    model = _model(arm)
    motion = solve(arm, model, "vm")
    honest = Simulator.run

    def broken(self: Simulator, *arguments: object) -> Recording:
        run = honest(self, *arguments)
        return replace(run, v=np.where(np.arange(len(run))[:, None] == 5, np.nan, run.v))

    monkeypatch.setattr(Simulator, "run", broken)
    assert attempt(arm, model, motion, Setting("rk4", 1e-2), "vm").outcome == NAN
    assert not solve(arm, model, "vm").finite


def test_report(found: list[Found], tmp_path: Path) -> None:
    text = write(found, SMALL, 0, tmp_path, None).read_text()
    assert "{{" not in text
    assert f"{len(found)} random arms" in text
    saved = json.loads((tmp_path / "stability.json").read_text())
    assert [arm["seed"] for arm in saved["arms"]] == [*EASY, *DRY, *ABSURD]
    assert (tmp_path / "figures/stability.png").stat().st_size > 10_000


def test_report_names_what_must_not_be(found: list[Found]) -> None:
    results = (replace(found[0].results[0], outcome=UNDETECTED), *found[0].results[1:])
    text = page([replace(found[0], results=results), *found[1:]], 0)
    assert "**undetected**: seed 0, euler" in text


def test_help_shows_examples() -> None:
    shown = CliRunner().invoke(main, ["--help"])
    assert shown.exit_code == 0 and "./arm stress --quick" in shown.output


def _model(arm: Arm) -> ArmModel:
    return ArmModel(load_scene(arm.scene))


def _quiet_blow_up() -> Result:
    arm = draw(39, most_joints=3)
    model = _model(arm)
    return attempt(arm, model, solve(arm, model, "vm"), QUIET, "vm")


def _run(arm: Arm, setting: Setting) -> Recording:
    simulator = Simulator(_model(arm), setting.method, setting.dt, backend="vm")
    simulator.reset(arm.q, arm.v)
    return simulator.run(HORIZON, arm.tau)
