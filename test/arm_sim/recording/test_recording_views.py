# SPDX-License-Identifier: Apache-2.0
"""Views of a recording: text, tables, figures."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib import pyplot
from PIL import Image

import models
from arm_dynamics.exceptions import InvalidInput, NotWritten
from arm_sim import Recording, Simulator, State
from arm_sim.servo import JointCommand


@pytest.fixture(scope="module")
def run() -> Recording:
    return Simulator(models.SCENES / "two_link.yaml").run(0.5, [2.0, 0.1])


@pytest.fixture(autouse=True)
def no_window(monkeypatch: pytest.MonkeyPatch) -> object:
    pyplot.switch_backend("agg")
    yield
    pyplot.close("all")


def test_its_text_is_a_few_lines_and_columns_have_names(run: Recording) -> None:
    assert "500 time steps, 0 to 0.5 s" in repr(run).splitlines()[0]
    columns = run.to_dict()
    assert len(columns) == 1 + 3 * len(run.joint_names)
    np.testing.assert_array_equal(columns["velocity.shoulder"], run.v[:, 0])
    np.testing.assert_array_equal(columns["effort.shoulder"], run.tau[:, 0])
    driven = {name.split(".")[0] for name in Simulator("motor_pendulum").run(0.01).to_dict()}
    assert driven >= {"state", "command"}


def test_without_a_display_no_window_opens_and_that_is_told(
    run: Recording, caplog: pytest.LogCaptureFixture
) -> None:
    run.plot().show()
    pyplot.show()
    assert caplog.messages == 2 * [
        "no window: Matplotlib has no display; the figure's savefig('motion.png') writes a file"
    ]


def test_a_figure_shows_every_joint_and_the_account(run: Recording) -> None:
    axes = run.plot(run).axes
    labels = [axis.get_ylabel().split()[0] for axis in axes]
    assert labels == ["position", "velocity", "effort", "energy"]
    assert {"shoulder", "elbow"} <= {line.get_label() for line in axes[0].lines}
    drawn = {x.get_label(): x.get_ydata() for x in axes[-1].lines if x.get_linestyle() == "-"}
    rest = run.potential - run.potential.min()
    for label, values in {
        "T, kinetic": run.kinetic, "V, potential": rest, "T + V": run.kinetic + rest,
        "work": run.supplied, "heat": run.lost,
    }.items():  # fmt: skip
        np.testing.assert_allclose(drawn.pop(label), values, atol=1e-12)
    assert not drawn


def test_what_is_zero_has_no_panel_and_curves_that_coincide_are_one() -> None:
    figure = Simulator("double_pendulum").run(0.5).plot()
    labels = [line.get_label() for line in figure.axes[-1].lines]
    assert labels == ["T, kinetic", "V, potential", "T + V"]  # neither work nor heat
    still = Simulator("ur5e").run(0.01).part(range(1)).plot()
    assert still.axes[0].lines[0].get_label() == "shoulder pan = wrist 3"
    hanging = Simulator("pendulum")
    hanging.reset([0.0])
    assert [axis.get_ylabel() for axis in hanging.run(0.1).plot().axes] == ["position [rad]"]


def test_a_film_shows_the_motion_thirty_times_a_second(tmp_path: Path) -> None:
    run = Simulator(models.SCENES / "four_bar.yaml").run(0.09)
    film = run.animate(tmp_path / "a.gif")
    pytest.raises(NotWritten, run.animate, tmp_path / "none/a.gif")
    assert "<video" in film._repr_html_() or "<img" in film._repr_html_()
    with Image.open(tmp_path / "a.gif") as image:
        assert (image.n_frames, image.info["duration"]) == (4, 30)  # [ms]
    _, ground, links, clock = film._func(3)
    np.testing.assert_array_equal(ground.get_xydata()[[1, 4], 0], [0.0, 0.35])
    assert clock.get_text() == "0.09 s"
    (crank, _, rocker), points = run.q[-1], links.get_xydata()
    for end in ([0.1 * np.cos(crank), 0.1 * np.sin(crank)],
                [0.35 + 0.25 * np.cos(rocker), 0.25 * np.sin(rocker)]):  # fmt: skip
        assert np.nanmin(np.linalg.norm(points - end, axis=1)) < 1e-9


@pytest.mark.filterwarnings("error")
def test_a_film_shows_the_plane_of_a_contact() -> None:
    contact = {"type": "contact", "frame": "tip", "plane": {"point": [0.0, 0.0, -0.3]}}
    scene = models.scene("two_link").model_dump(exclude_unset=True)
    _, _, edge, _, _ = Simulator(scene | {"constraints": [contact]}).run(0.05).animate()._func(0)
    np.testing.assert_allclose(edge.get_ydata(), -0.3)
    assert edge.get_label() == "plane of contact" and np.ptp(edge.get_xdata()) > 0.5


def test_a_film_in_space_keeps_the_lengths_of_links_and_its_path_has_every_step() -> None:
    film, lengths = Simulator("panda").run(0.1, np.arange(7.0)).animate(), list[np.ndarray]()
    for frame in (0, 3):
        path, _, arm, _ = film._func(frame)
        lengths.append(np.linalg.norm(np.diff(arm.get_data_3d()), axis=0))
    np.testing.assert_allclose(*lengths, atol=1e-12)
    assert len(path.get_data_3d()[0]) == 91


def test_a_film_shows_rails_that_stay_and_rods_of_one_length() -> None:
    run = Simulator("trebuchet").run(0.3)
    (constraint,), stone = run.scene.constraints, run.joint_names.index("stone_x")
    _, _, _, rod, rails, _ = run.animate()._func(9)
    length = np.linalg.norm(np.diff(rod.get_xydata()[:2], axis=0))
    assert length == pytest.approx(constraint.distance, abs=1e-6)
    first, carriage, last = rails.get_xydata()[:3, 0]
    assert first < run.q[:, stone].min() < run.q[:, stone].max() < last
    assert carriage == run.q[270, stone]


def test_recordings_have_one_zero_one_legend_and_the_time_of_all() -> None:
    sim = Simulator("pendulum")
    sim.reset([0.0])
    resting = sim.run(0.1)
    sim.set_state([1.0], [0.0])
    swing = sim.run(0.7)  # continues
    figure = resting.plot(swing, swing.part(range(300)))
    assert figure.axes[-1].get_xlim() == (0.0, 0.8)
    (legend,) = figure.legends
    assert [text.get_text()[-1] for text in legend.texts] == ["g", "1", "2", "3"]  # swing
    whole, part = (line.get_ydata() for line in figure.axes[-1].lines[-2:])
    np.testing.assert_array_equal(part, whole[:300])
    lines = swing.plot(*4 * [swing]).legends[0].get_lines()[-5:]
    assert len({(line.get_linestyle(), line.get_linewidth()) for line in lines}) == 5


def test_a_change_between_ticks_does_not_affect_the_torque_before_it() -> None:
    sim = Simulator("motor_pendulum")
    never = sim.run(0.05, [3.0])
    sim.reset()

    def control(state: State) -> list[float]:
        if state.step == 20:
            sim.set_state([0.1], [0.0])
        return [3.0]

    once = sim.run(0.05, control)
    assert [jump.row for jump in once.jumps] == [20]
    np.testing.assert_array_equal(once.ended[:21], never.x[:21])
    np.testing.assert_array_equal(once.tau[:20], never.tau[:20])
    assert (once.tau[20:] != never.tau[20:]).all()


def test_a_part_has_the_rows_that_are_asked_for(run: Recording) -> None:
    """Without states it has no energies and no figure."""
    sim = models.simulator("two_link")
    held = sim.run(0.3, JointCommand(position=sim.state.q))
    assert held.hold is not None and held.hold.any()
    np.testing.assert_array_equal(held.part(range(100, 300, 20)).hold, held.hold[100:300:20])
    np.testing.assert_array_equal(run.part(run.time > 0.2001).time, run.time[201:])
    nothing = run.part(run.time > 1.0)
    assert nothing.energy.shape == nothing.stored.shape == (0,)
    with pytest.raises(InvalidInput, match="without states has nothing to draw"):
        nothing.plot()


def test_a_figure_marks_changes_and_says_units() -> None:
    sim = Simulator("slider_crank_motor")
    units = [axis.get_ylabel() for axis in sim.run(0.01).plot().axes]
    assert units[:2] == ["position [rad, m]", "velocity [rad/s, m/s]"]
    sim = models.simulator("two_link")
    start = sim.model.position_lower + [1.0, 0.01]
    sim.reset(start)

    def control(state: State) -> list[float]:
        if state.step == 60:
            sim.set_state(start, np.zeros(2))
        return (sim.dynamics.gravity(state.q) - [0.0, 20.0]).tolist()  # to the end stop

    for axis in sim.run(0.1, control).plot(joints=["elbow"]).axes:
        (mark,) = (line for line in axis.lines if line.get_linestyle() == ":")
        assert mark.get_xdata()[0] == pytest.approx(0.06)
