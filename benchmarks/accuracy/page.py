# SPDX-License-Identifier: Apache-2.0
"""The page: text from page.md, tables from the results."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.accuracy.figure import draw
from benchmarks.accuracy.sweep import CONTROLLED, TICKS, TOLERANCES
from benchmarks.markdown import number, table

TEMPLATE = Path(__file__).with_name("page.md")
ROUNDING = 1e-11  # tolerances below this are not asked of the ratios: rounding answers
Results = dict[str, Any]


def write(results: Results, out: Path, docs: Path | None) -> Path:
    """Write accuracy.json, accuracy.md and the figure; page and figure also into ``docs``.

    Returns:
        Path of the page in ``out``.
    """
    out.mkdir(parents=True, exist_ok=True)
    (out / "accuracy.json").write_text(json.dumps(results, indent=1) + "\n")
    for folder in [out] if docs is None else [out, docs]:
        draw(results, folder / "figures/accuracy.png")
        (folder / "accuracy.md").write_text(page(results))
    return out / "accuracy.md"


def page(results: Results) -> str:
    """The page in Markdown."""
    text = TEMPLATE.read_text()
    for name, part in {
        "problems": _problems(results),
        "at_1_ms": _at_1_ms(results),
        "orders": _orders(results),
        "gates": _gates(results),
        "delivered": _ratios(results, "delivered"),
        "estimated": _ratios(results, "estimated"),
        "ticks": _spans(results),
        "steps": _steps(results),
        "asked": _asked(results),
    }.items():
        text = text.replace("{{" + name + "}}", part)
    return text


def _names(results: Results) -> list[str]:
    return [problem["name"] for problem in results["about"]["problems"]]


def _problems(results: Results) -> str:
    rows = [
        (p["name"], f"{p['duration_s']:g}", p["truth"], p["gated"], number(p["gate"]))
        for p in results["about"]["problems"]
    ]
    return table(["problem", "duration [s]", "truth", "method", "gate at 1 ms"], rows)


def _at_1_ms(results: Results) -> str:
    """Method by problem."""
    found = {
        (r["problem"], r["method"]): r["error"] for r in results["fixed"] if r["step_s"] == 1e-3
    }
    methods = results["about"]["methods"]
    rows = [
        [name, *(_error(found.get((name, method))) for method in methods)]
        for name in _names(results)
    ]
    return table(["problem", *methods], rows)


def _orders(results: Results) -> str:
    found = {(r["problem"], r["method"]): f"{r['order']:.1f}" for r in results["orders"]}
    methods = results["about"]["methods"]
    stated = ["**stated**", *(f"**{m['order']}**" for m in methods.values())]
    rows = [
        [name, *(found.get((name, method), "—") for method in methods)] for name in _names(results)
    ]
    return table(["problem", *methods], [stated, *rows])


def _gates(results: Results) -> str:
    rows = [
        (g["what"], _error(g["measured"]), number(g["allowed"]), "yes" if g["kept"] else "**no**")
        for g in results["gates"]
    ]
    return table(["what", "measured", "allowed", "kept"], rows)


def _ratios(results: Results, kind: str) -> str:
    """Least, middle and largest ratio over the tolerances, by problem, method and tick."""
    columns = [(method, tick) for method in CONTROLLED for tick in TICKS]
    rows = []
    for name in _names(results):
        cells = []
        for method, tick in columns:
            values = [
                r["error"] / r["tolerance"] if kind == "delivered" else r["estimate"] / r["error"]
                for r in results["controlled"]
                if (r["problem"], r["method"], r["tick_s"]) == (name, method, tick)
                and r["error"]
                and r["tolerance"] >= 0.99 * ROUNDING
            ]
            cells.append(_span(values))
        rows.append([name, *cells])
    heads = [f"{method}, {number(tick * 1e3)} ms" for method, tick in columns]
    return table(["problem", *heads], rows)


def _spans(results: Results) -> str:
    """The same over all problems, without those that lose it in chaos or friction."""
    rows = []
    for method in CONTROLLED:
        for tick in TICKS:
            values = [
                r["error"] / r["tolerance"]
                for r in results["controlled"]
                if (r["method"], r["tick_s"]) == (method, tick)
                and r["error"]
                and r["tolerance"] >= 0.99 * ROUNDING
            ]
            below = np.mean(np.array(values) <= 1.0) if values else 0.0
            ten = np.mean(np.array(values) <= 10.0) if values else 0.0
            rows.append((method, f"{tick * 1e3:g} ms", f"{below:.0%}", f"{ten:.0%}",
                         number(max(values, default=None), 2)))  # fmt: skip
    heads = ["method", "tick", "within what was asked", "within ten times that", "worst ratio"]
    return table(heads, rows)


def _steps(results: Results) -> str:
    """A table of methods by steps for each problem."""
    parts = []
    for problem in results["about"]["problems"]:
        name, steps = problem["name"], problem["steps_s"]
        found = {
            (r["method"], r["step_s"]): r["error"]
            for r in results["fixed"]
            if r["problem"] == name
        }
        rows = [
            [method, *(_error(found[method, step]) for step in steps)]
            for method in results["about"]["methods"]
        ]
        heads = [f"{step * 1e3:g} ms" for step in steps]
        title = f"**{name}**, {problem['duration_s']:g} s"
        parts.append(f"{title}\n\n{table([name, *heads], rows)}")
    return "\n\n".join(parts)


def _asked(results: Results) -> str:
    """Delivered error by problem and tolerance, DOP853 with long ticks."""
    rows = []
    for name in _names(results):
        for method in ("dop853",):
            line = {
                r["tolerance"]: r["error"]
                for r in results["controlled"]
                if (r["problem"], r["method"], r["tick_s"]) == (name, method, 0.1)
            }
            rows.append([name, *(_error(line[tolerance]) for tolerance in TOLERANCES)])
    return table(["asked for", *(f"{tolerance:.0e}" for tolerance in TOLERANCES)], rows)


def _span(values: Iterable[float]) -> str:
    numbers = sorted(values)
    if not numbers:
        return "—"
    middle = float(np.median(numbers))
    return f"{number(numbers[0], 1)} … **{number(middle, 1)}** … {number(numbers[-1], 1)}"


def _error(value: float | None) -> str:
    return "lost" if value is None else number(value, 2)
