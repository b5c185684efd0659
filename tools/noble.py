# SPDX-License-Identifier: Apache-2.0
"""Builds, installs and tests the packages as a workspace with the Python packages of Ubuntu 24.04.

    ./arm python tools/noble.py    # into .venv-noble, which is made anew

``requirements-noble.txt`` pins what apt installs there, pydantic 1.10 and NumPy 1.26 among it; ROS
2 Jazzy and Pinocchio are those of the environment that runs this. What apt lacks is installed by
the command of the install page. The exit status is that of the first command that fails.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SYSTEM = ROOT / ".venv-noble"
INSTALL_PAGE = ROOT / "docs/how-to/install.md"
PACKAGES = f"lib/python{sys.version_info[0]}.{sys.version_info[1]}/site-packages"
AS_ON_NOBLE = """
import arm_dynamics, numpy, pydantic, yaml
for module, version in (numpy, "1.26.4"), (yaml, "6.0.1"):
    assert module.__version__ == version, module.__file__
assert "install/arm_dynamics" in arm_dynamics.__file__
assert "install/arm_dynamics" in pydantic.__file__
"""


def main() -> None:
    """Make the environment, build, install what is missing, test."""
    make_system()
    python = [f"-D{name}_EXECUTABLE={SYSTEM}/bin/python" for name in ("Python3", "PYTHON")]
    run(*colcon("build"), "--cmake-args", "-GNinja", "-Wno-dev", *python)
    assert "is too old" in sourced("$PWD/install/arm_sim/lib/arm_sim/arm describe pendulum", 1)
    (line,) = re.findall(r"^pip install --target .*$", INSTALL_PAGE.read_text(), re.M)
    sourced(f"python -m {line} --quiet")  # for packages that rosdep lacks
    sourced(f"python -c '{AS_ON_NOBLE}'")
    assert "continuous" in sourced("install/arm_sim/lib/arm_sim/arm describe pendulum")
    sourced(f"{' '.join(colcon('test'))} && python -m colcon test-result --verbose")


def make_system() -> None:
    """An environment with the versions of Ubuntu 24.04 in front of all that is installed here."""
    run(sys.executable, "-m", "venv", "--clear", SYSTEM, cwd=ROOT)
    run("python", "-m", "pip", "install", "--quiet", "--no-deps", "--require-hashes",
        "--requirement", ROOT / "requirements-noble.txt")  # fmt: skip
    rest = [path for path in sys.path if path.endswith("site-packages")]
    (SYSTEM / PACKAGES / "rest.pth").write_text("\n".join(rest) + "\n")


def colcon(verb: str) -> list[str]:
    """A verb of colcon for the packages in ``src``."""
    return ["python", "-m", "colcon", verb, "--base-paths", str(ROOT / "src")]


def sourced(command: str, status: int = 0) -> str:
    """Run a line of bash in the sourced workspace; return what it prints."""
    line = f". install/local_setup.bash && {command}"
    print(f"\n$ {command}", flush=True)
    done = subprocess.run(
        ["bash", "-c", line], cwd=SYSTEM, env=environment(), stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    print(done.stdout, flush=True)
    if done.returncode != status:
        sys.exit(f"exit status {done.returncode}")
    return done.stdout


def run(*command: object, cwd: Path = SYSTEM) -> None:
    """Run a command; end with its status if it fails."""
    done = subprocess.run([*map(str, command)], cwd=cwd, env=environment())
    if done.returncode:
        sys.exit(done.returncode)


def environment() -> dict[str, str]:
    """Variables of a shell in which ROS 2 is sourced, and nothing of the suite."""
    given = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV")}
    given["PATH"] = f"{SYSTEM}/bin{os.pathsep}{given['PATH']}"
    return given | {"CMAKE_PREFIX_PATH": sys.prefix, "COLCON_HOME": str(SYSTEM)}


if __name__ == "__main__":
    main()
