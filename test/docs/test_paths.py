# SPDX-License-Identifier: Apache-2.0
"""The three paths of the README, typed as they stand, in a terminal: they arrive, and say so.

Set-up apart, which ``.ci/run`` does: ``./arm`` runs the suite as it is here, and pip installs it
without network into an environment that has its libraries.
"""

import re
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import page_files
import pages
import pytest
from harness import Ros, surroundings
from typed import PATIENCE, Typed

pytestmark = pytest.mark.ros

README = (pages.ROOT / "README.md").read_text()
ROWS = re.findall(r"^\| (.+?) \| (`.+`) \|$", README.split("There are five uses")[0], re.M)
PATHS = {words: re.findall(r"`([^`]+)`", typed) for words, typed in ROWS}
TORQUE, OWN_NODE, _ = PATHS  # test_ten_minutes.py types the third
SILENT = 4.0  # [s], twice what is promised: beside others, processors take up to twice as long
NODES = r"\./arm (?:dynamics|sim)\b|\./arm python my_node"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with ``./arm`` and what a reader has."""
    python, arm = sys.executable, tmp_path / "arm"
    arm.write_text(
        f'#!/bin/sh\nif [ "$1" = python ]; then shift; exec {python} "$@"; fi\n'
        f'exec {python} -P -m arm_studies.cli "$@"\n'
    )
    arm.chmod(0o755)
    page = pages.ROOT / "docs/how-to/own-node.md"
    (node,) = (step.text for step in pages.steps(page) if step.name == "my_node.py")
    (tmp_path / "my_node.py").write_text(node)
    page_files.MAKERS["my_arm.urdf"](tmp_path / "my_arm.urdf")
    return tmp_path


@pytest.fixture
def typed(folder: Path, ros: Ros) -> Iterator[dict[str, Typed]]:
    """Lines that were typed; they end with the test."""
    lines: dict[str, Typed] = {}
    yield lines
    for line in reversed(lines.values()):
        line.end()


def follow(lines: list[str], folder: Path, ros: Ros, typed: dict[str, Typed]) -> None:
    """Type the lines of a path; nodes go on."""
    environment = surroundings(ROS_DOMAIN_ID=str(ros.domain), MPLBACKEND="Agg", TERM="xterm")
    for line in lines:
        if line in typed:
            typed.pop(line).end()
        typed[line] = Typed(line, folder, environment)
        if re.match(NODES, line):
            if "my_node" not in line:  # which has nothing to say
                typed[line].listen(enough="simulates|to try it")
            continue
        typed[line].listen()
        assert typed[line].process.returncode == 0, typed[line].said


def test_a_torque_over_ros_takes_three_commands(
    folder: Path, ros: Ros, typed: dict[str, Typed]
) -> None:
    lines = PATHS[TORQUE]
    assert 1 + len(lines) <= 3  # with git clone
    follow(lines, folder, ros, typed)
    assert re.search(r"panda_joint4\s+-2\.4\s+22\.1747", typed[lines[-1]].said)
    assert {line: t.silent for line, t in typed.items() if t.silent > SILENT} == {}


def test_an_own_node_moves_the_arm_in_five(
    folder: Path, ros: Ros, typed: dict[str, Typed]
) -> None:
    *start, look = PATHS[OWN_NODE]
    assert 1 + len(start) + 1 <= 5
    follow(start, folder, ros, typed)
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        follow([look], folder, ros, typed)
        elbow = re.search(r"elbow_joint\D+(-?[\d.]+)", typed[look].said)
        assert elbow, typed[look].said
        if abs(float(elbow[1]) - 1.2) < 0.02:  # the goal of the node
            break
    else:
        raise AssertionError(typed[look].said)
    assert {line: t.silent for line, t in typed.items() if t.silent > SILENT} == {}
