# SPDX-License-Identifier: Apache-2.0
"""Animations show the given motion, and refuse data that do not match it."""

from collections.abc import Iterator

import numpy as np
import pytest
from matplotlib import pyplot as plt
from pictures import unseen

from arm_dynamics import InvalidInput
from arm_sim.figures import RATE, animation, legend_outside, use_style

TIME = np.linspace(0.0, 2.0, 401)  # [s]
TIP = np.stack([np.cos(TIME), np.sin(TIME)], axis=1)
ROD = np.stack([0.0 * TIP, TIP], axis=1)


@pytest.fixture(autouse=True)
def paper() -> Iterator[None]:
    with unseen():
        use_style()
        yield


def test_every_frame_shows_the_motion_at_its_time() -> None:
    """Labels are below the axes."""
    ground = np.array([[-1.0, 0.0], [1.0, 0.0]])
    film = animation(TIME, [ROD, (ground, {"label": "ground"})], trail=TIP, speed=0.5)
    frames = list(film.new_frame_seq())
    assert len(frames) == 4 * RATE + 1 and (frames[0], frames[-1]) == (0, 400)
    assert film.event_source.interval == pytest.approx(1000.0 / RATE, abs=1.0)
    for k in frames:
        trail, rod, still, clock = film._func(k)
        np.testing.assert_array_equal(rod.get_xydata(), ROD[k])
        np.testing.assert_array_equal(still.get_xydata(), ground)
        np.testing.assert_array_equal(trail.get_xydata(), TIP[: k + 1])
        assert clock.get_text() == f"{TIME[k]:.2f} s"
    (legend,) = plt.gcf().legends
    assert legend.get_window_extent().y1 <= plt.gca().get_tightbbox().y0 + 1.0


def test_a_notebook_shows_a_film_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plt, "get_backend", lambda: "inline")
    shown = plt.get_fignums()
    animation(TIME, [ROD])._repr_mimebundle_()
    assert plt.get_fignums() == shown


@pytest.mark.parametrize("shape", [(400, 2, 2), (401, 2, 3), (2,)])
def test_a_polyline_that_does_not_go_with_the_times_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(InvalidInput, match="does not match 401 times"):
        animation(TIME, [np.zeros(shape)])


@pytest.mark.parametrize("below", [False, True])
def test_a_legend_outside_has_each_label_once_and_covers_no_axes(below: bool) -> None:
    figure, axes = plt.subplots(2, layout="constrained")
    for axis in axes:
        for label in ("shoulder", "the elbow, which has a long name", "a long name, too", "a"):
            axis.plot([0.0, 1.0], label=label)
    legend_outside(figure, below)
    figure.canvas.draw()
    (made,) = figure.legends
    legend, boxes = made.get_window_extent(), [axis.get_tightbbox() for axis in axes]
    assert len(made.texts) == 4 and 0.0 <= legend.x0 and legend.x1 <= figure.bbox.x1
    if below:
        assert legend.y1 <= min(box.y0 for box in boxes) + 1.0
    else:
        assert legend.y0 >= max(box.y1 for box in boxes) - 1.0
