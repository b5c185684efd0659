# SPDX-License-Identifier: Apache-2.0
"""The command ``./arm identify-drive``."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from arm_studies.cli.main import main

R, L = 0.8, 2e-3


def typed(*words: str) -> Result:
    return CliRunner().invoke(main, ["identify-drive", *words], env={"COLUMNS": "160"})


@pytest.fixture
def blocked(tmp_path: Path) -> Path:
    """Steps of voltage, and the exponentials that a current follows them in."""
    V, dt = np.repeat([2.0, -3.0, 5.0, 1.0], 25), 1e-3
    i, fade = [0.0], np.exp(-R / L * dt)
    for held in V[:-1]:
        i.append(held / R + (i[-1] - held / R) * fade)
    path, t = tmp_path / "held.csv", dt * np.arange(len(V))
    np.savetxt(path, np.column_stack([t, V, i]), "%.15g", ",", header="time,voltage,current",
               comments="")  # fmt: skip
    return path


def test_a_blocked_motor_is_found(blocked: Path) -> None:
    done = typed("--blocked", str(blocked), "--json")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    found = {name: part["value"] for name, part in told["parameters"].items()}
    assert found == pytest.approx({"resistance": R, "inductance": L}, rel=1e-6)
    assert told["parameters"]["inductance"]["unit"] == "H" and told["follows"]
    assert "resistance" in typed("--blocked", str(blocked)).output


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time,voltage,amps\n0,1,2", "unknown column 'amps'; allowed: time, voltage, current"),
        ("voltage,current\n1,2", "has no column 'time'"),
        ("time,voltage,current\n0,x,2", "not a table of numbers"),
        ("", "not a table of numbers"),
        ("time,voltage,current\n0,1\n1,1", "line 2 has 2 columns, the header 3"),
        ("time,voltage,current\n0,1,2\n1,1,3", "at least 20 samples"),
    ],
)
def test_other_tables_are_refused_by_name(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "odd.csv"
    path.write_text(text)
    done = typed("--blocked", str(path))
    assert done.exit_code == 1 and "odd.csv" in done.output + str(done.exception)
    assert said in done.output + str(done.exception)


def test_one_kind_of_drive_at_a_time(blocked: Path) -> None:
    for words in ([], ["--blocked", str(blocked), "--flexible", str(blocked)]):
        done = typed(*words)
        assert done.exit_code == 2 and "exactly one kind of test is expected" in done.output
