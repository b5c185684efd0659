# SPDX-License-Identifier: Apache-2.0
"""The results as JSON, as Markdown with figures, and for the terminal."""

import math
from pathlib import Path

from rich.table import Table

from benchmarks.comparison import figures
from benchmarks.comparison.claims import MET, MISSED, OPEN
from benchmarks.peers.base import OURS
from benchmarks.reporting.markdown import duration, number, quantity, table
from benchmarks.studies.bench import Record

METHOD = """\
Times are processor times of one thread unless a line says otherwise. All measurements of a table
are interleaved (every job once, then every job again), medians are shown, and ratios are between
numbers of the same run; those of claims are computed round by round, so that a slow second affects
both sides. The interval contains their median with 95 % confidence for any distribution (order
statistics, at least six rounds). A claim is met if the whole interval is below the limit, missed
if it is above, and open if it contains the limit. All simulators read the same URDF (without
limits, friction, meshes or contacts), and features that such a scene does not need are switched
off."""
TRUTHS = """\
Error is the largest |q − truth| [rad] of any joint: at the end of a free motion from rest, over
all ticks of a controlled one. Truth of a free motion is Gragg extrapolation of order 14 in
extended precision on dynamics written apart; of a controlled one, order 8 on Pinocchio in each
tick. Both are checked by halving the step and by another method."""
TITLES = {
    "model_agreement": "The same arm everywhere: largest relative difference to Pinocchio",
    "work_precision": "Run time against error, every point",
    "cost": "Cost of one step and of one evaluation, also by number of joints",
    "features": "What a scene does not need costs nothing: one RK4 step of the Panda",
    "closed_chain": "A four-bar linkage that turns freely for a second",
    "rollouts": "Many arms at once: steps of 1 ms, 50 in a call, every state kept",
    "energy": "Largest energy error of a free, frictionless arm up to a time",
    "startup": "From scene to first step, a fresh process each",
}
CLAIMS = ("claim", "measured", "95 % interval", "at most", "")
_COLOURS = {MET: "[green]", MISSED: "[red]", OPEN: "[yellow]"}


def write(results: Record, out: Path) -> Path:
    """Write ``report.md`` and the figures."""
    path = out / "report.md"
    path.write_text(markdown(results, figures.draw(results, out)))
    return path


def summary(results: Record) -> Table:
    """The claims and their measurements, for the terminal."""
    shown = Table(*CLAIMS)
    for *cells, verdict in claims(results):
        shown.add_row(*cells, _COLOURS.get(verdict, "") + verdict)
    return shown


def markdown(results: Record, pictures: dict[str, str]) -> str:
    parts = ["# Run time against error", about(results), METHOD, "## Claims",
             table(CLAIMS, claims(results))]  # fmt: skip
    if "work_precision" in results:
        parts += ["## Time to a given error", TRUTHS, targets(results)]
    for name, title in TITLES.items():
        if name in results:
            mine = [file for key, file in pictures.items() if key.split(":")[0] == name]
            links = [f"![{file[:-4].replace('_', ' ')}]({file})" for file in mine]
            parts += [f"## {title}", *links, tables(results[name])]
    return "\n\n".join(part for part in parts if part) + "\n"


def about(results: Record) -> str:
    about = results["about"]
    noise = about["noise"]
    lines = [
        f"- {about['date']}, {about['processor']}, {about['compiler']}",
        "- " + ", ".join(f"{k} {v}" for k, v in about["versions"].items()),
        f"- {about['repeats']} repeats, {about['elapsed_s'] / 60:.1f} min"
        + (", quick" if about["quick"] else ""),
        f"- machine noise: the same arithmetic, timed {noise['probes']} times in between, varied "
        f"by {noise['spread_10_90']:.1%} (10th to 90th percentile); load average "
        f"{noise['load_min']:.1f} to {noise['load_max']:.1f}",
    ]
    lines += [f"- left out, not installed: {name}" for name in about["left_out"]]
    lines += [f"- {name}: {note}" for name, note in about["notes"].items()]
    return "\n".join(lines)


def claims(results: Record) -> list[tuple[str, ...]]:
    """The claims and their measurements, in the columns ``CLAIMS``."""
    return [
        (c["text"], quantity(c["value"], c["unit"]), interval(c), quantity(c["limit"], c["unit"]),
         c["verdict"])
        for c in results["claims"]
    ]  # fmt: skip


def interval(claim: Record) -> str:
    """The confidence interval of a claim; empty if it is not a time or was measured once."""
    if claim["value"] is None or claim["between"] is None:
        return ""
    if not all(map(math.isfinite, claim["between"])):
        return "too few rounds"
    return " to ".join(quantity(end, claim["unit"]) for end in claim["between"])


def targets(results: Record) -> str:
    families = list(dict.fromkeys(t["family"] for t in results["targets"]))
    cell: dict[tuple[object, ...], str] = {}
    for t in results["targets"]:
        best = f"{duration(t['cpu_s'])} ({t['method']})" if t["cpu_s"] else "not reached"
        ratio = f", **{t['ratio']:.3g}×**" if t["ratio"] and t["family"] != OURS else ""
        cell[t["robot"], t["scenario"], t["target_rad"], t["family"]] = best + ratio
    keys = dict.fromkeys((t["robot"], t["scenario"], t["target_rad"]) for t in results["targets"])
    rows = [(k[0], k[1], f"{k[2]:g}", *(cell[(*k, f)] for f in families)) for k in keys]
    text = "Cheapest way to an error (joined points, log–log), and how many times ours it takes:"
    return text + "\n\n" + table(("robot", "motion", "error [rad]", *families), rows)


def tables(results: Record) -> str:
    """Every list of rows of a study as a table, without the rounds."""
    parts = []
    for rows in results.values():
        if isinstance(rows, list) and rows and isinstance(rows[0], dict):
            flat = [_flat(row) for row in rows]
            parts.append(table(list(flat[0]), ([*map(_cell, row.values())] for row in flat)))
    return "\n\n".join(parts)


def _flat(row: Record) -> Record:
    flat: Record = {}
    for key, value in row.items():
        if isinstance(value, dict):
            flat |= {f"{key} {inner}": entry for inner, entry in value.items()}
        elif not isinstance(value, list):
            flat[key] = value
    return flat


def _cell(value: object) -> str:
    return number(value) if isinstance(value, float) or value is None else str(value)
