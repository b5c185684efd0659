# SPDX-License-Identifier: Apache-2.0
"""Shared memory left by killed nodes is released, and nothing else."""

import os
import subprocess
import sys

from harness import Ros, segments, surroundings

from arm_dynamics.ros.common.transport import FOLDER, clear_dead

NODE = """
import rclpy
rclpy.init()
node = rclpy.create_node("there")
print("there", flush=True)
input()
"""


def node() -> subprocess.Popen[str]:
    """A node in a process of its own, which ends with its standard input."""
    process = subprocess.Popen(
        [sys.executable, "-c", NODE], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        env=surroundings(),
    )  # fmt: skip
    assert process.stdout is not None and process.stdout.readline() == "there\n"
    return process


def there() -> set[str]:
    return {path.name for path in FOLDER.iterdir()}


def test_only_the_dead_are_cleared() -> None:
    with node() as living:
        kept = segments(living.pid)
        with node() as doomed:
            left = segments(doomed.pid) - kept
            clear_dead()
            assert kept and left and there() >= kept | left
            doomed.kill()
        assert there() >= left
        assert clear_dead() > 0
        assert not there() & left
        assert there() >= kept
        living.communicate("")


def test_the_tests_themselves_stay_out() -> None:
    """Commands that ran in this process before may have taken some."""
    before = segments(os.getpid())
    ros = Ros()
    try:
        assert segments(os.getpid()) <= before
    finally:
        ros.close()
