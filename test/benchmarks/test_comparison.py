# SPDX-License-Identifier: Apache-2.0
"""The benchmark: its reference, its clocks and its report on a tiny problem."""

from functools import partial
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from benchmarks.comparison import claims, targets
from benchmarks.comparison.claims import MET, MISSED, MISSING, OPEN
from benchmarks.comparison.report import summary, write
from benchmarks.comparison.suite import judged
from benchmarks.measurement.intervals import of_median
from benchmarks.peers.base import OURS, Contestant, halvings
from benchmarks.peers.ours import FixedTrial
from benchmarks.reference import solution
from benchmarks.reference.closed_loop import Loop
from benchmarks.reporting.progress import Bar
from benchmarks.robots.models import Robot, chain
from benchmarks.studies import energy, model_agreement, work_precision
from benchmarks.studies.bench import Bench


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    """One contestant and a chain of two links for a twentieth of a second."""
    small = Robot("Chain 2", chain(2).urdf, chain(2).q0, duration=0.05)
    build = partial(FixedTrial, "euler")
    who = Contestant(OURS, "euler", "step", (5e-3, 2.5e-3, 1e-3), (1e-3,), build)
    bench = Bench([who], Bar(Console(file=StringIO())), quick=True)
    monkeypatch.setattr(Bench, "repeats", 1)
    monkeypatch.setattr(Bench, "robots", lambda self: [small])
    monkeypatch.setattr(work_precision, "Loop", lambda robot, ticks: Loop(robot, 20))
    return bench


def test_truth_knows_how_good_it_is(bench: Bench) -> None:
    [robot] = bench.robots()
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


def test_report_of_a_tiny_run(bench: Bench, tmp_path: Path) -> None:
    """With a row or two in the studies that need peers or much time."""
    found = work_precision.run(bench)
    errors = [p["error_rad"] for p in found["points"] if p["scenario"] == "free motion"]
    assert errors[0] > errors[1] > 0, "the error must fall with the step"
    assert all(p["cpu_s"] > 0 for p in found["points"])
    steps = [
        (f"{OURS} rk4", "step", 1000.0),
        ("MuJoCo Euler", "step", 2000.0),
        (OURS, "evaluation", 100.0),
        ("Pinocchio's ABA from C++", "evaluation", 2000.0),
    ]
    start = {"total without imports": 6.0, "processor": 1.0}
    results = judged({
        "about": {
            "date": "today", "processor": "one", "compiler": "none", "versions": {"numpy": "2"},
            "repeats": 1, "elapsed_s": 1.0, "quick": True, "left_out": {"Drake": "no module"},
            "notes": {}, "noise": bench.noise.summary(),
        },
        "model_agreement": model_agreement.run(bench),
        "work_precision": found,
        "cost": {
            "rows": [{"robot": "Panda", "who": who, "what": what, "ns": ns, "rounds_ns": [ns] * 6}
                     for who, what, ns in steps],
            "growth": [{"joints": 2, "who": who, "ns": 1.0}
                       for who in ("MuJoCo RK4", "dynibo from Python")],
        },
        "energy": energy.run(bench),
        "startup": {"rows": [{"robot": name, "joints": 7, "cold_s": start, "cached_s": start,
                              "cold_rounds_s": [6.0], "cached_rounds_s": [6.0] * 3}
                             for name in ("Panda", "Chain 2")]},
    })  # fmt: skip
    report = write(results, tmp_path).read_text()
    for row in (
        "left out, not installed: Drake",
        "| RK4 step of Panda ÷ MuJoCo's Euler step | 0.50 | 0.50 to 0.50 | 0.75 | met |",
        "| forward dynamics ÷ Pinocchio's ABA from C++ | 1/20 | 1/20 to 1/20 | 0.40 | met |",
        "| cold start of Panda | 6 s | too few rounds | 5 s | open |",
        "![work precision chain 2](work_precision_chain_2.png)",
    ):
        assert row in report
    assert (tmp_path / "work_precision_chain_2.png").stat().st_size > 10_000
    assert MISSING in {c["verdict"] for c in results["claims"]}
    assert summary(results).row_count == len(results["claims"])
