# SPDX-License-Identifier: Apache-2.0
"""What a killed node leaves in shared memory is given back, and nothing else."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

from harness import Ros

from arm_dynamics.ros.shared_memory import FOLDER, clear_dead

NODE = """
import rclpy
rclpy.init()
node = rclpy.create_node("doomed")
print("there", flush=True)
input()
"""


def segments() -> set[str]:
    return {path.name for path in FOLDER.glob("fastrtps_*")}


def test_only_the_dead_are_cleared(ros: Ros) -> None:
    clear_dead()
    living = segments()
    process = subprocess.Popen(
        [sys.executable, "-c", NODE], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    with process:
        assert process.stdout is not None and process.stdout.readline() == "there\n"
        both = segments()
        assert both > living
        assert clear_dead() == 0
        os.kill(process.pid, signal.SIGKILL)
    assert segments() == both
    assert clear_dead() > 0
    assert segments() == living
