# SPDX-License-Identifier: Apache-2.0
"""The page: text from page.md, tables from the results."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.accuracy import friction, motors
from benchmarks.accuracy.figure import draw
from benchmarks.accuracy.problems import TICKS
from benchmarks.accuracy.sweep import CONTROLLED, TOLERANCES
from benchmarks.reporting.markdown import number, table, wrapped

TEMPLATE = Path(__file__).with_name("page.md")
ROUNDING = 0.99e-10  # below this tolerance rounding has a say in the error
Results = dict[str, Any]


def write(results: Results, out: Path, docs: Path | None) -> Path:
    """Write accuracy.json, accuracy.md and the figure; the figure also into ``docs``.

    Returns:
        Path of the page in ``out``.
    """
    out.mkdir(parents=True, exist_ok=True)
    (out / "accuracy.json").write_text(json.dumps(results, indent=1) + "\n")
    for folder in [out] if docs is None else [out, docs]:
        draw(results, folder / "figures/accuracy.png")
    (out / "accuracy.md").write_text(page(results))
    return out / "accuracy.md"


def page(results: Results) -> str:
    """The page in Markdown."""
    text = TEMPLATE.read_text()
    for name, part in {
        "problems": _problems(results),
        "at_1_ms": _at_1_ms(results),
        "orders": _orders(results),
        "gates": _gates(results),
        "delivered": _delivered(results),
        "estimated": _estimated(results),
        "shares": _spans(results),
        "steps": _steps(results),
        "asked": _asked(results),
        "motors": motors.page(results["motors"]),
        "dry": friction.page(results["friction"], "dry"),
        "lugre": friction.page(results["friction"], "LuGre"),
    }.items():
        text = text.replace("{{" + name + "}}", part)
    return wrapped(
        re.sub(
            r"{{(.+?)\|(.+?)\|(.+?)(?:\|(.+?))?}}", lambda m: _single(results, *m.groups()), text
        )
    )


def _single(results: Results, problem: str, method: str, step: str, tolerance: str | None) -> str:
    """One error: of a fixed step [s], or with a tolerance of a tick [s]."""
    kind, key = ("fixed", "step_s") if tolerance is None else ("controlled", "tick_s")
    for row in _of(results[kind], problem):
        asked = tolerance is None or row["tolerance"] == float(tolerance)
        if row["method"] == method and row[key] == float(step) and asked:
            return _error(row["error"])
    return "—"


def _names(results: Results) -> list[str]:
    return [problem["name"] for problem in results["about"]["problems"]]


def _problems(results: Results) -> str:
    rows = [
        (p["name"], f"{p['duration_s']:g}", p["truth"], p["gated"], number(p["gate"], 1))
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
        (
            g["what"],
            _error(g["measured"]),
            number(g["allowed"], 1),
            "yes" if g["kept"] else "**no**",
        )
        for g in results["gates"]
    ]
    return table(["what", "measured", "allowed", "kept"], rows)


def _delivered(results: Results) -> str:
    """Least, middle and largest delivered over asked for, over the tolerances."""
    rows = []
    for name in _names(results):
        ours = [_of(_long_ticks(results, method), name) for method in CONTROLLED]
        scipy = [r for r in _of(results["scipy"], name) if r["tolerance"] >= ROUNDING]
        spans = (_span(r["error"] / r["tolerance"] for r in runs) for runs in (*ours, scipy))
        rows.append([name, *spans])
    return table(["problem", *CONTROLLED, "SciPy DOP853"], rows)


def _estimated(results: Results) -> str:
    """Least, middle and largest estimate over delivered error, over the tolerances."""
    rows = []
    for name in _names(results):
        ours = (_of(_long_ticks(results, method), name) for method in CONTROLLED)
        rows.append([name, *(_span(r["estimate"] / r["error"] for r in runs) for runs in ours)])
    return table(["problem", *CONTROLLED], rows)


def _of(rows: list[dict[str, Any]], name: str) -> list[dict[str, Any]]:
    return [row for row in rows if row["problem"] == name]


def _spans(results: Results) -> str:
    """How often error control kept what it was asked for, over all problems and tolerances."""
    rows = []
    for method in CONTROLLED:
        ratios = np.array([r["error"] / r["tolerance"] for r in _long_ticks(results, method)])
        shares = [f"{np.mean(ratios <= bound):.0%}" for bound in (1.0, 10.0, 100.0)]
        rows.append([method, *shares])
    heads = ["method", "error ≤ tolerance", "≤ 10 tolerances", "≤ 100 tolerances"]
    return table(heads, rows)


def _long_ticks(results: Results, method: str) -> list[dict[str, Any]]:
    """Runs in which error control, not the tick, set the sub-steps, and rounding did not."""
    return [
        r
        for r in results["controlled"]
        if (r["method"], r["tick_s"]) == (method, TICKS[1])
        and r["error"]
        and r["tolerance"] >= ROUNDING
    ]


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
    """Delivered error of DOP853 by problem and tolerance."""
    rows = []
    for name in _names(results):
        errors = {
            (r["tick_s"], r["tolerance"]): r["error"]
            for r in _of(results["controlled"], name)
            if r["method"] == "dop853"
        }
        short = [error for (tick, _), error in errors.items() if tick == TICKS[0]]
        rows.append(
            [
                name,
                _error(None if None in short else max(short)) if short else "—",
                *(_error(errors[TICKS[1], tolerance]) for tolerance in TOLERANCES),
            ]
        )
    heads = ["problem", "any, ticks of 1 ms", *(number(t, 1) for t in TOLERANCES)]
    return table(heads, rows)


def _span(values: Iterable[float]) -> str:
    numbers = sorted(values)
    if not numbers:
        return "—"
    middle = float(np.median(numbers))
    return f"{_round(numbers[0])} … **{_round(middle)}** … {_round(numbers[-1])}"


def _round(value: float) -> str:
    """One digit; whole numbers are written out up to a thousand."""
    if 1.0 <= value < 1000.0:
        return f"{float(f'{value:.0e}'):.0f}"
    return number(value, 1) if value < 1.0 else f"{value:.0e}".replace("e+0", "e")


def _error(value: float | None) -> str:
    return "lost" if value is None else number(value, 2)
