# SPDX-License-Identifier: Apache-2.0
"""Curves beside an arm."""

from typing import Any

import numpy as np
import pytest

from arm_sim.recording.figure import thinned
from arm_sim.view.charts import POINTS, ChartPanel, RollingCharts, Sample, legend


def test_thinned_curves_keep_their_peaks(rng: np.random.Generator) -> None:
    time, values = np.arange(100_000) * 1e-3, 0.01 * rng.standard_normal((100_000, 3))
    values[[1234, 77_777, 99_999], [0, 1, 2]] = 5.0, -7.0, 9.0
    x, y = thinned(time, values, POINTS)
    assert len(x) == len(y) <= 1200
    assert (np.diff(x) >= 0.0).all() and x[-1] == time[-1]
    np.testing.assert_array_equal(y.max(axis=0), values.max(axis=0))
    np.testing.assert_array_equal(y.min(axis=0), values.min(axis=0))
    np.testing.assert_array_equal(thinned(time[:10], values[:10], POINTS)[1], values[:10])
    values[1230] = np.nan  # a velocity that a robot did not tell, beside a peak
    for offset in (-9.0, 0.0, 9.0):
        y = thinned(time, values + offset, POINTS)[1] - offset
        np.testing.assert_allclose(np.nanmax(y, axis=0), np.nanmax(values, axis=0))
        np.testing.assert_allclose(np.nanmin(y, axis=0), np.nanmin(values, axis=0))


@pytest.mark.group("view")
def test_a_panel_has_a_tab_of_each_chart_whose_legend_follows_the_time(server: Any) -> None:
    time, names = np.arange(4.0), ("hip", "knee")
    rows = np.column_stack([time, 10.0 * time])
    panel = ChartPanel(server)
    chart, empty = (panel.add(title, names) for title in ("torque [N m]", "error [rad]"))
    chart.draw(time, 1.0 + rows)
    plot, text = chart.plot, chart.legend
    assert ">4<" in text.content and ">31<" in text.content  # the last ones
    assert empty.legend.content.count("–") == 2
    assert legend(names, np.array([1.0, 1e-12])).count(">0<") == 1  # rounding counts as zero
    assert plot.data[0].tolist() == time.tolist()
    assert [curve.tolist() for curve in plot.data[1:3]] == (1.0 + rows).T.tolist()
    for now, values in ((2.0, ">3<"), (1.5, ">2<"), (-1.0, ">1<"), (9.0, ">4<")):
        panel.show_values(now)
        assert values in text.content


@pytest.mark.group("view")
def test_rolling_plots_forget_what_is_old_and_leave_out_what_is_unknown(server: Any) -> None:
    rolling = RollingCharts(server, {"arm": ("hip",)}, ("total",), memory=1.0, sample_period=0.1)
    for k in range(200):
        energy = np.array([np.nan if k < 150 else k])
        rolling.add("arm", 0.01 * k, lambda k=k, e=energy: Sample(np.array([k]), np.zeros(1), e))
    assert rolling.draw() and not rolling.draw(60.0)
    total, _, torque = (chart.plot for chart in rolling._panel.charts.values())
    np.testing.assert_allclose(torque.data[0], 1.0 + 0.1 * np.arange(10))
    np.testing.assert_allclose(torque.data[1], 100.0 + 10.0 * np.arange(10))
    np.testing.assert_allclose(total.data[0], 1.5 + 0.1 * np.arange(5))
    rolling.clear("arm")
    rolling.draw()
    assert "–" in rolling._charts["arm"]["torque"].legend.content
