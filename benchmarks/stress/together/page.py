# SPDX-License-Identifier: Apache-2.0
"""The section on random sets of features in the page on stability."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from benchmarks.reporting.markdown import wrapped
from benchmarks.stress.together import tables
from benchmarks.stress.together.judge import Result

TEMPLATE = Path(__file__).with_name("section.md")
BEGIN, END = "<!-- features: begin -->", "<!-- features: end -->"
NONE = "Not run yet: `./arm stress --only features`."


def write(results: Sequence[Result], out: Path, docs: Path | None) -> Path:
    """Write stability-features.json, and the section into the pages that there are.

    Returns:
        Path of the section by itself.
    """
    out.mkdir(parents=True, exist_ok=True)
    data = json.dumps(tables.plain(results), indent=1)
    (out / "stability-features.json").write_text(data + "\n")
    text = section(results)
    path = out / "stability-features.md"
    path.write_text(text)
    for folder in [out] if docs is None else [out, docs]:
        if (page := folder / "stability.md").is_file():
            page.write_text(spliced(page.read_text(), text))
    return path


def section(results: Sequence[Result]) -> str:
    """The section in Markdown."""
    text = TEMPLATE.read_text()
    parts = {"outcomes": tables.outcomes(results), "wrong": tables.wrong(results)}
    parts["stopped"] = tables.stopped(results)
    for name, part in (parts | tables.counts(results)).items():
        text = text.replace("{{" + name + "}}", part)
    return wrapped(text)


def within(path: Path) -> str:
    """The section that a page has already."""
    text = path.read_text() if path.is_file() else ""
    _, found, rest = text.partition(BEGIN)
    return rest.partition(END)[0].strip() if found else NONE


def spliced(page: str, text: str) -> str:
    """A page with another section."""
    before, _, rest = page.partition(BEGIN)
    return f"{before}{BEGIN}\n\n{text.strip()}\n\n{END}{rest.partition(END)[2]}"
