# SPDX-License-Identifier: Apache-2.0
"""Dockerfile and workflow work: what needs neither root nor network is run."""

import os
import re
import subprocess
from pathlib import Path

import pytest
from installed import ROOT, WORKFLOW, bare_environment, copied, runner, steps
from packaging.requirements import Requirement

DOCKERFILE = (ROOT / "Dockerfile").read_text()
OF_ROOT = ("apt-get ", "rosdep ")


def stages() -> dict[str, list[tuple[str, str]]]:
    """Instructions and arguments by stage of the Dockerfile."""
    found: dict[str, list[tuple[str, str]]] = {}
    lines = re.sub(r"^#.*\n", "", DOCKERFILE, flags=re.MULTILINE).replace("\\\n", " ").splitlines()
    for instruction, _, rest in (line.partition(" ") for line in lines if line.strip()):
        if instruction == "FROM":
            stage = found.setdefault(rest.rpartition(" AS ")[2], [])
        stage.append((instruction, rest))
    return found


def everywhere() -> list[str]:
    """Commands of all stages and jobs."""
    of_images = [rest for found in stages().values() for name, rest in found if name == "RUN"]
    return [*of_images, *(command for job in WORKFLOW["jobs"] for command in steps(job))]


# Commands that are not run here: how they begin, and why, or what runs the same.
ELSEWHERE = {
    "apt-get ": "needs root",
    "rosdep ": "needs root",
    "pip install --target install/": "tools/noble.py runs it",
    ".ci/run": "runs these tests",
    ". /opt/ros/jazzy/setup.sh": "needs an installed ROS 2; ./arm sets up what runs these tests",
    "source /opt/ros/": "needs an installed ROS 2; tools/noble.py runs colcon",
}
OF_THE_IMAGE = [rest for instruction, rest in stages()["library"] if instruction == "RUN"]


@pytest.mark.nightly  # test_installed.py runs the commands of the job
def test_commands_of_the_image_work(tmp_path: Path) -> None:
    project = copied(tmp_path)
    run = runner(bare_environment(tmp_path / "environment"), project)
    commands = [command for command in OF_THE_IMAGE if not command.startswith(OF_ROOT)]
    assert "python -m pip install" in commands[0]
    said = [run("bash", "-euc", command) for command in commands]
    assert "continuous" in said[-1]
    assert (tmp_path / "environment/bin/arm").exists()


@pytest.mark.parametrize("command", everywhere(), ids=lambda command: command[:30])
def test_every_command_is_run_or_said_not_to_be(command: str) -> None:
    run = command in [*OF_THE_IMAGE, *steps("library")]
    assert run or command.startswith(tuple(ELSEWHERE))
    subprocess.run(["bash", "-n"], input=command, text=True, check=True)


def test_the_workspace_is_made_as_its_page_says() -> None:
    """What needs root and network is the same in the workflow and in the document."""
    (line,) = (step for step in steps("workspace") if step.startswith("pip install"))
    assert f"\ncolcon build\n{line}\n" in (ROOT / "docs/how-to/install.md").read_text()
    wanted = {Requirement(word.strip('"')).name for word in line.split()[4:]}
    assert wanted == {"casadi", "example-robot-data", "mcap", "pydantic", "numpy"}


@pytest.mark.parametrize("file", re.findall(r"(?:\./arm|\.ci/run)\b", DOCKERFILE + str(WORKFLOW)))
def test_scripts_that_they_start_are_there(file: str) -> None:
    assert os.access(ROOT / file, os.X_OK)
