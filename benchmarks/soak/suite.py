# SPDX-License-Identifier: Apache-2.0
"""Runs the nodes, keeps them busy, does harm and notes what came of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from arm_dynamics.client.client import ArmClient
from arm_dynamics.exceptions import Refused
from arm_sim.cli.demo.processes import DemoFailed, Processes
from benchmarks.soak.faults import FAULTS, Fault
from benchmarks.soak.watch import Watcher, memory, processor_time

SETTLE, NOTICE, RECOVER = 2.0, 4.0, 12.0  # [s] before a fault, to be told of it, to be well again
MOVE_EVERY = 3.0  # [s]
TRACKING = 5e-3  # [rad] that the arm may be off while nothing should disturb it, or three times
# what it was off between faults, where others load the machine
LAST = 90.0  # [s] at the end for faults that start processes anew
HISTORY = 12  # requests that the transport keeps the memory of, and some
WARM = 0.15  # of the time before memory is looked at
COMMANDS = {
    "sim": ("sim", "{scene}", "--with-parent", "--ros-args", "-p", "stale_policy:=gravity"),
    "controller": ("controller", "{scene}", "--with-parent"),
    "dynamics": ("dynamics", "{scene}", "--with-parent"),
    "other": ("dynamics", "--with-parent", "--ros-args", "-r", "__node:=other", "-r",
              "robot_description:=other/robot_description"),
}  # fmt: skip


@dataclass
class Outcome:
    """What came of one fault, over all times it was done.

    Attributes:
        times: How often it was done.
        told: How often the diagnostics told of it.
        well: How often everything was well again in time.
        worst: Largest tracking error meanwhile in [rad].
        words: An example of what was told.
        trouble: What was not as it should be, the first few.
    """

    times: int = 0
    told: int = 0
    well: int = 0
    worst: float = 0.0
    words: str = ""
    trouble: list[str] = field(default_factory=list)


@dataclass
class Result:
    """A whole soak.

    Attributes:
        minutes: How long it was.
        outcomes: By the fault's name.
        memory: Of each process: times in [s] and sizes in [MB].
        share: Processor share of each process over the run.
        rates: Ticks per second of the simulation between faults.
        calls: Service calls that were answered.
        energies: Energy messages that came.
        ended: Why it ended early, else empty.
    """

    minutes: float
    outcomes: dict[str, Outcome] = field(default_factory=dict)
    memory: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    share: dict[str, float] = field(default_factory=dict)
    rates: list[float] = field(default_factory=list)
    calls: int = 0
    energies: int = 0
    ended: str = ""

    def growth(self, name: str) -> float:
        """How much a process's memory grew after warming up, in [MB]: medians of tenths."""
        history = self.memory[name]
        sizes = [size for t, size in history if t >= WARM * history[-1][0]]
        tenth = max(1, len(sizes) // 10)
        return float(np.median(sizes[-tenth:]) - np.median(sizes[:tenth])) if sizes else 0.0


class Suite:
    """The nodes under load."""

    def __init__(self, scene: str, domain: int, processes: Processes) -> None:
        """Start everything and wait until the loop is closed."""
        self._scene, self.processes = scene, processes
        for name in COMMANDS:
            self.start(name)
        self.watcher = Watcher(domain)
        self.client = ArmClient(timeout=20.0, domain=domain)
        self.names = list(self.client.model_info().joint_names)
        self.n = len(self.names)
        self._home = np.array([0.0, -0.6, 0.0, -2.0, 0.0, 1.6, 0.7])[: self.n]
        self._sign, self._moved = cycle((1.0, -1.0)), 0.0
        self.calls, self._usual = 0, 0.0
        self._giants()
        if not self.watcher.until(lambda: len(self.watcher.latest) >= 6, 30.0):
            raise DemoFailed(f"diagnostics of only {sorted(self.watcher.latest)} came")

    def _giants(self) -> None:
        """Send messages beyond all limits, as many as the transport keeps the memory of.

        It keeps the buffers of the largest ones that it has seen, so that memory is looked at
        with these in it.
        """
        array = self.watcher.publisher(Float64MultiArray, "sim/commands")
        for _ in range(HISTORY):
            self.refused(np.zeros((100_001, self.n)))
            array.publish(Float64MultiArray(data=[0.0] * 100_000))

    def refused(self, q: np.ndarray) -> None:
        """Ask a question that has to be refused."""
        try:
            self.client.inverse_dynamics(q)
        except Refused:
            return
        raise DemoFailed(f"a bad request of shape {q.shape} was answered")

    def close(self) -> None:
        """Leave the graph."""
        self.client.close()
        self.watcher.close()

    def start(self, name: str) -> None:
        """Start a node's process, anew if it was there."""
        self.processes.start(name, *(word.format(scene=self._scene) for word in COMMANDS[name]))

    def live(self, seconds: float) -> None:
        """Use the nodes as their users do."""
        end = time.monotonic() + seconds
        rng = np.random.default_rng(0)
        while time.monotonic() < end:
            if time.monotonic() - self._moved > MOVE_EVERY:
                self.move()
            self.client.inverse_dynamics(*rng.uniform(-1.0, 1.0, (3, 100, self.n)))
            self.calls += 1
            self.watcher.listen(0.05)

    def move(self) -> None:
        """Send the arm somewhere."""
        self._moved = time.monotonic()
        goal = self._home + 0.2 * next(self._sign)
        message = JointTrajectory(joint_names=self.names)
        message.points = [JointTrajectoryPoint(positions=goal.tolist())]
        message.points[0].time_from_start.sec = 2
        topic = "controller/joint_trajectory"
        self.watcher.publisher(JointTrajectory, topic).publish(message)

    def suffer(self, fault: Fault, outcome: Outcome) -> None:
        """Do a fault and note what came of it."""
        watcher = self.watcher
        watcher.worst_error = 0.0
        self.live(SETTLE)
        usual, watcher.worst_error = watcher.worst_error, 0.0
        self._usual = max(self._usual, usual) if fault.gentle else self._usual
        since = time.monotonic()
        fault.do(self)
        if fault.after:
            since = time.monotonic()
        outcome.times += 1
        if watcher.until(lambda: self._told(fault, since), NOTICE + 6.0):
            outcome.told += 1
            outcome.words = self._told(fault, since)
        else:
            self._complain(outcome, f"not told; {fault.part} says: {self._says(fault.part)}")
        if fault.gentle:
            outcome.worst = max(outcome.worst, watcher.worst_error)
            if watcher.worst_error > max(TRACKING, 3.0 * self._usual):
                self._complain(outcome, f"tracking error {watcher.worst_error:.2e} rad")
        self._recover(outcome)

    def _told(self, fault: Fault, since: float) -> str:
        """What the diagnostics said of a fault since it began, empty if nothing."""
        said = (self.watcher.said(since, *teller) for teller in fault.tellers)
        return next((status.message for status in said if status is not None), "")

    def _recover(self, outcome: Outcome) -> None:
        end = time.monotonic() + RECOVER
        if self.watcher.has("joint_commands"):
            self.watcher.drop("joint_commands")
        while time.monotonic() < end:
            self.live(1.0)
            if not self.watcher.troubles():
                outcome.well += 1
                return
        self._complain(outcome, f"not well again: {'; '.join(self.watcher.troubles())}")

    def _says(self, part: str) -> str:
        latest = self.watcher.latest.get(part)
        return latest.message if latest else "nothing"

    def _complain(self, outcome: Outcome, words: str) -> None:
        if len(outcome.trouble) < 5:
            outcome.trouble.append(words)


@contextmanager
def running(scene: str, domain: int, folder: Path) -> Iterator[Suite]:
    """The suite, taken down at the end whatever happens."""
    with Processes(folder) as processes:
        suite = Suite(scene, domain, processes)
        try:
            yield suite
        finally:
            suite.close()


def soak(suite: Suite, minutes: float, progress: Callable[[float, str], None]) -> Iterator[Result]:
    """Do every fault again and again; give the result so far after each.

    Args:
        suite: The running nodes.
        minutes: How long.
        progress: Told the share that is over and what comes.
    """
    result = Result(minutes, {fault.name: Outcome() for fault in FAULTS})
    began, share = time.monotonic(), _Shares(suite)
    gentle = cycle(fault for fault in FAULTS if not fault.last)
    while (over := time.monotonic() - began) < 60.0 * minutes - LAST:
        fault = next(gentle)
        progress(over / (60.0 * minutes), fault.name)
        result.minutes = over / 60.0
        yield _suffered(suite, fault, result, began)
    result.share = share.now()
    for fault in (fault for fault in FAULTS if fault.last):
        progress((time.monotonic() - began) / (60.0 * minutes), fault.name)
        yield _suffered(suite, fault, result, None)
    result.minutes = (time.monotonic() - began) / 60.0
    yield result


def _suffered(suite: Suite, fault: Fault, result: Result, began: float | None) -> Result:
    ticks = _ticks(suite)
    suite.live(2.0)
    if ticks is not None and (later := _ticks(suite)) is not None and later[0] > ticks[0]:
        result.rates.append((later[0] - ticks[0]) / (later[1] - ticks[1]))
    suite.suffer(fault, result.outcomes[fault.name])
    if not fault.last:
        suite.processes.check()
    if began is not None:
        for name, pid in suite.processes.ids.items():
            sizes = result.memory.setdefault(name, [])
            sizes.append((time.monotonic() - began, memory(pid)))
    result.calls, result.energies = suite.calls, suite.watcher.energies
    return result


def _ticks(suite: Suite) -> tuple[int, float] | None:
    status: Any = suite.watcher.latest.get("sim: loop")
    return None if status is None else (int(status.values["ticks"]), status.at)


class _Shares:
    """Processor time since it was made."""

    def __init__(self, suite: Suite) -> None:
        self._suite, self._at = suite, time.monotonic()
        self._used = {name: processor_time(pid) for name, pid in suite.processes.ids.items()}

    def now(self) -> dict[str, float]:
        """Share of a processor of every process."""
        passed = time.monotonic() - self._at
        ids = self._suite.processes.ids
        return {n: (processor_time(ids[n]) - used) / passed for n, used in self._used.items()}
