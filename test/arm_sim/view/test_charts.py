# SPDX-License-Identifier: Apache-2.0
"""Curves beside an arm."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np
import pytest

from arm_sim.recording.figure import thinned
from arm_sim.view.charts import POINTS, Chart, Charts, with_curves

PAGE = "<html><head></head><body><div></div></body></html>"


def test_thinned_curves_keep_their_peaks(rng: np.random.Generator) -> None:
    time, values = np.arange(100_000) * 1e-3, 0.01 * rng.standard_normal((100_000, 3))
    values[[1234, 77_777, 99_999], [0, 1, 2]] = 5.0, -7.0, 9.0
    x, y = thinned(time, values, POINTS)
    assert len(x) == len(y) <= 1200
    assert (np.diff(x) >= 0.0).all()
    np.testing.assert_array_equal(y.max(axis=0), values.max(axis=0))
    np.testing.assert_array_equal(y.min(axis=0), values.min(axis=0))
    few = thinned(time[:10], values[:10], POINTS)
    np.testing.assert_array_equal(few[1], values[:10])
    values[1230] = np.nan  # a velocity that a robot did not tell, beside a peak
    np.testing.assert_array_equal(
        np.nanmax(thinned(time, values, POINTS)[1], axis=0), y.max(axis=0)
    )


def drawn(page: str) -> Any:
    """What a page says that is to be drawn."""
    found = re.search(r"const drawn = (.*);$", page, re.MULTILINE)
    assert found
    return json.loads(found[1])


def test_a_page_has_the_curves_and_the_clock_of_the_motion() -> None:
    time = np.arange(5) * 0.5
    values = np.column_stack([np.sin(time), np.cos(time)])
    chart = Chart("torque [N m]", ("hip", "knee"), time, values)
    page = with_curves(PAGE, [chart], [0.0, 1.0, 2.0], 8.0)
    assert page.startswith("<html><head></head><body><div></div>")
    assert page.endswith("</body></html>")
    assert "http" not in re.sub(r"http://www\.w3\.org/\S+", "", page)  # nothing from elsewhere
    told = drawn(page)
    assert (told["begin"], told["end"], told["pictures"], told["rate"]) == (0.0, 2.0, 3, 8.0)
    (curves,) = told["charts"]
    assert (curves["title"], curves["names"]) == ("torque [N m]", ["hip", "knee"])
    assert curves["time"] == time.tolist()
    np.testing.assert_allclose(np.transpose(curves["curves"]), values, rtol=1e-5)
    assert with_curves(PAGE, [], [0.0, 1.0], 8.0) == PAGE


def test_a_page_stays_small_and_keeps_peaks_of_a_long_motion() -> None:
    time, values = np.arange(600_000) * 1e-3, np.full((600_000, 7), 1.0 / 3.0)
    values[123_456, 2] = -8.0
    chart = Chart("position [rad]", tuple("abcdefg"), time, values)
    page = with_curves(PAGE, [chart], [0.0, 599.999], 25.0)
    assert len(page) < 100_000
    assert min(drawn(page)["charts"][0]["curves"][2]) == -8.0


def test_what_is_not_finite_is_a_gap_and_a_name_ends_no_script() -> None:
    values = np.array([[1.0], [np.nan], [np.inf], [2.0]])
    chart = Chart("</script>", ("</body>",), np.arange(4.0), values)
    page = with_curves(PAGE, [chart], [0.0, 3.0], 8.0)
    assert (page.count("</script>"), page.count("</body>")) == (1, 1)
    (curves,) = drawn(page)["charts"]
    assert curves["curves"] == [[1.0, None, None, 2.0]]
    assert (curves["title"], curves["names"]) == ("</script>", ["</body>"])


@pytest.mark.group("view")
def test_a_panel_has_a_tab_of_each_chart_whose_legend_follows_the_time(server: Any) -> None:
    time = np.arange(4.0)
    rows = np.column_stack([time, 10.0 * time])
    shown = Charts(
        server,
        [
            Chart("torque [N m]", ("hip", "knee"), time, 1.0 + rows),
            Chart("error [rad]", ("hip", "knee"), time[:0], rows[:0]),
        ],
    )
    (plot, text), (_, empty) = (shown._handles[title] for title in shown._charts)
    assert ">4<" in text.content and ">31<" in text.content  # the last ones
    assert empty.content.count("–") == 2
    assert plot.data[0].tolist() == time.tolist()
    assert [curve.tolist() for curve in plot.data[1:3]] == (1.0 + rows).T.tolist()
    for now, values in ((2.0, ">3<"), (1.5, ">2<"), (-1.0, ">1<"), (9.0, ">4<")):
        shown.read(now)
        assert values in text.content
    shown.update("torque [N m]", time + 4.0, rows + 100.0)
    assert ">103<" in text.content and plot.data[0][0] == 4.0
    assert not Charts(server, [])._handles
