# SPDX-License-Identifier: Apache-2.0
"""The command ``./arm sweep``."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from arm_studies.cli.main import main

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
    assert "pd_gravity" in done.stdout and "tracking_rms" in done.stdout
    assert "6 runs simulated in" in done.stdout and "6 in compiled code" in done.stdout
    for name in ("scatter.png", "distribution.png", "runs.jsonl"):
        assert (tmp_path / "out" / name).stat().st_size > 100
    again = run(tmp_path, STUDY + "samples: 3\n")
    assert "all 6 runs were done before" in again.stdout


def test_many_runs_are_summed_up_by_what_is_varied_in_words(tmp_path: Path) -> None:
    done = run(tmp_path, STUDY + "samples: 15\n", "--no-figures")
    assert done.exit_code == 0, done.output
    assert "median" in done.stdout and "largest" in done.stdout
    assert done.stdout.count("pd_gravity") == 6
    assert not (tmp_path / "out" / "scatter.png").exists()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("scene: two_link\n", "study.yaml: study: 'duration' is missing"),
        (STUDY.replace("elbow.f", "elbo.f"), "did you mean 'elbow'"),
        (STUDY + "metrics: [enrgy]\n", "did you mean 'energy'"),
        (STUDY + "duration: 1\n", "'duration' is given twice, in lines 2 and 7"),
    ],
)
def test_mistakes_are_one_line(text: str, said: str, tmp_path: Path) -> None:
    done = run(tmp_path, text)
    assert done.exit_code == 1 and said in done.output
    assert "Traceback" not in done.output


def test_another_study_in_the_folder_is_refused(tmp_path: Path) -> None:
    run(tmp_path, STUDY, "--no-figures")
    done = run(tmp_path, STUDY + "seed: 2\n", "--no-figures")
    assert done.exit_code == 1
    assert "'study.seed' was not given and is 2" in done.output
