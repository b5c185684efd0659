# SPDX-License-Identifier: Apache-2.0
"""Robot descriptions in xacro, expanded by ROS's program of that name where it is installed."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

from arm_dynamics.exceptions import SceneError, choices, plain
from arm_dynamics.scene.files import file_text

SUFFIX = ".xacro"
_TIMEOUT = 60.0  # [s]
_ARGUMENT = re.compile(r"""<[\w.-]+:arg\s[^>]*?\bname\s*=\s*["']([^"']+)|\$\(arg\s+([^)\s]+)""")


def expand(path: Path, arguments: Mapping[str, str]) -> str:
    """The URDF text of a xacro file; arguments that are left out have their defaults."""
    assignments = [f"{name}:={value}" for name, value in arguments.items()]
    text = _output(path, *assignments)
    if not assignments:
        return text
    files = [path, *map(Path, _output(path, "--deps", *assignments).split())]
    if not all(map(os.path.isfile, files)):  # a name with a space looks like two
        return text
    pairs = (pair for file in files for pair in _ARGUMENT.findall(file_text(file)))
    declared = dict.fromkeys(name for pair in pairs for name in pair if name)
    for name in arguments:
        if name not in declared:  # xacro ignores it
            raise SceneError(
                f"scene: 'robot.arguments.{name}': '{path}' has no such argument; allowed: "
                f"{choices(name, declared)}"
            )
    return text


def _output(path: Path, *arguments: str) -> str:
    try:
        process = subprocess.run(
            [*_command(path, *arguments), str(path), *arguments],
            capture_output=True, text=True, timeout=_TIMEOUT, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise SceneError(f"scene: xacro did not expand '{path}' in {_TIMEOUT:g} s") from None
    if process.returncode:
        reason = process.stderr.strip() or f"exit status {process.returncode}"
        raise SceneError(f"scene: xacro cannot expand '{path}': {plain(reason)}")
    return process.stdout


def _command(path: Path, *arguments: str) -> list[str]:
    """The program: the module of this Python, or else the command of a sourced ROS."""
    if find_spec("xacro"):
        return [sys.executable, "-c", "import xacro; xacro.main()"]
    if program := shutil.which("xacro"):
        return [program]
    raise SceneError(
        f"scene: '{path}' is xacro source, and xacro is not installed: install it ('pip install "
        f"xacro', or ROS's package), or expand the file elsewhere: 'xacro "
        f"{' '.join([path.name, *arguments])} > arm.urdf'"
    )
