# SPDX-License-Identifier: Apache-2.0
"""What became of the random sets of features, as Markdown."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from benchmarks.reporting.markdown import number, table
from benchmarks.stress.together.judge import FORBIDDEN, MUJOCO, OURS, OUTCOMES, Result
from benchmarks.stress.verdict import SHOWN, STOPPED, SURVIVED

HEAD = ["program, method", "runs", "steady", *OUTCOMES, "false alarms", "error: median", "worst"]


def outcomes(results: Sequence[Result]) -> str:
    """What became of the runs of each method, and of those that both programs made."""
    ours, theirs = of(results, OURS), of(results, MUJOCO)
    names = sorted({r.name for r in ours})
    rows = [_row(f"{OURS}, {name}", [r for r in ours if r.name == name]) for name in names]
    rows.append(_row(f"**{OURS}, all**", ours))
    for touching, words in ((False, "without stops and contacts"), (True, "with them")):
        if mine := [r for r in theirs if r.touches is touching]:
            same = {(r.seed, r.run) for r in mine}
            again = [r for r in ours if (r.seed, r.run) in same]
            rows.append(_row(f"{OURS}, where MuJoCo can, {words}", again))
            rows.append(_row(f"{MUJOCO}, {words}", mine))
    return table(HEAD, rows)


def _row(name: str, mine: Sequence[Result]) -> list[str]:
    number_of = [sum(r.outcome == outcome for r in mine) for outcome in OUTCOMES]
    errors = [r.error for r in mine if r.error is not None and r.steady]
    spread = [number(float(np.median(errors)), 1), number(max(errors), 1)] if errors else ["—"] * 2
    cells = [len(mine), sum(r.steady for r in mine), *number_of, sum(r.false_alarm for r in mine)]
    return [name, *map(str, cells), *spread]


def wrong(results: Sequence[Result]) -> str:
    """What must not be: each by name, with the seed that repeats it."""
    bad = [r for r in of(results, OURS) if r.outcome in FORBIDDEN]
    return "\n".join(f"- {line(r)}" for r in bad) or (
        "None of arm_sim's runs hung or crashed, and every error was reported."
    )


def stopped(results: Sequence[Result]) -> str:
    """What ended with an error: the first run of each case."""
    ended = [r for r in of(results, OURS) if r.outcome == STOPPED]
    number_of = Counter(r.seed for r in ended)
    first = {r.seed: r for r in reversed(ended)}
    lines = [f"- {line(first[seed])} ({count} runs)" for seed, count in number_of.items()]
    return "\n".join(lines) or "None of arm_sim's runs stopped."


def line(result: Result) -> str:
    """One run in words."""
    error = "" if result.error is None else f", off by {number(result.error, 2)}"
    return (
        f"**{result.outcome}**: seed {result.seed}, run {result.run}, {result.name}, tick "
        f"{result.dt:g} s, {result.label}{error}" + (f"; {result.message}" * bool(result.message))
    )


def counts(results: Sequence[Result]) -> dict[str, str]:
    """Numbers for the text."""
    ours = of(results, OURS)
    seeds = [r.seed for r in ours]
    shown = [r for r in ours if r.outcome == SHOWN]
    piled = [r for r in ours if "time-stepped" in r.told]
    return {
        "runs": str(len(ours)),
        "cases": str(len({*seeds})),
        "seed": str(min(seeds)),
        "last": str(max(seeds)),
        "both": str(len(of(results, MUJOCO))),
        "unsteady": str(sum(not r.steady for r in ours if r.outcome in (SURVIVED, SHOWN))),
        "only_time_stepped": str(sum(r.told == ("time-stepped",) for r in shown)),
        "time_stepped": str(len(piled)),
        "slowest": number(max(r.slowest for r in ours), 1),
    }


def of(results: Sequence[Result], program: str) -> list[Result]:
    """The runs of one program."""
    return [r for r in results if r.program == program]


def plain(results: Sequence[Result]) -> list[dict[str, object]]:
    """Everything as plain data, but CPU times: the same for the same seeds."""
    rows = [asdict(result) for result in results]
    for row in rows:
        del row["slowest"]
        row.update({key: str(x) for key, x in row.items() if x in (np.inf, -np.inf)})
    return rows
