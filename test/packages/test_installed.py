# SPDX-License-Identifier: Apache-2.0
"""The libraries as pip installs them, without ROS and away from the sources."""

import os
import subprocess
import sys
import tarfile
from pathlib import Path
from zipfile import ZipFile

import pytest
from installed import ROOT, Run, built, steps
from samples import sampled

LIBRARIES = ("arm_dynamics", "arm_sim", "arm_studies")


def files(wheel: Path) -> set[str]:
    """What a wheel brings into site-packages."""
    inside = tuple(f"{library}/" for library in LIBRARIES)
    return {name for name in ZipFile(wheel).namelist() if name.startswith(inside)}


def test_wheels_hold_what_the_sources_hold(wheels: dict[str, Path]) -> None:
    for library in LIBRARIES:
        root = ROOT / "src" / library
        there = {
            os.path.relpath(os.path.join(folder, file), root)
            for folder, _, names in os.walk(root / library, followlinks=True)  # to service files
            for file in names
            if not folder.endswith("__pycache__")
        }
        assert files(wheels[library]) == there
        assert f"{library}/py.typed" in there


@pytest.mark.parametrize("part", sampled([".", *(f"src/{name}" for name in LIBRARIES)], 1))
def test_a_source_distribution_gives_the_same_wheel(
    part: str, project: Path, wheels: dict[str, Path], tmp_path: Path
) -> None:
    """That of the whole holds all libraries."""
    code = f"from setuptools import build_meta; print(build_meta.build_sdist({str(tmp_path)!r}))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=project / part, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    archive = tmp_path / done.stdout.splitlines()[-1]
    with tarfile.open(archive) as packed:
        packed.extractall(tmp_path, filter="data")
    (unpacked,) = (path for path in tmp_path.iterdir() if path.is_dir())
    ((name, again),) = built(unpacked, tmp_path / "wheels", ["."]).items()
    those = [wheels[name]] if name in wheels else wheels.values()
    assert files(again) == set().union(*map(files, those))


def test_the_workflow_uses_what_it_installs(user: Run, project: Path) -> None:
    _, commands = steps("library")
    said = user("bash", "-euc", commands, cwd=project)
    assert "continuous" in said and "torques in N m" in said


def test_help_hints_and_usage_are_those_of_the_command_that_pip_installs(user: Run) -> None:
    """There is no ./arm outside the project's folder."""
    said = user("python", "-c", """
from click.testing import CliRunner
from arm_dynamics.codegen.compiler import HOW_TO_GET_CODE
from arm_dynamics.exceptions import missing
from arm_studies.cli.main import main

lines = [[], ["nothing"], ["describe", "--no"], ["urdf", "./arm.urdf"], ["call", "nothing"]]
for name, command in main.commands.items():
    below = getattr(command, "commands", {})
    lines += [[name, "--help"], *([name, other, "--help"] for other in below)]
for line in lines:
    print(CliRunner().invoke(main, line).output)
print(HOW_TO_GET_CODE, missing("jax", "jax"))
""")  # fmt: skip
    assert "./arm" not in said.replace("./arm.urdf", "")
    for words in ("Usage: arm call", "Try 'arm describe --help'", 'pip install ".[jax]"'):
        assert words in said


NEED_ROS = (
    "sim pendulum", "controller pendulum", "go swing=1", "watch", "call pause",
    "replay . --topics", "build pendulum --out compiled --nodes",
)  # fmt: skip


def test_every_command_that_needs_ros_says_so(user: Run) -> None:
    said = user("python", "-c", f"""
from click.testing import CliRunner
from arm_studies.cli.main import main

for line in {NEED_ROS}:
    result = CliRunner().invoke(main, line.split())
    last = result.output.splitlines()[-1]
    if not last.startswith("error: Python cannot find") or "needs ROS 2 Jazzy" not in last:
        print(line, repr(result.exception), result.output)
    assert result.exit_code == 1
""")  # fmt: skip
    assert said == ""
