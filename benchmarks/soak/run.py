# SPDX-License-Identifier: Apache-2.0
"""Injects one fault after another for as long as asked, and measures what the nodes take."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.measurement.watcher import memory, processor_time
from benchmarks.soak.faults import FAULTS, Fault
from benchmarks.soak.result import Outcome, Result
from benchmarks.soak.stamps import (
    answers,
    had_paused,
    recorded,
    uneven,
    unexplained,
    warnings,
)
from benchmarks.soak.system import CLOCKED, SIMS, STATES, System

SETTLE, NOTICE, RECOVER = 2.0, 4.0, 12.0  # [s] before a fault, to be told of it, to be well again
TRACKING = 5e-3  # [rad] that the arm may be off while nothing should disturb it, or three times
# what it was off between faults, where others load the machine
PERIOD = 1_000_000  # [ns] of a tick
LAST = 90.0  # [s] at the end for faults that start processes anew


class Injector:
    """Injects faults into a system and notes what came of each."""

    def __init__(self, system: System) -> None:
        """Begin with a system that runs."""
        self.system, self._usual = system, 0.0
        self.lost = system.lost  # of the giants, which come all at once

    def inject(self, fault: Fault, outcome: Outcome) -> None:
        """Inject a fault and note what came of it."""
        system, watcher = self.system, self.system.watcher
        watcher.worst_error = 0.0
        system.live(SETTLE)
        usual, watcher.worst_error = watcher.worst_error, 0.0
        self._usual = max(self._usual, usual) if fault.gentle else self._usual
        since = time.monotonic()
        fault.do(system)
        if fault.after:
            since = time.monotonic()
        outcome.times += 1
        if watcher.until(lambda: self._told(fault, since), NOTICE + 6.0):
            outcome.told += 1
            outcome.words = self._told(fault, since)
        else:
            _complain(outcome, f"not told; {fault.part} says: {self._says(fault.part)}")
        if fault.gentle:
            outcome.worst = max(outcome.worst, watcher.worst_error)
            if watcher.worst_error > max(TRACKING, 3.0 * self._usual):
                _complain(outcome, f"tracking error {watcher.worst_error:.2e} rad")
        self._recover(outcome)

    def _told(self, fault: Fault, since: float) -> str:
        """What the diagnostics said of a fault since it began, empty if nothing."""
        said = (self.system.watcher.said(since, *teller) for teller in fault.tellers)
        return next((status.message for status in said if status is not None), "")

    def _recover(self, outcome: Outcome) -> None:
        end = time.monotonic() + RECOVER
        if self.system.watcher.has("joint_commands"):
            self.system.watcher.drop("joint_commands")
        while time.monotonic() < end:
            self.system.live(1.0)
            if not self.system.watcher.troubles():
                outcome.well += 1
                return
        _complain(outcome, f"not well again: {'; '.join(self.system.watcher.troubles())}")

    def _says(self, part: str) -> str:
        latest = self.system.watcher.latest.get(part)
        return latest.message if latest else "nothing"


def _complain(outcome: Outcome, words: str) -> None:
    if len(outcome.trouble) < 5:
        outcome.trouble.append(words)


def soak(
    system: System, minutes: float, progress: Callable[[float, str], None]
) -> Iterator[Result]:
    """Do every fault again and again; give the result so far after each.

    Args:
        system: The running nodes.
        minutes: How long.
        progress: Told the share that is over and what comes.
    """
    result = Result(minutes, {fault.name: Outcome() for fault in FAULTS})
    began, share, injector = time.monotonic(), _Shares(system), Injector(system)
    gentle = cycle(fault for fault in FAULTS if not fault.last)
    while (over := time.monotonic() - began) < 60.0 * minutes - LAST:
        fault = next(gentle)
        progress(over / (60.0 * minutes), fault.name)
        result.minutes = over / 60.0
        yield _injected(injector, fault, result, began)
    result.share = share.now()
    for fault in (fault for fault in FAULTS if fault.last):
        progress((time.monotonic() - began) / (60.0 * minutes), fault.name)
        yield _injected(injector, fault, result, None)
    result.minutes = (time.monotonic() - began) / 60.0
    yield result


def _injected(injector: Injector, fault: Fault, result: Result, began: float | None) -> Result:
    system = injector.system
    ticks, drops, since = _ticks(system), _drops(system), time.time()
    system.live(2.0)
    if ticks is not None and (later := _ticks(system)) is not None and later[0] > ticks[0]:
        result.rates.append((later[0] - ticks[0]) / (later[1] - ticks[1]))
    injector.inject(fault, result.outcomes[fault.name])
    if not fault.last:
        system.processes.check()
    if began is not None:
        for name, pid in system.processes.ids.items():
            sizes = result.memory.setdefault(name, [])
            sizes.append((time.monotonic() - began, memory(pid)))
    result.calls, result.energies = system.calls, system.watcher.energies
    dropped = _drops(system) > drops
    for sim, process in SIMS.items():
        told = warnings(system.processes.log(process).read_text(errors="replace"))
        result.stale += [(fault.name, sim, at) for at in told if at >= since]
    if dropped:
        result.dropped.append((since, time.time()))
    result.lost = system.lost - injector.lost
    return result


def _drops(system: System) -> int:
    """How many ticks with stamps of the clock were dropped so far."""
    system.watcher.listen(1.2)  # the diagnostics come once a second
    return int(system.watcher.latest[f"{CLOCKED}: loop"].values["dropped"])


def judge_recording(result: Result, recording: Path) -> None:
    """Look at the recorded stamps and commands of a whole soak."""
    if not recording.exists():
        return
    topics = recorded(recording)
    states = topics[f"/{STATES}"]
    places = uneven(states.stamps, PERIOD)
    places = places[places > 1]  # the first state is that before the loop begins
    result.stamps = len(states.stamps)
    steps = 1e-9 * np.diff(states.stamps)[places - 1]
    result.uneven = list(zip(states.at[places].tolist(), steps.tolist(), strict=True))
    result.unexplained = unexplained(states.at[places], result.dropped)
    held_up = {fault.name: fault.holds_up for fault in FAULTS}
    heard = np.unique(np.concatenate([messages.at for messages in topics.values()]))
    for name, sim, at in result.stale:
        commands = answers(topics[f"/{sim.removesuffix('sim')}joint_commands"])
        excused = sim != held_up[name] and had_paused(commands, heard, at)
        (result.paused if excused else result.false).append(name)


def _ticks(system: System) -> tuple[int, float] | None:
    status: Any = system.watcher.latest.get("sim: loop")
    return None if status is None else (int(status.values["ticks"]), status.at)


class _Shares:
    """Processor time since it was made."""

    def __init__(self, system: System) -> None:
        self._system, self._at = system, time.monotonic()
        self._used = {name: processor_time(pid) for name, pid in system.processes.ids.items()}

    def now(self) -> dict[str, float]:
        """Share of a processor of every process."""
        passed = time.monotonic() - self._at
        ids = self._system.processes.ids
        return {n: (processor_time(ids[n]) - used) / passed for n, used in self._used.items()}
