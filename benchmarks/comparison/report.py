# SPDX-License-Identifier: Apache-2.0
"""The results as JSON, as Markdown with figures, and as ``docs/laboratory/performance.md``."""

from __future__ import annotations

import json
import re
from pathlib import Path

from rich.table import Table

from benchmarks.comparison import figures, scoreboard, sections
from benchmarks.comparison.claims import MET, MISSED, OPEN
from benchmarks.reporting.markdown import quantity, wrapped
from benchmarks.studies.bench import Record

TEMPLATE = Path(__file__).with_name("page.md")
FIGURES = "figures/"
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


def write_scoreboard(results: Record, out: Path) -> Path:
    """Write ``scoreboard.md``."""
    path = out / "scoreboard.md"
    path.write_text(scoreboard.page(results, sections.about(results)))
    return path


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


def write_page(results: Record, docs: Path) -> Path:
    """Write performance.md: text from page.md, tables and figures from the results."""
    (docs / FIGURES).mkdir(parents=True, exist_ok=True)
    pictures = figures.draw(results, docs / FIGURES)
    path = docs / "performance.md"
    path.write_text(page(results, pictures))
    return path


def page(results: Record, pictures: dict[str, str]) -> str:
    """The page in Markdown; a place without a value is an error."""
    parts = {
        "about": sections.about(results),
        "claims": sections.claims(results),
        "method": sections.METHOD,
        "targets": sections.targets(results),
        "truths": sections.truths(results),
    }
    for study, (_, section) in sections.SECTIONS.items():
        parts[study] = section(results)
        parts[f"{study}_figures"] = sections.figures(pictures, study, FIGURES)
    return wrapped(re.sub(r"\{\{(\w+)\}\}", lambda place: parts[place[1]], TEMPLATE.read_text()))
