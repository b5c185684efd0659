# SPDX-License-Identifier: Apache-2.0
"""Lets the Python of an environment that ``./arm`` made import everything, however it is started.

The set-up copies this file into the environment, beside a ``.pth`` file that imports it and the
file ``environment`` with the variables of ``./arm`` itself. An editor, Jupyter or a script
thus finds ROS 2 and the built workspace, too. Libraries are searched for in the folders that
``LD_LIBRARY_PATH`` named when the process began: if some are missing, Python is restarted.

An executable of a node that is interrupted this early is told when it has begun to listen.
"""

from __future__ import annotations

import os
import signal
import sys

LIBRARIES = "LD_LIBRARY_PATH"
NODES = ("/arm_sim/sim", "/arm_dynamics/controller", "/arm_dynamics/dynamics")
AGAIN = "ARM_ENVIRONMENT"  # the environment for which Python has been started once more


def extended(before: str, folders: str) -> str:
    """A list of folders with those in front that it lacks."""
    there = before.split(os.pathsep) if before else []
    lacking = [folder for folder in folders.split(os.pathsep) if folder not in there]
    return os.pathsep.join([*lacking, *there])


def wanted(lines: str) -> dict[str, str]:
    """Variables that are to be other than they are."""
    changed = {}
    for name, _, value in (line.partition("=") for line in lines.splitlines()):
        before = os.environ.get(name, "")
        after = extended(before, value) if name.endswith("_PATH") else before or value
        if after != before:
            changed[name] = after
    return changed


def main() -> None:
    """Set what is missing; start Python once more if it is libraries."""
    if sys.orig_argv[1:] and sys.orig_argv[1].endswith(NODES):  # see arm_dynamics.starting
        signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM))
    try:
        with open(os.path.join(sys.prefix, "environment"), encoding="utf-8") as file:
            changed = wanted(file.read())
    except OSError:
        return
    os.environ.update(changed)
    if LIBRARIES in changed and os.environ.get(AGAIN) != sys.prefix:
        os.environ[AGAIN] = sys.prefix
        os.execv(sys.executable, sys.orig_argv)


main()
