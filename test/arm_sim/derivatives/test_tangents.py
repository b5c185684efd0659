# SPDX-License-Identifier: Apache-2.0
"""Derivatives of ticks of many arms: each is as alone, and as on the virtual machine."""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import InvalidInput
from arm_sim import Simulator
from tolerances import BACKENDS, assert_close


def many(sim: Simulator, arms: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    q = sim.model.q0 + 0.2 * rng.uniform(-1, 1, (arms, sim.n))
    return q, rng.normal(size=(arms, sim.n)), rng.normal(size=(arms, sim.n))


@pytest.mark.parametrize("ticks", [1, 3])
def test_many_are_each_alone(ticks: int) -> None:
    """To the bit, whatever the lanes and threads; the last group is not full."""
    sim = models.simulator("skew_axes", stops=False, integrator="rk4")
    q, v, tau = many(sim, 11)
    wide, narrow = (
        sim.linearize_many(q, v, tau, ticks, lanes=lanes, threads=threads)
        for lanes, threads in ((4, 1), (1, 2))
    )
    for one, other in zip(wide, narrow, strict=True):
        np.testing.assert_array_equal(one, other)
    for arm in range(len(q)):
        A, B = sim.linearize(sim.reset(q[arm], v[arm]), tau[arm], ticks)
        np.testing.assert_array_equal(wide[0][arm], A)
        np.testing.assert_array_equal(wide[1][arm], B)


def test_many_with_events() -> None:
    """An arm that meets its stop goes its own way among those that do not."""
    sim = models.simulator("two_link", integrator="rk4", dt=1e-2)
    place = sim.model.stops.place[1]
    q = np.array([[0.1, 0.2], [place[0] - 1e-3, 0.2], [0.3, -0.1]])
    v = np.array([[0.1, 0.2], [0.5, 0.0], [0.0, 0.4]])
    A, B = sim.linearize_many(q, v, np.zeros(2))
    for arm in range(3):
        alone = sim.linearize(sim.reset(q[arm], v[arm]), np.zeros(2))
        np.testing.assert_array_equal(A[arm], alone[0])
        np.testing.assert_array_equal(B[arm], alone[1])
    assert np.abs(A[1] - A[0]).max() > 0.1  # it bounced


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"q": np.zeros((2, 3))}, r"^q has shape \(2, 3\); \(2,\) or \(k, 2\) is expected"),
        ({"q": np.zeros((0, 2))}, r"^q has shape \(0, 2\); .* with k ≥ 1 is expected"),
        ({"v": np.zeros((3, 2))}, "^v: 3 arms, but q has 2"),
        ({"tau": np.zeros((3, 2))}, "tau"),
        ({"tau": [np.nan, 0.0]}, "finite"),
        ({"ticks": 0}, "ticks"),
        ({"lanes": 3}, "lanes"),
        ({"threads": 0}, "threads"),
    ],
)
def test_refusals(change: dict[str, Any], message: str) -> None:
    sim = models.simulator("two_link")
    given = {"q": np.zeros((2, 2)), "v": np.zeros((2, 2)), "tau": np.zeros(2)} | change
    with pytest.raises(InvalidInput, match=message):
        sim.linearize_many(**given)


@pytest.mark.parametrize("options", [{"integrator": "rk4"}, {"tolerance": 1e-9, "dt": 0.02}])
def test_without_a_compiler(options: dict[str, Any]) -> None:
    """The same functions run on the virtual machine."""
    found = []
    for backend in ("auto", "vm"):
        sim = models.simulator("skew_axes", stops=False, backend=backend, **options)
        q, v, tau = many(sim, 2)
        found.append(np.concatenate(sim.linearize_many(q, v, tau), axis=2))
    assert_close(found[0], found[1], BACKENDS)
