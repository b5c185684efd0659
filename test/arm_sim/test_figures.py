# SPDX-License-Identifier: Apache-2.0
"""Animations show the given motion, and refuse data that do not match it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from matplotlib import pyplot as plt
from pictures import unseen

import models
from arm_dynamics import InvalidInput
from arm_sim.figures import (
    MOST_FRAMES,
    animation,
    axis_at_right,
    figure,
    frame_points,
    legend_at_right,
    use_style,
)

TIME = np.linspace(0.0, 2.0, 401)  # [s]
TIP = np.stack([np.cos(TIME), np.sin(TIME)], axis=1)
ROD = np.stack([0.0 * TIP, TIP], axis=1)


@pytest.fixture(autouse=True)
def paper() -> Iterator[None]:
    with unseen():
        use_style()
        yield


def test_every_frame_shows_the_motion_at_its_time() -> None:
    ground = np.array([[-1.0, 0.0], [1.0, 0.0]])
    film = animation(TIME, [ROD, (ground, {"color": "k"})], trail=TIP, speed=0.5)
    frames = list(film.new_frame_seq())
    assert len(frames) == MOST_FRAMES and (frames[0], frames[-1]) == (0, 400)
    assert film.event_source.interval == pytest.approx(2000.0 / (MOST_FRAMES - 1) / 0.5, abs=1.0)
    for k in frames:
        trail, rod, still, clock = film._func(k)
        np.testing.assert_array_equal(rod.get_xydata(), ROD[k])
        np.testing.assert_array_equal(still.get_xydata(), ground)
        np.testing.assert_array_equal(trail.get_xydata(), TIP[: k + 1])
        assert clock.get_text() == f"{TIME[k]:.2f} s"


def test_everything_is_inside_the_picture() -> None:
    animation(TIME, [ROD])
    axes = plt.gca()
    assert axes.get_xlim()[0] < TIP[:, 0].min() and axes.get_ylim()[1] > TIP[:, 1].max()
    scale = axes.transData.transform([[0.0, 0.0], [1.0, 1.0]])
    assert np.ptp(scale[:, 0]) == pytest.approx(np.ptp(scale[:, 1]))  # a circle is round


def test_labels_are_shown_below_the_axes_and_inside_the_picture() -> None:
    long = "a label that takes half of the picture"
    animation(TIME, [(ROD, {"label": long}), (ROD, {"label": "b"})], trail=(TIP, {"label": long}))
    figure = plt.gcf()
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.texts] == [long, long, "b"]
    box, axes = legend.get_window_extent(), plt.gca().get_tightbbox()
    assert box.y1 <= axes.y0 + 1.0 and 0.0 <= box.x0 and box.x1 <= figure.bbox.width


def test_nothing_but_a_point_has_limits_around_it() -> None:
    animation(TIME, [np.zeros((401, 1, 2))])
    assert plt.gca().get_xlim()[0] < 0.0 < plt.gca().get_xlim()[1]


@pytest.mark.parametrize("size", [(4.4, 4.4), (6.4, 2.6), (5.5, 5.0)])
def test_the_clock_is_inside_the_picture(size: tuple[float, float]) -> None:
    film = animation(TIME, [ROD], size=size)
    *_, clock = film._func(0)
    figure = plt.gcf()
    box = clock.get_window_extent(figure.canvas.get_renderer())
    assert figure.bbox.y0 <= box.y0 and box.y1 <= figure.bbox.y1


def test_a_trail_that_does_not_go_with_the_times_is_refused() -> None:
    with pytest.raises(InvalidInput, match=r"\(400, 1, 2\) does not match 401 times"):
        animation(TIME, [ROD], trail=np.zeros((400, 2)))


@pytest.mark.parametrize("shape", [(400, 2, 2), (401, 2, 3), (2,)])
def test_a_polyline_that_does_not_go_with_the_times_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(InvalidInput, match="does not match 401 times"):
        animation(TIME, [np.zeros(shape)])


def test_a_film_that_stands_still_is_refused() -> None:
    with pytest.raises(InvalidInput, match="speed = 0; allowed: more than 0"):
        animation(TIME, [ROD], speed=0)


def test_frames_of_an_arm_are_where_its_angles_put_them() -> None:
    q = np.array([[0.3, 0.5], [-1.0, 2.0]])
    points = frame_points(models.dynamics("two_link"), q, ["shoulder", "elbow", "tip"])
    elbow = 0.5 * np.stack([np.cos(q[:, 0]), np.sin(q[:, 0])], axis=1)
    tip = elbow + 0.4 * np.stack([np.cos(q.sum(1)), np.sin(q.sum(1))], axis=1)
    expected = np.stack([0.0 * elbow, elbow, tip], axis=1)
    np.testing.assert_allclose(points, expected, atol=1e-15)


@pytest.mark.parametrize("loc", ["upper right", "center right"])
def test_a_legend_at_the_right_covers_no_axes(loc: str) -> None:
    figure, axes = plt.subplots(2, layout="constrained")
    lines = [line for axis in axes for line in axis.plot([0.0, 1.0])]
    legend_at_right(figure, lines, ["shoulder", "the elbow, which has a long name"], loc)
    figure.canvas.draw()
    legend = figure.legends[0].get_window_extent()
    assert max(axis.get_tightbbox().x1 for axis in axes) <= legend.x0
    assert legend.x1 <= figure.bbox.x1


def test_a_second_axis_has_its_own_scale_and_no_grid() -> None:
    _, axes = plt.subplots()
    other = axis_at_right(axes, "torque [N m]", "tab:red")
    axes.plot([0.0, 1.0], [0.0, 1.0])
    other.plot([0.0, 1.0], [0.0, 500.0])
    assert axes.get_ylim()[1] < 2.0 < 500.0 <= other.get_ylim()[1]
    assert axes.get_xlim() == other.get_xlim()
    assert (other.get_ylabel(), other.yaxis.label.get_color()) == ("torque [N m]", "tab:red")
    assert other.spines["right"].get_visible() and not axes.spines["right"].get_visible()
    plt.gcf().canvas.draw()
    lines = [line.get_visible() for axis in (axes, other) for line in axis.get_ygridlines()[:1]]
    assert lines == [True, False]


def test_a_figure_is_written_where_it_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "figures"
    with figure("one", folder=folder) as axes:
        axes.plot([0.0, 1.0])
    with figure("four", 2, 2, (3.0, 2.0), folder, sharex=True) as axes:
        assert axes.shape == (2, 2)
    assert capsys.readouterr().out.splitlines() == [
        f"figure: {folder / name}.png" for name in ("one", "four")
    ]
    height, width, _ = plt.imread(folder / "four.png").shape
    assert height / width == pytest.approx(2.0 / 3.0, rel=0.01)
    assert plt.imread(folder / "one.png").shape[1] > width
