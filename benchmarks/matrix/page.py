# SPDX-License-Identifier: Apache-2.0
"""The page: text from page.md, tables from the results."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from benchmarks.matrix.measure import ACCOUNT, POSITION, TOLERANCE, features, solutions
from benchmarks.reporting.markdown import number, table, wrapped

TEMPLATE = Path(__file__).with_name("page.md")
NAME = "features-together"
MATTERS = 1e-3  # [rad] that a feature must change
Results = dict[str, Any]


def write(results: Results, out: Path, docs: Path | None) -> Path:
    """Write the results as JSON and as a page; the page also into ``docs``.

    Returns:
        Path of the page in ``out``.
    """
    keep(results, out)
    for folder in [out] if docs is None else [out, docs]:
        (folder / f"{NAME}.md").write_text(page(results))
    return out / f"{NAME}.md"


def keep(results: Results, out: Path) -> None:
    """Write the results as JSON."""
    out.mkdir(parents=True, exist_ok=True)
    (out / f"{NAME}.json").write_text(json.dumps(results, indent=1) + "\n")


def page(results: Results) -> str:
    """The page in Markdown."""
    text = TEMPLATE.read_text()
    for name, part in {
        "rtol": "1e-12",
        "tolerance": number(TOLERANCE, 1),
        "summary": _summary(results),
        "tables": "\n\n".join(_pairs(results, arm) for arm in features.ARMS if arm in results),
        "many": "\n\n".join(_many(results, arm) for arm in features.ARMS if arm in results),
    }.items():
        text = text.replace("{{" + name + "}}", part)
    return wrapped(text)


def verdict(found: dict[str, Any]) -> bool:
    """Whether a set is as near as it must be."""
    return "failed" not in found and (
        found["position"] <= POSITION and found["account"] <= ACCOUNT
    )


def _summary(results: Results) -> str:
    rows = []
    for arm in (arm for arm in features.ARMS if arm in results):
        found = results[arm].values()
        good = [x for x in found if "failed" not in x]
        rows.append(
            [
                arm, len(found), sum(map(verdict, found)),
                number(max(x["position"] for x in good), 2),
                number(max(x["account"] for x in good), 2),
            ]
        )  # fmt: skip
    heads = ["arm", "sets", f"within {number(POSITION, 1)} rad and {number(ACCOUNT, 1)} of what"
             " moved", "largest error [rad]", "largest part missing in the account"]  # fmt: skip
    return table(heads, rows)


def _pairs(results: Results, arm: str) -> str:
    """A square: above the diagonal errors of positions, below it those of the account."""
    found = results[arm]
    rows = []
    for i, one in enumerate(features.ALL):
        cells = []
        for j, other in enumerate(features.ALL):
            pair = tuple(f for f in features.ALL if f in (one, other))
            cells.append(
                _cell(found.get(solutions.label(pair)), "position" if i <= j else "account")
            )
        rows.append([f"**{one}**", *cells])
    head = f"**{arm}**: above the diagonal and on it (the feature alone) the largest" \
        " position error in rad, below it the error of the energy account relative to the energy" \
        " that was exchanged."  # fmt: skip
    return f"{head}\n\n{table(['', *features.ALL], rows)}"


def _cell(found: dict[str, Any] | None, key: str) -> str:
    if found is None:
        return "—"
    if "failed" in found:
        return "**fails**"
    text = number(found[key], 1)
    return text if found[key] <= {"position": POSITION, "account": ACCOUNT}[key] else f"**{text}**"


def _many(results: Results, arm: str) -> str:
    rows = [
        [name, _cell(found, "position"), _cell(found, "account"), _told(found)]
        for name, found in results[arm].items()
        if name.count(",") > 1
    ]
    return table([arm, "error [rad]", "missing", "what happened"], rows)


def _told(found: dict[str, Any]) -> str:
    words = {
        "sticks": "sticks", "slides": "starts", "impact": "impacts",
        "grips": "contact sticks", "rubs": "contact slides", "hit": "hits a stop",
    }  # fmt: skip
    events = found.get("events", {})
    return ", ".join(f"{words[kind]} {n}×" for kind, n in events.items() if kind in words) or "—"
