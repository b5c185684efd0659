# SPDX-License-Identifier: Apache-2.0
"""The sections of the Markdown report, one function each."""

from __future__ import annotations

import math
from collections.abc import Callable

from benchmarks.comparison.claims import MISSED
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


def markdown(results: Record, pictures: dict[str, str]) -> str:
    """The whole report.

    Args:
        results: of all studies that ran.
        pictures: file names of the figures, by study.
    """
    parts = ["# Run time against error", about(results), METHOD, "## Claims", claims(results)]
    for name, (title, section) in SECTIONS.items():
        if name in results:
            parts += [f"## {title}", section(results), figures(pictures, name)]
    if "work_precision" in results:
        parts += ["## Time to a given error", targets(results), truths(results)]
        parts += ["## Every point of run time against error", points(results)]
    return "\n\n".join(part for part in parts if part) + "\n"


def figures(pictures: dict[str, str], study: str, folder: str = "") -> str:
    """Links to the figures of a study."""
    mine = [file for key, file in pictures.items() if key.split(":")[0] == study]
    return "\n\n".join(f"![{file[:-4].replace('_', ' ')}]({folder}{file})" for file in mine)


def about(results: Record) -> str:
    """Machine, versions, duration and noise."""
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


def claims(results: Record) -> str:
    """The claims and their measurements."""
    rows = [
        (c["text"], quantity(c["value"], c["unit"]), interval(c), quantity(c["limit"], c["unit"]),
         "**missed**" if c["verdict"] == MISSED else c["verdict"])
        for c in results["claims"]
    ]  # fmt: skip
    return table(("claim", "measured", "95 % interval", "at most", ""), rows)


def interval(claim: Record) -> str:
    """The confidence interval of a claim; empty if it is not a time or was measured once."""
    if claim["value"] is None or claim["between"] is None:
        return ""
    if not all(map(math.isfinite, claim["between"])):
        return "too few rounds"
    return " to ".join(quantity(end, claim["unit"]) for end in claim["between"])


def _model_agreement(results: Record) -> str:
    rows = results["model_agreement"]["rows"]
    robots = list(dict.fromkeys(r["robot"] for r in rows))
    worst: dict[tuple[str, str], float] = {}
    for r in rows:
        key = r["family"], r["robot"]
        worst[key] = max(worst.get(key, 0.0), r["relative"])
    body = [(family, *(number(worst[family, robot], 2) for robot in robots))
            for family in dict.fromkeys(r["family"] for r in rows)]  # fmt: skip
    text = (
        f"Largest relative difference in acceleration to Pinocchio, all methods, "
        f"{results['model_agreement']['states']} random states."
    )
    return f"{text}\n\n" + table(("", *robots), body)


def _work_precision(results: Record) -> str:
    return "\n\n".join([truths(results), targets(results)])


def truths(results: Record) -> str:
    """How good the truths are."""
    rows = [
        (t["robot"], t["scenario"], f"{t['duration_s']:g} s", number(t["halving_rad"], 2),
         number(t["other_method_rad"], 2))
        for t in results["work_precision"]["truth"]
    ]  # fmt: skip
    text = (
        "Error is the largest |q − truth| [rad] of any joint: at the end of a free motion from "
        "rest, over all ticks of a controlled one. Truth of a free motion is Gragg extrapolation "
        "of order 14 in extended precision on dynamics written apart; of a controlled one, order "
        "8 on Pinocchio in each tick. Both are checked by halving the step and by another method."
    )
    head = ("robot", "motion", "duration", "step halved [rad]", "other method [rad]")
    return text + "\n\n" + table(head, rows)


def targets(results: Record) -> str:
    """What an error costs with each simulator."""
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


def points(results: Record) -> str:
    """Every measured point."""
    rows = [
        (p["robot"], p["scenario"], f"{p['family']} {p['method']}",
         duration(p["setting"]) if p["knob"] == "step" else f"{p['setting']:g}",
         number(p["error_rad"], 2) if p["error_rad"] is not None else "lost",
         duration(p["cpu_s"]))
        for p in results["work_precision"]["points"]
    ]  # fmt: skip
    head = ("robot", "motion", "method", "step or tolerance", "error [rad]", "processor time")
    return table(head, rows)


def _cost(results: Record) -> str:
    rows = [(r["robot"], r["what"], r["who"], number(r["ns"])) for r in results["cost"]["rows"]]
    growth = results["cost"]["growth"]
    joints = list(dict.fromkeys(g["joints"] for g in growth))
    value = {(g["who"], g["joints"]): number(g["ns"]) for g in growth}
    body = [(who, *(value[who, n] for n in joints))
            for who in dict.fromkeys(g["who"] for g in growth)]  # fmt: skip
    return "\n\n".join([
        table(("robot", "", "who", "ns"), rows),
        "Nanoseconds against number of joints of the chain:",
        table(("joints", *map(str, joints)), body),
    ])  # fmt: skip


def _features(results: Record) -> str:
    rows = results["features"]["rows"]
    first = rows[0]
    body = [
        (r["scene"], number(r["operations"], 5), number(r["ns"]),
         f"{r['operations'] - first['operations']:+d}", f"{r['ns'] - first['ns']:+.0f}")
        for r in rows
    ]  # fmt: skip
    head = ("scene", "operations a step", "ns a step", "Δ operations", "Δ ns")
    text = "One RK4 step of the Panda; every line but the last changes the first in one thing."
    return f"{text}\n\n" + table(head, body)


def _closed_chain(results: Record) -> str:
    found = results["closed_chain"]
    body = [(r["who"], number(r["ns"]), number(r["ns"] / r["step"] * 1e-6),
             f"{r['error']:.1e}") for r in found["rows"]]  # fmt: skip
    head = ("who", "ns a step", "ms a simulated second", "error after 1 s [rad]")
    text = (
        "A four-bar linkage that turns freely, 1 rad being the angle of its crank. Pinocchio's "
        f"`constraintDynamics`, one evaluation: {number(found['pinocchio_ns'])} ns (from Python, "
        "less what the binding takes of a call, which `aba` shows); RK4 takes four."
    )
    return f"{text}\n\n" + table(head, body)


def _mechanisms(results: Record) -> str:
    rows = results["mechanisms"]["rows"]
    body = [(r["task"], r["who"], duration(r["seconds"]), f"{r['error']:.1e}") for r in rows]
    text = (
        "Problems of IFToMM's library of computational benchmark problems, by their names there: "
        "the least time with which each reaches the error."
    )
    return f"{text}\n\n" + table(("problem", "who", "time", "error"), body)


def _rollouts(results: Record) -> str:
    rows = results["rollouts"]["rows"]
    most = max(r["threads"] for r in rows)
    return "\n\n".join([
        "Steps of 1 ms, 50 in a call, every state kept, torques of its own for each arm. Thousand "
        "arm-steps per second of one core, by the number of arms in the call:",
        _rates([r for r in rows if r["threads"] == 1], "arm_steps_per_s_per_core"),
        f"The same in wall time on {most} threads:",
        _rates([r for r in rows if r["threads"] == most], "arm_steps_per_s"),
    ])  # fmt: skip


def _rates(rows: list[Record], key: str) -> str:
    arms = list(dict.fromkeys(r["arms"] for r in rows))
    value = {(r["robot"], r["who"], r["arms"]): number(r[key] / 1e3) for r in rows}
    body = [(*k, *(value.get((*k, a), "") for a in arms))
            for k in dict.fromkeys((r["robot"], r["who"]) for r in rows)]  # fmt: skip
    return table(("robot", "who", *map(str, arms)), body)


def _energy(results: Record) -> str:
    rows = results["energy"]["rows"]
    horizons = sorted({r["horizon_s"] for r in rows})
    value = {(r["who"], r["setting"], r["horizon_s"]): r for r in rows}

    def cell(who: str, setting: float, horizon: float) -> str:
        row = value.get((who, setting, horizon))
        if row is None:
            return "too slow"
        return "lost" if row["drift_J"] is None else number(row["drift_J"], 2)

    keys = dict.fromkeys((r["who"], r["knob"], r["setting"]) for r in rows)
    body = [(k[0], f"{k[1]} {k[2]:g}", *(cell(k[0], k[2], h) for h in horizons)) for k in keys]
    text = (
        f"Largest energy error [J] of the free, frictionless {results['energy']['robot']} up to a "
        f"time; the motion turns over about {results['energy']['scale_J']:.0f} J."
    )
    head = ("who", "step [s] or tolerance", *(f"{h:g} s" for h in horizons))
    return f"{text}\n\n" + table(head, body)


def _startup(results: Record) -> str:
    rows = results["startup"]["rows"]
    body = []
    for r in rows:
        cold, warm = r["cold_s"], r["cached_s"]
        total = "total without imports"
        body.append(
            (r["robot"], r["joints"], duration(cold[total]), duration(warm[total]),
             duration(cold["processor"] - warm["processor"]),
             duration(warm["load_scene"]), duration(warm["Simulator"]),
             duration(warm["first step"]), duration(warm["imports"]),
             f"{r['compiled_bytes'] / 1024:.0f} KiB")
        )  # fmt: skip
    head = ("robot", "joints", "cold", "cached", "compiling", "load_scene", "Simulator",
            "first step", "imports", "compiled code")  # fmt: skip
    text = (
        "Wall time from scene to first step, a fresh process each; what writing and "
        "compiling the equations adds in processor time; parts of the cached start."
    )
    return f"{text}\n\n" + table(head, body)


SECTIONS: dict[str, tuple[str, Callable[[Record], str]]] = {
    "model_agreement": ("The same arm everywhere", _model_agreement),
    "work_precision": ("Run time against error", _work_precision),
    "cost": ("Cost of one step and of one evaluation", _cost),
    "features": ("What a scene does not need costs nothing", _features),
    "closed_chain": ("A closed chain", _closed_chain),
    "mechanisms": ("Mechanisms", _mechanisms),
    "rollouts": ("Many arms at once", _rollouts),
    "energy": ("Energy drift", _energy),
    "startup": ("Start-up", _startup),
}
