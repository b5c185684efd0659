# SPDX-License-Identifier: Apache-2.0
"""Signals end a command while it is imported, then between its calls of ROS, not within them."""

import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from arm_sim.cli.interrupts import interruptible, postponed


def test_a_signal_that_comes_while_ros_is_at_work_waits_until_it_is_done() -> None:
    for number in signal.SIGINT, signal.SIGTERM, signal.SIGHUP:
        done = []
        with interruptible(), pytest.raises(KeyboardInterrupt, match=number.name):
            with postponed():
                signal.raise_signal(number)
                done.append("ROS")
            done.append("more")
        assert done == ["ROS"]


def test_threads_which_signals_do_not_reach_need_not_wait() -> None:
    def work() -> str:
        with postponed():
            return "ROS"

    with ThreadPoolExecutor() as threads:
        assert threads.submit(work).result() == "ROS"


@pytest.mark.ros
def test_a_command_that_listens_ends_after_the_message_it_receives() -> None:
    from arm_dynamics.ros.interfaces import JOINT_STATES
    from arm_sim.cli.robot.listener import Listener

    topic, heard = f"/joint_states_{os.getpid()}", []

    def interrupted(message: object) -> None:
        signal.raise_signal(signal.SIGINT)
        heard.append(message)

    with interruptible(), Listener() as listener:
        publisher = listener.publisher(JOINT_STATES, topic)
        listener.subscribe(JOINT_STATES, topic, interrupted)
        assert listener.until(lambda: publisher.get_subscription_count() > 0, 10.0)
        publisher.publish(JOINT_STATES.type())
        with pytest.raises(KeyboardInterrupt):
            listener.spin_for(10.0)
    assert len(heard) == 1


# Takes the place of a package; its compiled part says something else of an interruption.
IMPORTED = """
import time
try:
    print("importing", flush=True)
    time.sleep(60.0)
except KeyboardInterrupt:
    raise ImportError("the library cannot be loaded") from None
"""


@pytest.mark.parametrize(("program", "package", "status", "said"), [
    (("-m", "arm_sim.cli", "sim", "panda"), "rclpy", 0, "starting the simulator …\n"),
    (("-m", "arm_studies.cli", "describe", "panda"), "click", 1, "\nAborted!\n"),
    (("-m", "arm_sim.cli", "watch"), "rclpy", 1, "Aborted!\n"),
])  # fmt: skip
def test_an_interruption_during_imports_leaves_no_traceback(
    program: tuple[str, ...], package: str, status: int, said: str, tmp_path: Path
) -> None:
    (tmp_path / f"{package}.py").write_text(IMPORTED)
    paths = {"PYTHONPATH": f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}"}
    with subprocess.Popen(
        [sys.executable, *program], env=os.environ | paths, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as process:  # fmt: skip
        assert process.stdout is not None and process.stdout.readline() == "importing\n"
        process.send_signal(signal.SIGINT)
        _, told = process.communicate(timeout=60.0)
    assert (process.returncode, told) == (status, said)
