# SPDX-License-Identifier: Apache-2.0
"""The command ``./arm sweep``."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from click.testing import CliRunner, Result

from arm_studies.cli.main import main
from arm_studies.cli.sweep import _losses
from arm_studies.sweeps import load_study, sweep

STUDY = """\
scene: two_link
duration: 0.05
motion: {points: [{time: 0.05, position: {elbow: 0.85}}]}
vary:
  controller: [pd, pd_gravity]
  joints.elbow.friction.viscous: {uniform: [0.1, 0.5]}
"""


def run(tmp_path: Path, text: str, *options: str) -> Result:
    file = tmp_path / "study.yaml"
    file.write_text(text)
    command = ["sweep", str(file), "--out", str(tmp_path / "out"), "--workers", "1", *options]
    return CliRunner().invoke(main, command)


def test_few_runs_are_lines_of_a_table(tmp_path: Path) -> None:
    done = run(tmp_path, STUDY + "samples: 3\n")
    assert done.exit_code == 0, done.output
    assert "6 runs simulated in" in done.stdout and "6 in compiled code" in done.stdout
    for name in ("scatter.png", "distribution.png", "runs.jsonl"):
        assert (tmp_path / "out" / name).stat().st_size > 100
    again = run(tmp_path, STUDY + "samples: 3\n")
    assert "all 6 runs were done before" in again.stdout
    made = sweep(load_study(tmp_path / "study.yaml"), tmp_path / "out", workers=1).table
    lines = [line.split() for line in done.stdout.splitlines() if line.rstrip().endswith("done")]
    assert [line[1] for line in lines] == made["controller"].tolist()
    for value, line in zip(made["energy"].tolist(), lines, strict=True):
        assert f"{value:.4g}" in line


def test_many_runs_are_summed_up_by_what_is_varied_in_words(tmp_path: Path) -> None:
    done = run(tmp_path, STUDY + "samples: 15\n", "--no-figures")
    assert done.exit_code == 0, done.output
    assert "median" in done.stdout and "largest" in done.stdout
    assert not (tmp_path / "out" / "scatter.png").exists()
    made = sweep(load_study(tmp_path / "study.yaml"), tmp_path / "out", workers=1).table
    for controller in ("pd", "pd_gravity"):
        values = made["energy"][made["controller"] == controller]
        cells = [f"{x:.4g}" for x in np.percentile(values, (5, 50, 95, 100))]
        (line,) = (x for x in done.stdout.splitlines() if x.split()[:2] == [controller, "energy"])
        assert line.split()[2:] == ["15", *cells]


def test_another_study_in_the_folder_is_refused(tmp_path: Path) -> None:
    run(tmp_path, STUDY, "--no-figures")
    done = run(tmp_path, STUDY + "seed: 2\n", "--no-figures")
    assert done.exit_code == 1
    assert "'study.seed' was not given and is 2" in done.output


def test_the_first_run_of_each_kind_that_was_lost_is_named() -> None:
    table = {
        "run": np.arange(5),
        "status": np.array(["done", "diverged", "failed", "done", "diverged"]),
        "note": np.array(["", "at 0.1 s", "no room", "", "at 0.2 s"]),
    }
    done: Any = SimpleNamespace(table=table, plan=SimpleNamespace(runs=5))
    assert list(_losses(done)) == [
        "2 of 5 runs diverged; run 1: at 0.1 s", "1 of 5 runs failed; run 2: no room"
    ]  # fmt: skip
