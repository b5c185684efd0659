# SPDX-License-Identifier: Apache-2.0
"""The page: text from page.md, tables from what was found."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.reporting.markdown import wrapped
from benchmarks.stress import tables
from benchmarks.stress.figure import draw
from benchmarks.stress.survey import Found, Plan
from benchmarks.stress.together.page import NONE, spliced, within

TEMPLATE = Path(__file__).with_name("page.md")
PARTS = {
    "outcomes": tables.outcomes,
    "survival": tables.survival,
    "errors": tables.errors,
    "energies": tables.energies,
    "by_rate": tables.by_rate,
    "by_friction": tables.by_friction,
    "delivered": tables.delivered,
    "wrong": tables.wrong,
    "refused": tables.refused,
}


def write(found: Sequence[Found], plan: Plan, seed: int, out: Path, docs: Path | None) -> Path:
    """Write stability.json, stability.md and the figure; page and figure also into ``docs``.

    Args:
        found: of all arms, in the order of their seeds.
        plan: what was tried.
        seed: of the first arm.
        out: folder.
        docs: folder of the documentation, if it is to be renewed.

    Returns:
        Path of the page in ``out``.
    """
    out.mkdir(parents=True, exist_ok=True)
    (out / "stability.json").write_text(json.dumps(plain(found, plan, seed), indent=1) + "\n")
    for folder in [out] if docs is None else [out, docs]:
        draw(found, folder / "figures/stability.png")
        path = folder / "stability.md"
        path.write_text(page(found, seed, within(path)))
    return out / "stability.md"


def page(found: Sequence[Found], seed: int, together: str = NONE) -> str:
    """The page in Markdown, with the section on sets of features as it is given."""
    text = TEMPLATE.read_text()
    words = tables.counts(found) | {"seed": str(seed), "last": str(found[-1].seed)}
    for name, part in ({name: make(found) for name, make in PARTS.items()} | words).items():
        text = text.replace("{{" + name + "}}", part)
    return spliced(wrapped(text), together)


def plain(found: Sequence[Found], plan: Plan, seed: int) -> dict[str, Any]:
    """Everything as plain data; the same for the same seed and plan."""
    return {"seed": seed, "plan": asdict(plan), "arms": [_arm(one) for one in found]}


def _arm(one: Found) -> dict[str, Any]:
    motion = {
        name: _finite(value) for name, value in asdict(one.motion).items()
        if name not in ("q", "speed")
    }  # fmt: skip
    runs = [{name: _finite(value) for name, value in asdict(r).items()} for r in one.results]
    traits = one.arm.traits if one.arm else ()
    return {"seed": one.seed, "traits": traits, "motion": motion, "runs": runs}


def _finite(value: Any) -> Any:
    """JSON has no infinity: beyond all bounds is said in words."""
    return "inf" if isinstance(value, float) and value == float("inf") else value
