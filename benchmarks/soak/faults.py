# SPDX-License-Identifier: Apache-2.0
"""What is done to the system, and which words of whose diagnostics must tell of it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from geometry_msgs.msg import WrenchStamped
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from arm_dynamics.ros.interfaces import LATCHED
from benchmarks.soak.system import System

HARDEST = 1e200  # [N]
FLOOD_RATE, FLOOD_TIME = 10_000, 1.5  # [Hz], [s]
HELD_UP = 1.6  # [s]
HOG = "import time\nend = time.monotonic() + 2.0\nwhile time.monotonic() < end: pass"


@dataclass(frozen=True)
class Fault:
    """Something bad.

    Attributes:
        name: For people.
        do: Does it.
        part: Whose diagnostics must tell, node and part.
        words: What they must say.
        gentle: Whether the arm must go on as if nothing had happened.
        last: Whether it is only for the end, as it starts a process anew.
        after: Whether the words count only once it is over.
        or_else: Part and words that tell of it as well, where it has struck otherwise.
        holds_up: Simulation that it holds up, so that no state is answered: then commands are not
            stale, although they pause.
    """

    name: str
    do: Callable[[System], None]
    part: str
    words: str
    gentle: bool = True
    last: bool = False
    after: bool = False
    or_else: tuple[str, str] | None = None
    holds_up: str = ""

    @property
    def tellers(self) -> list[tuple[str, str]]:
        """Parts and words any of which tells of it."""
        return [(self.part, self.words), *([self.or_else] if self.or_else else [])]


def _command(system: System, effort: list[float], names: list[str] | None = None) -> None:
    message = JointState(name=system.names if names is None else names, effort=effort)
    message.header.frame_id = "intruder"
    system.watcher.publisher(JointState, "joint_commands").publish(message)


def _some_commands(system: System, effort: list[float], names: list[str] | None = None) -> None:
    for _ in range(50):
        _command(system, effort, names)
        time.sleep(0.003)


def _flood(system: System) -> None:
    message = JointState(name=system.names, effort=[5.0] * system.n)
    message.header.frame_id = "intruder"
    raw = serialize_message(message)
    publisher = system.watcher.publisher(JointState, "joint_commands")
    began, sent = time.monotonic(), 0
    while (elapsed := time.monotonic() - began) < FLOOD_TIME:
        while sent < elapsed * FLOOD_RATE:
            publisher.publish(raw)
            sent += 1
        time.sleep(1e-3)


def _bare(system: System) -> None:
    publisher = system.watcher.publisher(Float64MultiArray, "sim/commands")
    for data in ([0.0] * 1000, [1.0], [float("nan")] * system.n):
        publisher.publish(Float64MultiArray(data=data))
        time.sleep(0.1)  # only the newest one is delivered


def _wrench(system: System) -> None:
    message = WrenchStamped()
    message.header.frame_id = "no_such_frame"
    system.watcher.publisher(WrenchStamped, "sim/wrench").publish(message)


def _trajectory(system: System) -> None:
    publisher = system.watcher.publisher(JointTrajectory, "controller/joint_trajectory")
    point = JointTrajectoryPoint(positions=[float("inf")] * system.n)
    point.time_from_start.sec = 1
    publisher.publish(JointTrajectory(joint_names=system.names, points=[point]))
    publisher.publish(JointTrajectory(joint_names=["nobody"], points=[point]))


def _states(system: System) -> None:
    publisher = system.watcher.publisher(JointState, "joint_states")
    message = JointState(name=system.names, position=[float("nan")] * system.n)
    message.velocity = [0.0] * system.n
    for _ in range(50):
        publisher.publish(message)
        time.sleep(0.003)
    system.watcher.drop("joint_states")


def _description(system: System) -> None:
    publisher = system.watcher.publisher(String, "other/robot_description", LATCHED)
    publisher.publish(String(data="<robot/>"))


def _requests(system: System) -> None:
    system.refused(np.full(system.n, np.nan))
    system.refused(np.zeros(system.n + 1))


def _diverge(system: System) -> None:
    message = WrenchStamped()
    message.header.frame_id = "panda_hand"
    message.wrench.force.x = HARDEST
    system.watcher.publisher(WrenchStamped, "sim/wrench").publish(message)
    system.watcher.listen(2.5)
    system.client.reset()
    system.client.resume()


def _back(system: System) -> None:
    system.client.reset()


def _hog(system: System) -> None:
    hogs = [subprocess.Popen([sys.executable, "-c", HOG]) for _ in range(os.cpu_count() or 1)]
    system.watcher.until(lambda: all(hog.poll() is not None for hog in hogs), 20.0)


def _freeze(name: str) -> Callable[[System], None]:
    def freeze(system: System) -> None:
        pid = system.processes.ids[name]
        os.kill(pid, signal.SIGSTOP)
        system.watcher.listen(1.5)
        os.kill(pid, signal.SIGCONT)

    return freeze


def _hold_up(name: str) -> Callable[[System], None]:
    """Stop a process again and again, and let it run for moments only."""

    def hold_up(system: System) -> None:
        pid, end = system.processes.ids[name], time.monotonic() + HELD_UP
        while time.monotonic() < end:
            os.kill(pid, signal.SIGSTOP)
            time.sleep(0.05)
            os.kill(pid, signal.SIGCONT)
            time.sleep(0.004)

    return hold_up


def _kill(name: str) -> Callable[[System], None]:
    def kill(system: System) -> None:
        os.kill(system.processes.ids[name], signal.SIGKILL)
        system.watcher.listen(2.5)
        system.processes.stop(name)
        system.start(name)

    return kill


FAULTS = (
    Fault("command that is not finite", lambda s: _some_commands(s, [float("nan")] * s.n),
          "sim: commands", "ignored"),
    Fault("command of unknown joints", lambda s: _some_commands(s, [1.0], ["nobody"]),
          "sim: commands", "ignored"),
    Fault("command with too few numbers", lambda s: _some_commands(s, [1.0]),
          "sim: commands", "ignored"),
    Fault("arrays of wrong length", _bare, "sim: commands", "ignored"),
    Fault("10 kHz of commands from a second source", _flood, "sim: commands", "two controllers"),
    Fault("wrench on an unknown frame", _wrench, "sim: commands", "wrenches ignored"),
    Fault("trajectory that is not finite", _trajectory,
          "controller: controller", "goals refused"),
    Fault("joint states that are not finite", _states,
          "controller: controller", "joint states ignored"),
    Fault("requests that are not finite or too long", _requests,
          "dynamics: services", "requests refused"),
    Fault("bad robot description", _description, "other: services", "description was refused"),
    Fault("a force that no tick can follow", _diverge, "sim: simulation",
          "last good state is kept", gentle=False),
    Fault("time goes back to zero", _back, "controller: controller", "time or the arm jumped",
          gentle=False),
    Fault("processors taken away for two seconds", _hog, "sim: loop", "after the next one was due",
          gentle=False),
    # Stopped while it writes, or reads, it holds up the sim's publishing: time stands still.
    Fault("controller stopped for 1.5 s", _freeze("controller"), "sim: commands",
          "commands stopped", gentle=False,
          or_else=("sim: loop", "began after the next one was due")),
    Fault("simulation stopped for 1.5 s", _freeze("sim"), "sim: loop",
          "began after the next one was due", gentle=False, holds_up="sim"),
    Fault("simulation with stamps of the clock held up again and again", _hold_up("clocked sim"),
          "clocked/sim: loop", "began after the next one was due", holds_up="clocked/sim"),
    Fault("controller killed", _kill("controller"), "sim: commands", "commands stopped",
          gentle=False, last=True),
    Fault("simulation killed", _kill("sim"), "controller: controller", "no joint state",
          gentle=False, last=True),
    Fault("dynamics node killed", _kill("dynamics"), "dynamics: services", "ok",
          gentle=False, last=True, after=True),
)  # fmt: skip
