# SPDX-License-Identifier: Apache-2.0
"""Views of a recording: text, tables, figures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib import pyplot

import models
from arm_dynamics import InvalidInput
from arm_sim import Recording, Simulator, State
from arm_sim.cli.main import main
from arm_sim.servo import JointCommand


@pytest.fixture(scope="module")
def run() -> Recording:
    return Simulator(models.SCENES / "two_link.yaml").run(0.5, [2.0, 0.1])


@pytest.fixture(autouse=True)
def no_window(monkeypatch: pytest.MonkeyPatch) -> object:
    pyplot.switch_backend("agg")
    yield
    pyplot.close("all")


def test_its_text_is_a_few_lines(run: Recording) -> None:
    lines = repr(run).splitlines()
    assert 3 <= len(lines) <= 6 and "500 ticks, 0 to 0.5 s" in lines[0]
    assert all(name in repr(run) for name in run.joint_names) and "rk4" in repr(run)


def test_columns_have_names(run: Recording) -> None:
    columns = run.to_dict()
    first = run.joint_names[0]
    assert len(columns) == 1 + 3 * len(run.joint_names)
    np.testing.assert_array_equal(columns[f"velocity.{first}"], run.v[:, 0])
    np.testing.assert_array_equal(columns[f"effort.{first}"], run.tau[:, 0])


def test_states_and_commands_of_drives_have_columns() -> None:
    run = Simulator(models.SCENES / "motor_pendulum.yaml").run(0.01)
    columns = run.to_dict()
    assert any(name.startswith("state.") for name in columns)
    assert any(name.startswith("command.") for name in columns)


def test_without_a_display_no_window_opens_and_that_is_told(
    run: Recording, caplog: pytest.LogCaptureFixture
) -> None:
    run.plot().show()
    pyplot.show()
    assert caplog.messages == 2 * [
        "no window: Matplotlib has no display; the figure's savefig('motion.png') writes a file"
    ]


def test_a_figure_shows_every_joint_and_the_account(run: Recording) -> None:
    figure = run.plot()
    labels = [axis.get_ylabel() for axis in figure.axes]
    assert [label.split()[0] for label in labels] == ["position", "velocity", "effort", "energy"]
    shown = {line.get_label() for line in figure.axes[0].lines}
    assert set(run.joint_names) <= shown


def test_colors_begin_again_where_there_are_more_joints(run: Recording) -> None:
    joints = 21 * [run.joint_names[0]]
    colors = [line.get_color() for line in run.plot(joints=joints).axes[0].lines[:21]]
    assert colors[20] == colors[0] and len(set(colors)) == 20


def test_a_second_recording_is_laid_over_the_first_dashed(run: Recording) -> None:
    figure = run.plot(run, joints=run.joint_names[:1])
    drawn = [line for line in figure.axes[1].lines if len(line.get_xdata()) > 2]
    assert [line.get_linestyle() for line in drawn] == ["-", "--"]


def test_long_recordings_are_drawn_with_their_peaks() -> None:
    run = Simulator(models.SCENES / "two_link.yaml").run(20.0, [0.0, 0.0])
    line = run.plot().axes[1].lines[0]
    assert len(line.get_xdata()) < 5000
    assert line.get_ydata().max() == run.v[:, 0].max()


def test_joints_that_are_not_there_are_named(run: Recording) -> None:
    with pytest.raises(InvalidInput, match="nose"):
        run.plot(joints=["nose"])
    other = Simulator(models.SCENES / "pendulum.yaml").run(0.01)
    with pytest.raises(InvalidInput, match="share no joint"):
        run.plot(other)


def test_the_command_says_where_the_figure_is(run: Recording, tmp_path: Path) -> None:
    path, out = run.save(tmp_path / "run.mcap"), tmp_path / "figure.png"
    told = CliRunner().invoke(main, ["plot", str(path), str(path), "--out", str(out)])
    assert told.exit_code == 0 and str(out) in told.output and out.stat().st_size > 10_000
    told = CliRunner().invoke(main, ["plot", str(tmp_path / "none.mcap")])
    assert told.exit_code == 1 and "no recording" in told.output


def test_a_change_between_ticks_does_not_affect_the_torque_before_it() -> None:
    sim = Simulator("motor_pendulum")

    def run(change: int) -> Recording:
        sim.reset()

        def control(state: State) -> list[float]:
            if state.step == change:
                sim.set_state([0.1], [0.0])
            return [3.0]

        return sim.run(0.05, control)

    once, never = run(20), run(-1)
    assert [jump.row for jump in once.jumps] == [20]
    np.testing.assert_array_equal(once.x[20, :2], [0.1, 0.0])
    np.testing.assert_array_equal(once.ended[:21], never.x[:21])
    np.testing.assert_array_equal(once.tau[:20], never.tau[:20])
    assert (once.tau[20:] != never.tau[20:]).all()


def test_a_part_says_what_held_the_arm_there() -> None:
    sim = models.simulator("two_link")
    run = sim.run(0.3, JointCommand(position=sim.state.q))
    assert run.hold is not None and run.hold.any()
    np.testing.assert_array_equal(run.part(range(100, 300, 20)).hold, run.hold[100:300:20])


def test_a_figure_marks_stops_and_changes_and_says_units() -> None:
    sim = Simulator("slider_crank_motor")
    units = [axis.get_ylabel() for axis in sim.run(0.01).plot().axes]
    assert units[:2] == ["position [rad, m]", "velocity [rad/s, m/s]"]
    sim = Simulator("panda")
    start, low = sim.model.q0.copy(), sim.model.position_lower
    start[3] = low[3] + 0.01
    sim.reset(start)

    def control(state: State) -> list[float]:
        if state.step == 60:
            sim.set_state(start, np.zeros(7))
        return (sim.dynamics.gravity(state.q) - [0, 0, 0, 20.0, 0, 0, 0]).tolist()

    run = sim.run(0.1, control)
    axes = run.plot(joints=["panda_joint1", "panda_joint4"]).axes
    curves = [line for line in axes[0].lines if len(line.get_xdata()) > 2]
    first, fourth = (line for line in axes[0].lines if line.get_marker() == "v")
    assert not len(first.get_xdata())  # it never meets its stops
    met = fourth.get_xdata()
    assert len(met) == 2 and met[0] < 0.06 < met[1]  # once before, and once after the change
    assert all(q == pytest.approx(low[3], abs=1e-9) for q in fourth.get_ydata())
    assert fourth.get_color() == curves[1].get_color() != curves[0].get_color()
    for axis in axes:
        (mark,) = (line for line in axis.lines if line.get_linestyle() == ":")
        assert mark.get_xdata()[0] == pytest.approx(0.06)


def test_the_energies_of_a_figure_are_those_of_the_account(run: Recording) -> None:
    axis = run.plot(run).axes[-1]
    drawn = {line.get_label(): line for line in axis.lines if line.get_linestyle() == "-"}
    for label, values in {
        "kinetic": run.kinetic, "total, less the initial": run.energy - run.energy[0],
        "supplied": run.supplied, "lost": run.lost, "unaccounted for": run.balance,
    }.items():  # fmt: skip
        np.testing.assert_array_equal(drawn[label].get_ydata(), values)
    assert len([line for line in axis.lines if line.get_linestyle() == "--"]) == 5
