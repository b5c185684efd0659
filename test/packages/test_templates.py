# SPDX-License-Identifier: Apache-2.0
"""Dockerfile and workflow work: what needs neither root nor network is run."""

import os
import re
import subprocess

from installed import ROOT, WORKFLOW, steps
from packaging.requirements import Requirement

DOCKERFILE = (ROOT / "Dockerfile").read_text()


def everywhere() -> list[str]:
    """Commands of all images and jobs."""
    lines = re.sub(r"^#.*\n", "", DOCKERFILE, flags=re.MULTILINE).replace("\\\n", " ")
    of_images = re.findall(r"^RUN (.*)$", lines, re.MULTILINE)
    return [*of_images, *(command for job in WORKFLOW["jobs"] for command in steps(job))]


# Commands that are not run here: how they begin, and why, or what runs the same.
ELSEWHERE = {
    "apt-get ": "needs root",
    "rosdep ": "needs root",
    "python -m pip install ": "test_installed.py runs that of the workflow's job",
    "arm describe pendulum": "likewise",
    "pip install --target install/": "tools/noble.py runs it",
    ".ci/run": "runs these tests",
    ". /opt/ros/jazzy/setup.sh": "needs an installed ROS 2; ./arm sets up what runs these tests",
    "source /opt/ros/": "needs an installed ROS 2; tools/noble.py runs colcon",
}


def test_every_command_is_run_or_said_not_to_be() -> None:
    for command in everywhere():
        assert command.startswith(tuple(ELSEWHERE)), command
        subprocess.run(["bash", "-n"], input=command, text=True, check=True)


def test_the_workspace_is_made_as_its_page_says() -> None:
    """What needs root and network is the same in the workflow and in the document."""
    (line,) = (step for step in steps("workspace") if step.startswith("pip install"))
    assert f"\ncolcon build\n{line}\n" in (ROOT / "docs/how-to/install.md").read_text()
    wanted = {Requirement(word.strip('"')).name for word in line.split()[4:]}
    assert wanted == {"casadi", "example-robot-data", "mcap", "pydantic", "numpy"}


def test_scripts_that_they_start_are_there() -> None:
    for file in re.findall(r"(?:\./arm|\.ci/run)\b", DOCKERFILE + str(WORKFLOW)):
        assert os.access(ROOT / file, os.X_OK), file
