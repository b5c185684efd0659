# SPDX-License-Identifier: Apache-2.0
"""Robot descriptions in xacro, expanded by ROS's program of that name where it is installed."""

from __future__ import annotations

import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

from arm_dynamics.exceptions import SceneError, plain

SUFFIX = ".xacro"
_LONGEST = 60.0  # [s]


def expanded(path: Path) -> str:
    """The URDF text of a xacro file, its arguments at their defaults.

    Args:
        path: A file ending in ``.xacro``.

    Raises:
        SceneError: If xacro is not installed, or cannot expand the file.
    """
    try:
        done = subprocess.run(
            [*_command(path), str(path)],
            capture_output=True, text=True, timeout=_LONGEST, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise SceneError(f"scene: xacro did not expand '{path}' in {_LONGEST:g} s") from None
    if done.returncode:
        said = done.stderr.strip() or f"exit status {done.returncode}"
        raise SceneError(f"scene: xacro cannot expand '{path}': {plain(said)}")
    return done.stdout


def _command(path: Path) -> list[str]:
    """The program: the module of this Python, or else the command of a sourced ROS."""
    if find_spec("xacro"):
        return [sys.executable, "-c", "import xacro; xacro.main()"]
    if program := shutil.which("xacro"):
        return [program]
    raise SceneError(
        f"scene: '{path}' is xacro source, and xacro is not installed: install it ('pip install "
        f"xacro', or ROS's package), or expand the file elsewhere: 'xacro {path.name} > arm.urdf'"
    )
