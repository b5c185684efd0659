# SPDX-License-Identifier: Apache-2.0
"""The report of a soak: a verdict, a table of faults, a table of processes."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from benchmarks.reporting.markdown import table
from benchmarks.soak.faults import FAULTS
from benchmarks.soak.result import Outcome, Result
from benchmarks.soak.stamps import UNEVEN

GROWTH = 5.0  # [MB] that memory may grow


def write(result: Result, out: Path) -> Path:
    """Write soak.json and soak.md into a folder; return the page's path."""
    out.mkdir(parents=True, exist_ok=True)
    (out / "soak.json").write_text(json.dumps(asdict(result), indent=1) + "\n")
    path = out / "soak.md"
    path.write_text(page(result))
    return path


def complaints(result: Result) -> list[str]:
    """What was not as it should be."""
    found = [f"ended early: {result.ended}"] if result.ended else []
    for name, outcome in result.outcomes.items():
        found += [f"{name}: {words}" for words in outcome.trouble]
    for name in result.memory:
        if (growth := result.growth(name)) > GROWTH:
            found.append(f"{name}: memory grew by {growth:.1f} MB")
    found += [f"{name}: commands were called stale, and had not paused" for name in result.false]
    if result.unexplained or not result.stamps:
        found.append(f"{result.unexplained} of {result.stamps} stamps are out of step")
    if result.lost:
        found.append(f"{result.lost} ticks or messages are not in the recording")
    return found


def page(result: Result) -> str:
    """The report in Markdown."""
    wrong = complaints(result)
    done = sum(outcome.times for outcome in result.outcomes.values())
    verdict = "nothing was amiss" if not wrong else f"{len(wrong)} complaints"
    rates = np.array(result.rates or [0.0])
    lines = [
        "# Soak",
        f"{result.minutes:.1f} minutes, {done} faults, {result.calls} service calls of 100 points "
        f"beside the loop, {result.energies} energy messages: **{verdict}**.",
        *(f"- {words}" for words in wrong),
        f"Rate of the simulation between faults: median {np.median(rates):.2f} Hz, least "
        f"{rates.min():.2f} Hz.",
        f"{result.stamps} stamps of the clock were recorded. {len(result.uneven)} are out of step "
        f"by more than {100.0 * UNEVEN:g} % of a tick, {result.unexplained} of them other than to "
        f"make up for dropped ticks. Commands were called stale {len(result.false)} times without "
        f"a pause, and {len(result.paused)} times after one: {_counted(result.paused)}.",
        "## Faults",
        table(
            ("fault", "times", "told by", "told", "well again", "worst error [rad]", "words"),
            (
                (
                    fault.name, o.times, f"`{fault.part}`", o.told, o.well,
                    f"{o.worst:.1e}" if fault.gentle and o.times else "—", o.words,
                )
                for fault in FAULTS
                for o in (result.outcomes.get(fault.name, Outcome()),)
            ),
        ),
        "## Processes",
        table(
            ("process", "memory at first [MB]", "at last [MB]", "growth [MB]", "processor share"),
            (
                (
                    name, f"{sizes[0][1]:.1f}", f"{sizes[-1][1]:.1f}",
                    f"{result.growth(name):+.2f}", f"{100.0 * result.share.get(name, 0.0):.1f} %",
                )
                for name, sizes in result.memory.items()
            ),
        ),
        "Growth compares the medians of the first and last tenth after warming up. Processes are "
        "killed only in the last minute and a half, so memory is that of one life. Giant messages "
        "are sent at the beginning: the transport keeps the buffers of the largest it has seen.",
    ]  # fmt: skip
    return "\n\n".join(lines).replace("\n\n- ", "\n- ") + "\n"


def _counted(names: Sequence[str]) -> str:
    return ", ".join(f"{name} {count}" for name, count in Counter(names).most_common()) or "none"
