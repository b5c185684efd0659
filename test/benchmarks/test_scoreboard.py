# SPDX-License-Identifier: Apache-2.0
"""The scoreboard: the best of each side, and losses as they are."""

import pytest

from benchmarks.comparison.scoreboard import lines, page
from benchmarks.peers.base import OURS

RESULTS = {
    "cost": {"rows": [
        {"robot": "Panda", "what": "step", "who": f"{OURS} rk4", "ns": 2000.0},
        {"robot": "Panda", "what": "step", "who": f"{OURS} euler", "ns": 500.0},
        {"robot": "Panda", "what": "step", "who": "MuJoCo Euler", "ns": 400.0},
        {"robot": "Panda", "what": "step", "who": "MuJoCo RK4", "ns": 8000.0},
    ]},
    "targets": [
        {"robot": "Panda", "scenario": "free", "duration_s": 1.0, "target_rad": target,
         "family": family, "method": "any", "cpu_s": seconds}
        for target, family, seconds in (
            (1e-6, OURS, 1e-3), (1e-6, "Drake", 0.1), (1e-9, OURS, 2e-3), (1e-9, "Drake", None),
        )
    ],
    "closed_chain": {"rows": [
        {"who": f"{OURS} rk4, 4 ms", "step": 4e-3, "error": 1e-2, "ns": 10.0},
        {"who": f"{OURS} rk4, 1 ms", "step": 1e-3, "error": 1e-6, "ns": 10.0},
        {"who": "MuJoCo Euler, 1 ms", "step": 1e-3, "error": 1e-3, "ns": 20.0},
    ]},
}  # fmt: skip


def test_the_best_of_each_side_are_compared() -> None:
    found = {line.task: line for line in lines(RESULTS)}
    step = found["a step of 1 ms of Panda"]
    assert (step.who, step.peer, step.ratio) == (f"{OURS} euler", "MuJoCo Euler", 1.25)
    fourth = found["a step of fourth order of Panda"]
    assert (fourth.who, fourth.peer, fourth.ratio) == (f"{OURS} rk4", "MuJoCo RK4", 0.25)
    assert found["1 s of Panda, free, to 1e-06 rad"].ratio == pytest.approx(0.01)
    alone = found["1 s of Panda, free, to 1e-09 rad"]
    assert (alone.ours, alone.theirs, alone.ratio) == (2e-3, None, None)


def test_a_solution_that_is_less_exact_than_the_peers_does_not_count() -> None:
    chain = next(line for line in lines(RESULTS) if "four-bar" in line.task)
    assert (chain.who, chain.ratio) == (f"{OURS} rk4, 1 ms", 0.5)


def test_losses_are_named() -> None:
    assert "Behind a peer in: a step of 1 ms of Panda." in page(RESULTS, "")
