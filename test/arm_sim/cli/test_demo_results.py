# SPDX-License-Identifier: Apache-2.0
"""Numbers of a demo run, from what was observed, and what is complained of."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import models
from arm_sim.cli.demo.observer import Observations, Observer, _Query
from arm_sim.cli.demo.report import complaints, numbers, remarks

TIME = np.linspace(0.0, 2.0, 201)
TORQUE = np.column_stack([np.sin(TIME), -3.0 * np.cos(TIME)])
CLOCK: dict[str, Any] = {
    "loop": {
        "ticks": 1990, "elapsed": 2.0, "missed": 3, "dropped": 1,
        "lateness": {"p50": 1e-6, "p99": 2e-6, "max": 3e-6},
    },
    "round_trip": {"count": 1980, "p50": 4e-5, "p99": 5e-5, "max": 6e-5},
}  # fmt: skip


def seen(**changed: Any) -> Observations:
    """Two joints, of which the second has the larger error; it grows after the motion."""
    error = np.column_stack([0.0 * TIME, np.where(TIME <= 1.5, 4e-3 * np.sin(20 * TIME), -0.9)])
    reference = np.column_stack([TIME, -TIME])
    parts: dict[str, Any] = {
        "time": TIME, "reference": reference, "position": reference - error, "error": error,
        "effort": TORQUE, "query_time": TIME[::2], "query_effort": TORQUE[::2] + [0.0, -0.2],
        "query_command": TORQUE[::2], "latencies": np.array([1e-3, 3e-3, 2e-3]),
        "work": np.array([4.0, 9.0, 7.0]), "heat": np.array([3.0, 4.0, 5.0]),
        "residual": np.array([0.0, 1e-6, -2e-6]),
    }  # fmt: skip
    return Observations(**parts | changed)


def told(observed: Observations) -> Any:
    motion: Any = SimpleNamespace(
        model=models.dynamics("two_link").model, trajectory=SimpleNamespace(duration=1.5),
        waypoints=[SimpleNamespace(q=[9.0, 9.0]), SimpleNamespace(q=[2.0, -1.0])],
        effort_share=0.3,
    )  # fmt: skip
    return numbers(motion, observed, CLOCK)


def test_numbers_are_those_of_the_motion() -> None:
    n = SimpleNamespace(**told(seen()))
    assert (n.joints, n.unit, n.duration, n.effort_share) == (2, "rad", 1.5, 0.3)
    assert (n.ticks, n.rate, n.wanted_rate) == (1990, 995.0, 1000.0)
    assert (n.missed, n.dropped, n.commands) == (3, 1, 1980)
    assert (n.lateness_p50, n.lateness_p99, n.lateness_max) == (1e-6, 2e-6, 3e-6)
    assert (n.round_trip_p50, n.round_trip_p99, n.round_trip_max) == (4e-5, 5e-5, 6e-5)
    assert (n.questions, n.service_p50, n.service_max) == (3, 2e-3, 3e-3)
    assert n.service_p99 == pytest.approx(3e-3, rel=0.01)
    assert n.torque_difference == pytest.approx(0.2)
    assert n.error_max == pytest.approx(4e-3, rel=0.01)  # before the motion's end
    assert n.error_rms == pytest.approx(4e-3 / 2, rel=0.05)  # of a sine, in one of two joints
    assert n.goal_distance == pytest.approx(0.1)  # it ended at -1.1
    assert (n.energy_moved, n.energy_dissipated, n.energy_balance) == (7.0, 2.0, 2e-6)
    nothing = np.zeros((0, 2))
    unasked = seen(query_effort=nothing, query_command=nothing, latencies=np.zeros(0))
    n = SimpleNamespace(**told(unasked))
    assert n.questions == 0
    assert np.isnan([n.service_p50, n.service_p99, n.service_max, n.torque_difference]).all()


def test_a_loop_is_closed_within_limits() -> None:
    good = told(seen()) | {"goal_distance": 0.0}
    cases: tuple[tuple[dict[str, Any], str | None], ...] = (
        ({}, None),
        ({"rate": 800.0}, None),
        ({"rate": 799.0}, "799.0 time steps per second instead of 1000"),
        ({"missed": 39}, None),
        ({"missed": 40}, None),
        ({"commands": 150}, None),
        ({"commands": 149}, "only 149 of 1990 states were answered"),
        ({"questions": 0}, "no torque query"),
        ({"error_rms": 0.02, "goal_distance": 0.02}, None),
        ({"error_rms": 0.0201}, "tracking error 0.0201 rad RMS; allowed: 0.02"),
        ({"error_rms": float("nan")}, "tracking error nan rad RMS"),
        ({"goal_distance": 0.03}, "0.03 rad from its goal; allowed: 0.02"),
    )
    for changed, complaint in cases:
        found = complaints(good | changed)
        assert found == [] if complaint is None else len(found) == 1 and complaint in found[0]
        slow, late = "rate" in changed, changed.get("missed", 0) == 40
        assert bool(remarks(good | changed)) == (slow or late)
        assert not late or "too busy: load " in remarks(good | changed)[0]


def test_what_was_observed_is_in_the_time_of_the_motion() -> None:
    """Nothing of before it began, and only answers that succeeded."""
    observer = Observer.__new__(Observer)  # in no graph

    fields = ("reference_position", "feedback_position", "position_error", "effort")

    def state(seconds: float) -> Any:
        numbers = {name: [seconds, k] for k, name in enumerate(fields)}
        numbers |= {"input": seconds, "dissipated": 2 * seconds, "balance": 3 * seconds}
        whole, part = divmod(round(1e9 * seconds), 1_000_000_000)
        stamp = SimpleNamespace(sec=whole, nanosec=part)
        return SimpleNamespace(header=SimpleNamespace(stamp=stamp), **numbers)

    observer.start = 2_000_000_000
    observer._states = [state(s) for s in (1.9, 2.0, 2.5, 3.25)]
    observer._queries = [
        _Query(observer._states[k], 0.01 * k, SimpleNamespace(success=ok, effort=[k, -k]))
        for k, ok in ((1, True), (2, False), (3, True))
    ]
    observer._energies = [state(s) for s in (1.9, 2.0, 2.5)]
    found = observer.observations()
    np.testing.assert_allclose(found.time, [0.0, 0.5, 1.25])
    for k, name in enumerate(("reference", "position", "error", "effort")):
        np.testing.assert_array_equal(getattr(found, name), [[2.0, k], [2.5, k], [3.25, k]])
    np.testing.assert_allclose(found.query_time, [0.0, 1.25])
    np.testing.assert_array_equal(found.query_effort, [[1, -1], [3, -3]])
    np.testing.assert_array_equal(found.query_command, [[2.0, 3], [3.25, 3]])
    np.testing.assert_allclose(found.latencies, [0.01, 0.03])
    energies = found.work, found.heat, found.residual
    np.testing.assert_array_equal(energies, [[2.0, 2.5], [4.0, 5.0], [6.0, 7.5]])
    assert observer.now() == pytest.approx(1.25)
    observer._energies = []
    assert np.isnan(told(observer.observations())["energy_balance"])
