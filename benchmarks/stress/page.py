# SPDX-License-Identifier: Apache-2.0
"""The report: tables, a figure, and all runs as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from benchmarks.stress import tables
from benchmarks.stress.figure import draw
from benchmarks.stress.holding import Held, summary
from benchmarks.stress.judge import Result


def write(found: Sequence[Result], held: Sequence[Held], out: Path, docs: Path | None) -> Path:
    """Write stability.json, stability.md and the figure; the figure also into ``docs``."""
    out.mkdir(parents=True, exist_ok=True)
    kept = {"runs": [asdict(r) for r in found], "held": [asdict(one) for one in held]}
    (out / "stability.json").write_text(json.dumps(kept, indent=1) + "\n")
    for folder in [out] if docs is None else [out, docs]:
        draw(found, folder / "figures/stability.png")
    (out / "stability.md").write_text(page(found, held))
    return out / "stability.md"


def page(found: Sequence[Result], held: Sequence[Held]) -> str:
    """All tables, in Markdown."""
    parts = {
        "Outcomes": f"{tables.outcomes(found)}\n\n{tables.wrong(found)}",
        "Survival by length of the tick": tables.survival(found),
        "Errors of the runs that survive, relative to 1 + |q|: median, worst":
            tables.errors(found),
        "Errors under error control: median, worst": tables.delivered(found),
        "Sets that hold together": summary(held) if held else "Not run.",
    }  # fmt: skip
    sections = (f"## {title}\n\n{part}\n" for title, part in parts.items())
    return "\n".join([f"# Stability\n\n{tables.counts(found)}\n", *sections])
