# SPDX-License-Identifier: Apache-2.0
"""The suite as pip installs it, without network: copies, wheels, environments without ROS."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).parents[2]
PARTS = ("src", "examples", "pyproject.toml", "MANIFEST.in", "README.md", "LICENSE")
MADE = shutil.ignore_patterns("__pycache__", "*.egg-info", "build")
OF_ROS = (
    "rclpy", "ament_index_python", "arm_msgs", "builtin_interfaces", "control_msgs",
    "diagnostic_msgs", "geometry_msgs", "nav_msgs", "rcl_interfaces", "rosgraph_msgs",
    "sensor_msgs", "simulation_interfaces", "std_msgs", "std_srvs", "tf2_msgs", "trajectory_msgs",
)  # fmt: skip
# pip as in a fresh environment, but with what is installed here instead of the network.
OFFLINE = {
    "PIP_NO_INDEX": "1",
    "PIP_NO_DEPS": "1",
    "PIP_NO_BUILD_ISOLATION": "0",  # which is how pip wants to be told not to isolate
    "PIP_DISABLE_PIP_VERSION_CHECK": "1",
    "PIP_NO_COMPILE": "1",  # most modules are never imported
}
KEPT = ("HOME", "XDG_CACHE_HOME", "ARM_CACHE", "TMPDIR", "LANG")

Run = Callable[..., str]

WORKFLOW: dict[Any, Any] = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text())


def steps(job: str) -> list[str]:
    """Commands of a job of the workflow."""
    return [step["run"] for step in WORKFLOW["jobs"][job]["steps"] if "run" in step]


def copied(folder: Path) -> Path:
    """What an installation needs of the project, where pip may build in it."""
    for part in PARTS:
        if (ROOT / part).is_dir():
            shutil.copytree(ROOT / part, folder / part, ignore=MADE)
        else:
            shutil.copy(ROOT / part, folder / part)
    return folder


def built(project: Path, folder: Path, parts: Sequence[str]) -> dict[str, Path]:
    """Wheels of parts of a project, by name."""
    done = subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "--quiet", "--wheel-dir", folder, *parts],
        cwd=project, env={**os.environ, **OFFLINE}, capture_output=True, text=True, timeout=240,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return {path.name.partition("-")[0]: path for path in folder.glob("*.whl")}


def bare_environment(folder: Path) -> Path:
    """A virtual environment with the libraries that are here, without ROS and the suite."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    link_libraries(folder)
    return folder


def link_libraries(environment: Path) -> None:
    """Give an environment the libraries that are here, without ROS and the suite."""
    libraries = [p for p in sys.path if p.endswith("-packages") and "/workspace/" not in p]
    assert libraries
    hide = f"import sys; sys.modules.update(dict.fromkeys({OF_ROS}))"
    pth = environment / "lib/python3.12/site-packages/libraries.pth"
    pth.write_text("\n".join([*libraries, hide, ""]))


def runner(environment: Path, folder: Path) -> Run:
    """Runs commands as if the environment were active, in a folder that has nothing of ours."""

    def run(*words: str | Path, cwd: Path = folder, code: int = 0) -> str:
        done = subprocess.run(
            words, cwd=cwd, capture_output=True, text=True, timeout=240,
            env={**{k: os.environ[k] for k in KEPT if k in os.environ}, **OFFLINE,
                 "PATH": f"{environment / 'bin'}:/usr/bin:/bin", "MPLBACKEND": "Agg",
                 "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"},
        )  # fmt: skip
        assert done.returncode == code, done.stdout + done.stderr
        return done.stdout + done.stderr

    return run
