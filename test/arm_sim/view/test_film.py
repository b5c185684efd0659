# SPDX-License-Identifier: Apache-2.0
"""Playback of motions: which state is shown when, with which forces and curves."""

from __future__ import annotations

import numpy as np
import pytest

import models
from arm_sim import Simulator
from arm_sim.exceptions import ViewError
from arm_sim.view import Film, Instant
from arm_sim.view.film import film_of


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


def test_a_recording_brings_forces_and_an_account_that_closes() -> None:
    sim = Simulator("panda_table")
    recording = sim.run(0.3, control=lambda state: sim.dynamics.gravity(state.q))
    film = film_of(recording, "arm")
    last, contact = film.at(0.3), sim.contact_forces()[0]
    np.testing.assert_allclose(last.contacts[0], [contact.point, contact.force], rtol=1e-9)
    charts = {chart.title: chart for chart in film.charts}
    np.testing.assert_array_equal(charts["torque [N m]"].values, recording.tau)
    energy = charts["energy [J]"]
    *_, supplied, lost, balance = energy.values.T
    here = energy.values[:, :-3].sum(axis=1)
    np.testing.assert_allclose(here + lost - supplied, here[0] + balance, rtol=1e-12)
    np.testing.assert_allclose(balance, 0.0, atol=1e-6 * abs(here).max())
