# SPDX-License-Identifier: Apache-2.0
"""Dockerfile and workflow: what they start is there, and the pages say the same."""

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


def test_every_command_can_be_read_by_the_shell() -> None:
    for command in everywhere():
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
