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


def test_labels_are_shown_below_the_axes_and_inside_the_picture() -> None:
    long = "a label that takes half of the picture"
    animation(TIME, [(ROD, {"label": long}), (ROD, {"label": "b"})], trail=(TIP, {"label": long}))
    figure = plt.gcf()
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.texts] == [long, long, "b"]
    box, axes = legend.get_window_extent(), plt.gca().get_tightbbox()
    assert box.y1 <= axes.y0 + 1.0 and 0.0 <= box.x0 and box.x1 <= figure.bbox.width


@pytest.mark.parametrize("shape", [(400, 2, 2), (401, 2, 3), (2,)])
def test_a_polyline_that_does_not_go_with_the_times_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(InvalidInput, match="does not match 401 times"):
        animation(TIME, [np.zeros(shape)])


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
