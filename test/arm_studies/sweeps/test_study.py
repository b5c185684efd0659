# SPDX-License-Identifier: Apache-2.0
"""Study files: how they are read, and errors for mistakes."""

from pathlib import Path
from typing import Any

import pytest

from arm_dynamics import ArmError
from arm_studies.sweeps import load_study, sweep

PLAIN: dict[str, Any] = {"scene": "two_link", "duration": 0.1}


def test_paths_are_relative_to_the_study(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("robot: {urdf: any.urdf}\n")
    (tmp_path / "study.yaml").write_text(
        "scene: mine.yaml\nduration: 1\nmotion: {file: course.yaml}\n"
    )
    study = load_study(tmp_path / "study.yaml")
    assert study.scene == str(tmp_path / "mine.yaml")
    assert study.motion.file == str(tmp_path / "course.yaml")


@pytest.mark.parametrize(
    ("part", "said"),
    [
        ({"durations": 1}, "study: unknown key 'durations' = 1; allowed here: .*did you mean"),
        ({"sampling": "sobol"}, "'sampling' = 'sobol': allowed: random, latin_hypercube"),
        ({"metrics": ["tracking_rsm"]}, "unknown metric .*did you mean 'tracking_rms'"),
        ({"vary": {"sim.dt": []}}, "'vary.sim.dt' = .*the list is empty"),
        ({"vary": {"sim.dt": {"uniform": [2, 1]}}}, "the lower end must lie below"),
        ({"motion": {"points": [{"time": 1}]}}, "'motion.points.0.position' is missing"),
        ({"vary": {"joints.*.friction.viscos": [1]}}, "'joints.*.friction.viscos'.*did you mean"),
        ({"vary": {"payloads.0.mass": [1]}}, "'vary.payloads.0.mass': there is no 'payloads.0'"),
        ({"changes": {"payload": []}}, "study: 'changes': .*did you mean 'payloads'"),
        ({"vary": {"controller.settings.bandwith": [1]}}, "did you mean 'bandwidth'"),
        ({"controller": {"scene": "panda"}}, "the controller's scene has joints"),
    ],
)
def test_mistakes_are_named(part: dict[str, Any], said: str) -> None:
    with pytest.raises(ArmError, match=said):
        sweep(PLAIN | part, workers=1)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("scene: two_link\nduration: -1\n", r"study\.yaml:2: study: 'duration' = -1"),
        ("scene: [\n", "study: "),
    ],
)
def test_mistakes_in_files_are_named(content: str, said: str, tmp_path: Path) -> None:
    file = tmp_path / "study.yaml"
    file.write_text(content)
    with pytest.raises(ArmError, match=said):
        load_study(file)
