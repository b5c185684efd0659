# SPDX-License-Identifier: Apache-2.0
"""``docs/performance.md``: words from page.md, tables and figures from the results."""

from __future__ import annotations

import re
from pathlib import Path

from benchmarks import figures, sections
from benchmarks.bench import Record

TEMPLATE = Path(__file__).with_name("page.md")
FIGURES = "figures/"


def write(results: Record, docs: Path) -> Path:
    """Write the page and its figures.

    Args:
        results: of all studies.
        docs: folder of the documentation.

    Returns:
        Path of the page.
    """
    (docs / FIGURES).mkdir(parents=True, exist_ok=True)
    pictures = figures.draw(results, docs / FIGURES)
    path = docs / "performance.md"
    path.write_text(page(results, pictures))
    return path


def page(results: Record, pictures: dict[str, str]) -> str:
    """The page in Markdown; a place without a value is an error.

    Args:
        results: of all studies.
        pictures: file names of the figures, by study.
    """
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
    return re.sub(r"\{\{(\w+)\}\}", lambda place: parts[place[1]], TEMPLATE.read_text())
