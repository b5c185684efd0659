# SPDX-License-Identifier: Apache-2.0
"""The report: the results as JSON, as Markdown for people, and the figures."""

from __future__ import annotations

import json
from pathlib import Path

from rich.table import Table

from benchmarks import figures, sections
from benchmarks.bench import Record
from benchmarks.markdown import quantity


def write(results: Record, out: Path) -> Path:
    """Write ``report.json``, ``report.md`` and the figures.

    Args:
        results: as ``suite.run`` returns them.
        out: folder, made if need be.

    Returns:
        Path of the Markdown report.
    """
    save(results, out)
    pictures = figures.draw(results, out)
    path = out / "report.md"
    path.write_text(sections.markdown(results, pictures))
    return path


def save(results: Record, out: Path) -> None:
    """Write ``report.json`` only.

    Args:
        results: as ``suite.run`` returns them.
        out: folder, made if need be.
    """
    out.mkdir(parents=True, exist_ok=True)
    (out / "report.json").write_text(json.dumps(results, indent=1) + "\n")


def summary(results: Record) -> Table:
    """The promises and what was measured, for the terminal."""
    table = Table("promise", "measured", "allowed", "")
    for claim in results["claims"]:
        verdict = {True: "[green]kept", False: "[red]broken", None: "not measured"}[claim["kept"]]
        table.add_row(
            claim["text"], quantity(claim["value"], claim["unit"]),
            quantity(claim["limit"], claim["unit"]), verdict,
        )  # fmt: skip
    return table
