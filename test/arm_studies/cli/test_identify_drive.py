# SPDX-License-Identifier: Apache-2.0
"""The command ``./arm identify-drive``."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner, Result

from arm_studies.cli.main import main
from arm_studies.identification import drives

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


def test_other_tables_are_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "odd.csv"
    for text, said in (
        ("time,voltage,amps\n0,1,2", "unknown column 'amps'; allowed: time, voltage, current"),
        ("voltage,current\n1,2", "has no column 'time'"),
        ("time,voltage,current\n0,x,2\n", "row 2, column 'voltage' = 'x'"),
        ("", "not a table of numbers"),
        ("time,voltage,current\n0,1\n1,1", "row 2 has 2 columns, the header 3"),
        ("time,voltage,current\n0,1,2\n1,1,3", "at least 20 samples"),
    ):
        path.write_text(text)
        done = typed("--blocked", str(path))
        told = done.output + str(done.exception)
        assert done.exit_code == 1 and "odd.csv" in told and said in told


def test_one_kind_of_drive_at_a_time(blocked: Path) -> None:
    for words in ([], ["--blocked", str(blocked), "--flexible", str(blocked)]):
        done = typed(*words)
        assert done.exit_code == 2 and "exactly one kind of test is expected" in done.output


@pytest.mark.parametrize(
    ("option", "called", "head"),
    [
        ("flexible", "identify_joint", ("torque", "motor", "link")),
        ("bristles", "identify_bristles", ("torque", "position")),
    ],
)
def test_columns_of_other_drives_are_read_by_name(
    option: str, called: str, head: tuple[str, ...], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """In any order; a test that its drive does not follow is told by the exit status."""
    columns = {name: np.sin((2.0 + i) * np.arange(40)) for i, name in enumerate(head)}
    columns = dict(reversed({"time": 0.001 * np.arange(40), **columns}.items()))
    path, seen = tmp_path / "test.csv", []
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, "%.17g", ",", header=", ".join(columns), comments="")
    found = SimpleNamespace(follows=False, residual={}, missing={}, notes=(), estimates={})
    monkeypatch.setattr(drives, called, lambda given: seen.append(given) or found)
    assert typed(f"--{option}", str(path), "--json").exit_code == 1
    (record,) = seen[0] if option == "bristles" else seen
    assert record.name == str(path)
    for name in head:
        np.testing.assert_allclose(getattr(record, name), columns[name])
