# SPDX-License-Identifier: Apache-2.0
"""The description of a scene's springs."""

from __future__ import annotations

import re
from pathlib import Path

import yaml
from click.testing import CliRunner

import models
from arm_sim.cli.main import main


def described(file: Path) -> str:
    done = CliRunner().invoke(main, ["describe", str(file)], env={"COLUMNS": "160"})
    assert done.exit_code == 0, done.output
    return re.sub(r"\s+", " ", done.output)


def test_describe_lists_springs(tmp_path: Path) -> None:
    scene = {
        "robot": {"urdf": str(models.SCENES / "two_link.urdf")},
        "joints": {"elbow": {"spring": {"stiffness": 12.5, "rest": 0.3, "damping": 0.7}}},
        "springs": [
            {"frames": ["forearm", "world"], "stiffness": 80, "rest_length": 0.2, "damping": 2},
            {"name": "lift", "frames": ["upper_arm", "world"], "force": -50},
            {"name": "strap", "frames": ["base", "tip"], "stiffness": 9, "tension_only": True},
        ],
    }
    file = tmp_path / "scene.yaml"
    file.write_text(yaml.safe_dump(scene))
    text = described(file)
    for words in (
        "elbow joint 12.5 0.3 0.7",
        "spring_0 forearm to world 80 0.2 2",
        "lift upper_arm to world, -50 N 0 0 0",
        "strap cord, base to tip 9 0 0",
        "computed springs 1 of joints, 3 between points",
    ):
        assert words in text


def test_describe_of_an_arm_without_springs_says_so() -> None:
    text = described(models.SCENES / "two_link.yaml")
    assert "skipped springs, " in text
    assert "at rest" not in text
