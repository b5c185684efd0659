# SPDX-License-Identifier: Apache-2.0
"""The comparison of controllers: its measurements, and well-known results."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from arm_dynamics import ArmModel, load_scene
from arm_dynamics.control.custom import load_controller
from arm_sim import Simulator
from benchmarks.controllers import cases, cli, measure
from benchmarks.controllers.cases import ARMS, PACES, PLANTS, TASKS
from benchmarks.controllers.cli import main
from benchmarks.controllers.measure import Result, run
from benchmarks.controllers.own import arm_of


@pytest.fixture(scope="module")
def plants() -> dict[str, Simulator]:
    return {name: Simulator(ARMS["two_link"].plant(name), dt=1e-3) for name in PLANTS}


def measured(plants: dict[str, Simulator], plant: str, controller: str, *case: str) -> Result:
    return run(ARMS["two_link"], plants[plant], plant, *case, controller)


def test_the_order_that_everybody_expects(plants: dict[str, Simulator]) -> None:
    """On an exact model knowing more is better; with a wrong payload only the observer is good."""
    line = ("line", "slow")
    names = ("PD", "PD + gravity", "computed torque")
    worse, better, best = (measured(plants, "exact", name, *line).error for name in names)
    assert worse > 10 * better > 100 * best
    plain = measured(plants, "payload", "computed torque", *line)
    helped = measured(plants, "payload", "computed torque + observer", *line)
    assert plain.final > 1.0 > 1e3 * helped.final


def test_numbers_of_a_run(plants: dict[str, Simulator]) -> None:
    arm = ARMS["two_link"]
    jump = measured(plants, "exact", "computed torque", "regulation", "fast")
    way = 1e3 * float(np.linalg.norm(arm.step))
    np.testing.assert_allclose([jump.error, jump.course[0]], way, rtol=1e-9)
    assert jump.final < 1e-6 and jump.aside is None and jump.overshoot < 0.1
    critically = 5.83 / 15.0  # (1 + ω t) exp(-ω t) = 0.02
    np.testing.assert_allclose(jump.settling, critically, rtol=0.1)
    cut = measured(plants, "limits", "computed torque", "regulation", "fast")
    assert cut.saturated > 5.0 * jump.saturated
    assert cut.settling > jump.settling
    sagging = measured(plants, "exact", "PD", "regulation", "fast")
    assert sagging.settling == np.inf


# --- scenes and controllers of one's own -------------------------------------------------------


@pytest.mark.parametrize(
    ("scene", "axes"),
    [("ur5e", "pose"), ("two_link", ("x", "z")), ("double_pendulum", ("z",))],
)  # fmt: skip
def test_any_arm_gets_a_line_that_it_can_follow(scene: str, axes: object) -> None:
    arm = arm_of(scene)
    assert (arm.axes, arm.key) == (axes, scene)
    q, _, _ = arm.lines["fast"].at(np.linspace(0.0, arm.lines["fast"].duration, 50))
    hand = arm.task.pose(q).position
    linear = [i for i, axis in enumerate("xyz") if axis in axes or axes == "pose"]
    np.testing.assert_allclose((hand[-1] - hand[0])[linear], np.array(arm.step)[linear], atol=1e-6)
    assert (q >= arm.nominal.model.position_lower).all()
    assert (q <= arm.nominal.model.position_upper).all()
    np.testing.assert_allclose(arm.payload, 0.05 * ArmModel(load_scene(scene)).total_mass)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["four_bar"], "four_bar has closed chains or contacts"),
        (["motor_pendulum"], "motor_pendulum has motors or flexible joints"),
        (["ur5e", "--frame", "tool"], "frame 'tool' does not move; allowed: "),
        (["two_link", "--step", "1 2"], "--step: 3 numbers are expected, x y z in m"),
        (["two_link", "--controller", "nowhere:Mine"], "controller = 'nowhere:Mine': "),
    ],
)
def test_what_cannot_be_compared_is_refused(words: list[str], said: str) -> None:
    answer = CliRunner().invoke(main, words)
    assert answer.exit_code in (1, 2)
    assert said in answer.output and "Traceback" not in answer.output


def test_a_scene_and_a_controller_of_ones_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cli, "contenders", lambda own: {"PD": "pd"} | {
        name.partition(":")[2]: load_controller(name) for name in own
    })  # fmt: skip
    for place in (cases, measure):  # short runs [s]
        monkeypatch.setattr(place, "JUMP", 0.4)
        monkeypatch.setattr(place, "STAY", 0.1)
    monkeypatch.chdir(tmp_path)
    words = ["two_link", "--controller", "own_controllers:Springs"]
    answer = CliRunner().invoke(main, words)
    assert answer.exit_code == 0, answer.output
    rows = json.loads(Path("reports/compare-controllers/compare_controllers.json").read_text())
    assert answer.output.count("Springs") >= len(PLANTS) * len(TASKS) * len(PACES)
    assert {row["controller"] for row in rows} == {"PD", "Springs"}
    assert len(rows) == 2 * len(PLANTS) * len(TASKS) * len(PACES)
    made = sorted(path.name for path in (tmp_path / "reports/compare-controllers").iterdir())
    assert made == [
        "compare_controllers.json",
        "compare_controllers_two_link_courses.png",
        "compare_controllers_two_link_errors.png",
    ]
