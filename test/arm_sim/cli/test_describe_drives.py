# SPDX-License-Identifier: Apache-2.0
"""The description of a scene's drives."""

from __future__ import annotations

import re
from pathlib import Path

from click.testing import CliRunner

import models
from arm_sim.cli.main import main

SCENES = models.SCENES


def described(name: str) -> str:
    done = CliRunner().invoke(main, ["describe", str(SCENES / name)], env={"COLUMNS": "160"})
    assert done.exit_code == 0, done.output
    return re.sub(r"\s+", " ", done.output)


def test_describe_says_what_each_joint_takes() -> None:
    text = described("flexible_arm.yaml")
    for words in (
        "shoulder current [A] 10 100 0.4 1 flexible, 6000, stiffening, hysteresis, kinematic",
        "elbow voltage [V] 36 -40 0.064 1 flexible, 900",
        "motors and transmissions 2 joints, 6 states",
        "error controlled to 1e-10",
    ):
        assert words in text


def test_describe_says_what_a_gear_costs() -> None:
    text = described("motor_pendulum.yaml")
    assert "swing voltage [V] 24 50 0.075 0.85 rigid" in text
    assert "gear losses 1 joints, load-dependent friction, solved by events" in text


def test_describe_gives_four_digits_of_a_gear(tmp_path: Path) -> None:
    scene = (models.SCENES / "motor_pendulum.yaml").read_text()
    urdf = str(models.SCENES / "pendulum.urdf")
    file = tmp_path / "scene.yaml"
    file.write_text(scene.replace("pendulum.urdf", urdf).replace("50", "50.1234"))
    assert "swing voltage [V] 24 50.12 " in described(str(file))


def test_plan_of_an_arm_without_drives_says_so() -> None:
    plan = str(models.simulator("two_link", backend="vm").plan)
    assert "skipped motors and transmissions: no actuator" in re.sub(r"\s+", " ", plan)
    assert "skipped gear losses: every gear is ideal" in re.sub(r"\s+", " ", plan)
