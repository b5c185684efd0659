# SPDX-License-Identifier: Apache-2.0
"""The scoreboard: for every task the best of this suite beside the best of its peers."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from benchmarks.peers.base import OURS
from benchmarks.reporting.markdown import duration, number, table
from benchmarks.studies.bench import Record

INTRO = """\
For every task, the best of this suite beside the best of the peers that are installed, measured
in one run by `./arm bench --scoreboard`. A ratio below one means that this suite takes less. Times
are processor times of one core."""


@dataclass(frozen=True)
class Line:
    """A task, times of the best of this suite and of the best peer in [s], and which these are."""

    task: str
    ours: float
    who: str
    theirs: float | None = None  # if no peer can do it
    peer: str = ""

    @property
    def ratio(self) -> float | None:
        """Our time over theirs; None without a peer."""
        return None if self.theirs is None else self.ours / self.theirs


def lines(results: Record) -> list[Line]:
    return [
        *_steps(results), *_errors(results), *_chains(results), *_rollouts(results),
        *_starts(results),
    ]  # fmt: skip


def page(results: Record, about: str) -> str:
    found = lines(results)
    rows = [
        (line.task, duration(line.ours), line.who, duration(line.theirs), line.peer or "none",
         f"**{number(line.ratio)}**" if line.ratio else "")
        for line in found
    ]  # fmt: skip
    head = ("task", OURS, "by", "best peer", "by", "ratio")
    behind = [line.task for line in found if line.ratio and line.ratio > 1.0]
    lost = f"Behind a peer in: {'; '.join(behind)}." if behind else "Behind a peer in no task."
    return "\n\n".join(["# Scoreboard", INTRO, table(head, rows), lost, about]) + "\n"


def _best(rows: Sequence[Record], key: str, unit: float) -> tuple[float, str] | None:
    """The least time and whose it is."""
    row = min(rows, key=lambda row: float(row[key]), default=None)
    return None if row is None else (row[key] * unit, str(row["who"]))


def _line(task: str, rows: Sequence[Record], key: str, unit: float = 1.0) -> Iterator[Line]:
    """The best of this suite beside the best of the others."""
    mine = _best([row for row in rows if row["who"].startswith(OURS)], key, unit)
    theirs = _best([row for row in rows if not row["who"].startswith(OURS)], key, unit)
    if mine is not None:
        yield Line(task, *mine, *(theirs or ()))


def _rows(results: Record, study: str) -> list[Any]:
    return list(results.get(study, {}).get("rows", ()))


def _steps(results: Record) -> Iterator[Line]:
    tasks = (
        ("a step of 1 ms", "step", ""),
        ("forward dynamics", "evaluation", ""),
        ("a step of fourth order", "step", "rk4"),
    )
    rows = _rows(results, "cost")
    for robot, (task, what, named) in product(dict.fromkeys(r["robot"] for r in rows), tasks):
        some = [r for r in rows if (r["robot"], r["what"]) == (robot, what)]
        some = [r for r in some if named in r["who"].lower()]
        yield from _line(f"{task} of {robot}", some, "ns", 1e-9)


def _errors(results: Record) -> Iterator[Line]:
    rows = [
        {**row, "who": f"{row['family']} {row['method']}"}
        for row in results.get("targets", ())
        if row["cpu_s"]
    ]
    keys = dict.fromkeys((row["robot"], row["scenario"], row["target_rad"]) for row in rows)
    for robot, scenario, target in keys:
        some = [r for r in rows if (r["robot"], r["scenario"], r["target_rad"])
                == (robot, scenario, target)]  # fmt: skip
        moved = f"{some[0]['duration_s']:g} s of {robot}, {scenario}"
        yield from _line(f"{moved}, to {target:g} rad", some, "cpu_s")


def _chains(results: Record) -> Iterator[Line]:
    rows = [{**row, "second": row["ns"] / row["step"]} for row in _rows(results, "closed_chain")]
    peers = [row["error"] for row in rows if not row["who"].startswith(OURS)]
    least = min(peers, default=max((row["error"] for row in rows), default=0.0))
    some = [r for r in rows if r["error"] <= (1.0 if r["who"].startswith(OURS) else 2.0) * least]
    yield from _line(f"1 s of a four-bar to {least:.1e} rad", some, "second", 1e-9)


def _rollouts(results: Record) -> Iterator[Line]:
    rows = [
        {**row, "tick": 1.0 / row["arm_steps_per_s_per_core"]}
        for row in _rows(results, "rollouts")
    ]
    for robot in dict.fromkeys(row["robot"] for row in rows):
        some = [row for row in rows if row["robot"] == robot]
        yield from _line(f"a step of one of many arms, {robot}", some, "tick")


def _starts(results: Record) -> Iterator[Line]:
    for row in _rows(results, "startup"):
        for kind in ("cold", "cached"):
            seconds = row[f"{kind}_s"]["total without imports"]
            yield Line(f"{kind} start of {row['robot']}", seconds, OURS)
