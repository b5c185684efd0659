# SPDX-License-Identifier: Apache-2.0
"""The page: text from page.md, tables from what was found."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from benchmarks.reporting.markdown import wrapped
from benchmarks.stress import tables
from benchmarks.stress.figure import draw
from benchmarks.stress.holding import Held, summary
from benchmarks.stress.judge import Result

TEMPLATE = Path(__file__).with_name("page.md")
PARTS = {
    "outcomes": tables.outcomes,
    "survival": tables.survival,
    "errors": tables.errors,
    "by_rate": tables.by_rate,
    "delivered": tables.delivered,
    "wrong": tables.wrong,
}


def write(found: Sequence[Result], held: Sequence[Held], out: Path, docs: Path | None) -> Path:
    """Write stability.json, stability.md and the figure; the figure also into ``docs``.

    Args:
        found: All runs, in the order of their seeds.
        held: Sets that hold together.
        out: Folder.
        docs: Folder of the documentation, if it is to be renewed.

    Returns:
        Path of the page in ``out``.
    """
    out.mkdir(parents=True, exist_ok=True)
    kept = {"runs": [asdict(r) for r in found], "held": [asdict(one) for one in held]}
    (out / "stability.json").write_text(json.dumps(kept, indent=1) + "\n")
    for folder in [out] if docs is None else [out, docs]:
        draw(found, folder / "figures/stability.png")
    (out / "stability.md").write_text(page(found, held))
    return out / "stability.md"


def page(found: Sequence[Result], held: Sequence[Held]) -> str:
    """The page in Markdown."""
    text = TEMPLATE.read_text()
    parts = {name: make(found) for name, make in PARTS.items()} | tables.counts(found)
    for name, part in (parts | {"held": summary(held) if held else "Not run."}).items():
        text = text.replace("{{" + name + "}}", part)
    return wrapped(text)
