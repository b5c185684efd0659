# SPDX-License-Identifier: Apache-2.0
"""The benchmark: its reference, its statistics and its verdicts."""

from functools import partial

import numpy as np
import pytest

from benchmarks.comparison import claims, targets
from benchmarks.comparison.claims import MET, MISSED, OPEN
from benchmarks.measurement.intervals import of_median
from benchmarks.peers.base import OURS, Contestant, halvings
from benchmarks.peers.ours import FixedTrial
from benchmarks.reference import solution
from benchmarks.reference.closed_loop import Loop
from benchmarks.robots.models import Robot, chain


def test_truth_knows_how_good_it_is() -> None:
    robot = Robot("Chain 2", chain(2).urdf, chain(2).q0, duration=0.05)
    free = solution.free_motion(robot)
    assert free.halving < solution.AGREED
    assert free.other < 1e-12
    assert np.abs(free.q - robot.q0).max() > 1e-4
    held = solution.closed_loop(robot, Loop(robot, 20))
    assert held.q.shape == (21, 2)
    assert max(held.halving, held.other) < 1e-12


@pytest.mark.parametrize(("count", "rank"), [(6, 1), (9, 2), (100, 40)])
def test_an_interval_holds_the_median_with_its_confidence(count: int, rank: int) -> None:
    """Ranks of tables, such as Conover, "Practical Nonparametric Statistics", and a simulation."""
    assert of_median(range(1, count + 1)) == (rank, count + 1 - rank)
    samples = np.random.default_rng(0).exponential(size=(2000, count))
    held = [low <= np.log(2.0) <= high for low, high in map(of_median, samples)]
    assert np.mean(held) > 0.94


@pytest.mark.parametrize(
    ("rounds", "verdict"),
    [
        ([0.5, 0.6, 0.5, 0.7, 0.6, 0.6], MET),  # the limit is 0.75
        ([0.9, 0.95, 1.0, 0.8, 0.9, 0.9], MISSED),
        ([0.5, 0.6, 0.5, 0.9, 0.6, 0.6], OPEN),  # of six, all count
    ],
)
def test_a_verdict_on_a_time_does_not_turn_with_the_host(
    rounds: list[float], verdict: str
) -> None:
    slow = [1.0 + k**2 for k in range(len(rounds))]  # the host slows both down
    rows = [
        {"robot": "Panda", "what": "step", "who": who, "ns": 1.0, "rounds_ns": taken}
        for who, taken in (
            (f"{OURS} rk4", [a * b for a, b in zip(rounds, slow, strict=True)]),
            ("MuJoCo Euler", slow),
        )
    ]
    results = {"cost": {"rows": rows}}
    [claim] = [c for c in claims.check(results) if "Euler" in c["text"]]
    assert claim["verdict"] == verdict
    assert claim["value"] == pytest.approx(np.median(rounds))


def test_steps_and_targets() -> None:
    assert halvings(8e-3, 1e-3) == (8e-3, 4e-3, 2e-3, 1e-3)
    with pytest.raises(ValueError, match=r"0\.016 s does not divide 1\.0 s"):
        Contestant(OURS, "euler", "step", (0.016,), (), partial(FixedTrial, "euler"))
    points = [
        {"method": "slow", "error_rad": e, "cpu_s": c}
        for e, c in ((1e-2, 1.0), (1e-4, 100.0), (None, 1e4))
    ]
    cost, method = targets.cheapest(points, 1e-3)
    assert method == "slow"
    assert cost == pytest.approx(10.0)
    assert targets.cheapest(points, 1e-5) is None
    assert targets.cheapest(points, 1.0) == (1.0, "slow")
