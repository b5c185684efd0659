# SPDX-License-Identifier: Apache-2.0
"""The accuracy report on one problem with few steps: its orders, its gates, its page."""

import json
from dataclasses import replace
from functools import cache
from io import StringIO
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from rich.console import Console

import tolerances
from arm_sim.integrators.methods import METHODS
from benchmarks.accuracy import cli, page, problems, wheels

PENDULUM = problems.all_problems(tolerances.TRAJECTORY)[0]
SMALL = replace(
    PENDULUM,
    expected={t: PENDULUM.expected[t] for t in (1.0, 2.0)},
    steps=(0.02, 0.01, 0.005, 0.001),
    ticks=problems.TICKS[1:],
)


@cache
def results() -> dict[str, Any]:
    few = {"STEPS": {"Euler": (1e-3,)}, "REPEATS": 1, "WHEELS": 1}
    with patch.multiple(wheels, **few):
        return cli.run([SMALL], Console(file=StringIO()))


@pytest.mark.parametrize("name", ["midpoint", "heun", "rk4"])
def test_orders(name: str) -> None:
    [order] = [r["order"] for r in results()["orders"] if r["method"] == name]
    assert abs(order - METHODS[name].order) < tolerances.ORDER


def test_page_json_and_figure(tmp_path: Path) -> None:
    path = page.write(results(), tmp_path)
    text = path.read_text()
    assert "## Orders" in text and "{" not in text
    assert json.loads((tmp_path / "accuracy.json").read_text())["fixed"] == results()["fixed"]
    assert (tmp_path / "figures/accuracy.png").stat().st_size > 10_000
