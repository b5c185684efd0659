# SPDX-License-Identifier: Apache-2.0
"""Numbers of a demo run, from what was observed, and what is complained of."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from arm_msgs.msg import Energy, TrackingState
from builtin_interfaces.msg import Time
from std_msgs.msg import Header

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
    n = told(seen())
    wanted = {
        "joints": 2, "unit": "rad", "duration": 1.5, "effort_share": 0.3, "ticks": 1990,
        "rate": 995.0, "missed": 3, "dropped": 1, "commands": 1980, "lateness_p99": 2e-6,
        "round_trip_p99": 5e-5, "questions": 3, "service_p50": 2e-3, "service_max": 3e-3,
        "energy_moved": 7.0, "energy_dissipated": 2.0, "energy_balance": 2e-6,
    }  # fmt: skip
    assert {name: n[name] for name in wanted} == wanted
    assert n["torque_difference"] == pytest.approx(0.2)
    assert n["error_max"] == pytest.approx(4e-3, rel=0.01)  # before the motion's end
    assert n["error_rms"] == pytest.approx(4e-3 / 2, rel=0.05)  # of a sine, in one of two joints
    assert n["goal_distance"] == pytest.approx(0.1)  # it ended at -1.1
    nothing = np.zeros((0, 2))
    n = told(seen(query_effort=nothing, query_command=nothing, latencies=np.zeros(0)))
    assert n["questions"] == 0 and np.isnan([n["service_p99"], n["torque_difference"]]).all()


def test_a_loop_is_closed_within_limits() -> None:
    good = told(seen()) | {"goal_distance": 0.0}
    cases: tuple[tuple[dict[str, Any], str | None], ...] = (
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
    observer.start, stamps = 2_000_000_000, (Time(sec=1), Time(sec=2), Time(sec=3))
    states = [TrackingState(header=Header(stamp=x), effort=[x.sec]) for x in stamps]
    observer._states = states
    observer._energies = [Energy(header=state.header, dissipated=1.0) for state in states]
    answers = [SimpleNamespace(success=ok, effort=[7.0]) for ok in (False, True)]
    observer._queries = [_Query(*q) for q in zip(states[1:], (0.1, 0.2), answers, strict=True)]
    found = observer.observations()
    np.testing.assert_array_equal(np.column_stack([found.time, found.effort]), [[0, 2], [1, 3]])
    assert (found.query_time, found.latencies, found.query_effort) == (1.0, 0.2, 7.0)
    assert found.heat.tolist() == [1.0, 1.0] and observer.now() == 1.0
