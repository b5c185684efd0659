# SPDX-License-Identifier: Apache-2.0
"""Motions to look at: which state is shown when, with which forces and curves."""

from __future__ import annotations

import numpy as np
import pytest

import models
from arm_sim import Simulator
from arm_sim.exceptions import ViewError
from arm_sim.recording import film_of
from arm_sim.view import Film, Instant
from arm_sim.view.charts import thinned


def test_a_film_shows_the_last_state_up_to_a_time() -> None:
    model, time = models.dynamics("two_link").model, np.array([0.0, 0.1, 0.3])
    q = np.arange(6.0).reshape(3, 2)
    film = Film("arm", model, time, q)
    for at, row in ((-1.0, 0), (0.0, 0), (0.1, 1), (0.29, 1), (0.3, 2), (9.0, 2)):
        shown = film.at(at)
        np.testing.assert_array_equal(shown.q, q[row])
        assert shown.time == time[row]


def test_forces_are_those_of_the_nearest_look() -> None:
    model, time = models.dynamics("two_link").model, np.linspace(0.0, 1.0, 11)
    forces = [np.full((1, 2, 3), float(k)) for k in range(3)]
    stills = tuple(Instant(0.5 * k, np.zeros(2), forces[k]) for k in range(3))
    film = Film("arm", model, time, np.zeros((11, 2)), stills)
    assert [film.at(t).contacts[0, 0, 0] for t in (0.0, 0.21, 0.3, 0.8, 1.0)] == [0, 0, 1, 2, 2]


def test_a_motion_of_another_robot_is_refused() -> None:
    model = models.dynamics("panda").model
    with pytest.raises(ViewError, match=r"shape \(5, 6\) .* arm of 7 joints needs \(5, 7\)"):
        Film("bag", model, np.arange(5.0), np.zeros((5, 6)))


def test_thinned_curves_keep_their_peaks(rng: np.random.Generator) -> None:
    time, values = np.arange(100_000) * 1e-3, 0.01 * rng.standard_normal((100_000, 3))
    values[[1234, 77_777, 99_999], [0, 1, 2]] = 5.0, -7.0, 9.0
    x, y = thinned(time, values)
    assert len(x) == len(y) <= 1200
    assert (np.diff(x) >= 0.0).all()
    np.testing.assert_array_equal(y.max(axis=0), values.max(axis=0))
    np.testing.assert_array_equal(y.min(axis=0), values.min(axis=0))
    few = thinned(time[:10], values[:10])
    np.testing.assert_array_equal(few[1], values[:10])


def test_a_recording_brings_forces_and_an_account_that_closes() -> None:
    sim = Simulator("panda_table")
    recording = sim.run(0.3, control=lambda state: sim.dynamics.gravity(state.q))
    film = film_of(recording, "arm")
    last, contact = film.at(0.3), sim.contact_forces()[0]
    np.testing.assert_allclose(last.contacts[0], [contact.point, contact.force], rtol=1e-9)
    charts = {chart.title: chart for chart in film.charts}
    np.testing.assert_array_equal(charts["torque [N m]"].values, recording.tau)
    energy = charts["energy [J]"]
    closed = energy.values[:, energy.names.index("here + lost - supplied")]
    np.testing.assert_allclose(closed, closed[0], rtol=1e-6)
