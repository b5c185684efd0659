# SPDX-License-Identifier: Apache-2.0
"""The results as JSON, as Markdown with figures, and for the terminal."""

from __future__ import annotations

import json
from pathlib import Path

from rich.table import Table

from benchmarks.comparison import figures, sections
from benchmarks.comparison.claims import MET, MISSED, OPEN
from benchmarks.reporting.markdown import quantity
from benchmarks.studies.bench import Record

_COLOURS = {MET: "[green]", MISSED: "[red]", OPEN: "[yellow]"}


def write(results: Record, out: Path) -> Path:
    """Write ``report.json``, ``report.md`` and the figures."""
    save(results, out)
    pictures = figures.draw(results, out)
    path = out / "report.md"
    path.write_text(sections.markdown(results, pictures))
    return path


def save(results: Record, out: Path) -> None:
    """Write ``report.json`` only."""
    out.mkdir(parents=True, exist_ok=True)
    (out / "report.json").write_text(json.dumps(results, indent=1) + "\n")


def summary(results: Record) -> Table:
    """The claims and their measurements, for the terminal."""
    table = Table("claim", "measured", "95 % interval", "allowed", "")
    for claim in results["claims"]:
        verdict = _COLOURS.get(claim["verdict"], "") + claim["verdict"]
        table.add_row(
            claim["text"], quantity(claim["value"], claim["unit"]), sections.interval(claim),
            quantity(claim["limit"], claim["unit"]), verdict,
        )  # fmt: skip
    return table
