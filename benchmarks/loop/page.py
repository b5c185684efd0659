# SPDX-License-Identifier: Apache-2.0
"""The report of the loop: promises, tables, a figure, and all numbers as JSON."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from arm_sim.figures import figure
from benchmarks.reporting.markdown import table

KINDS = ("inverse", "forward", "terms")
Record = dict[str, Any]


def promises(r: Record) -> list[tuple[str, str, str, bool]]:
    """What must hold: text, bound, measured, whether it does."""
    loop, service, lock = r["loop"], r["services"], r["lockstep"]
    rate = loop["loop"]["ticks"] / loop["loop"]["elapsed"]
    missed, bare = loop["loop"]["missed"], loop["thread"]["missed"]
    trip, ping = loop["round_trip"]["p50"], r["ping"]["p50"]
    apart = min(run["rate"] for run in lock["across"])
    alone = min(run["rate"] for run in lock["compiled"])
    same = len({run["digest"] for run in [*lock["across"], *lock["alone"]]}) == 1
    again = len({run["digest"] for run in lock["compiled"]}) == 1
    big = min(service["batches"][name]["100000"] for name in ("inverse", "forward"))
    share = loop["share"]["sim"]
    empty = service["bare"]["p50"]
    asked = service["p50"] / empty
    core = min(r["core"][name] for name in ("inverse", "forward"))
    shown = f"{1e3 * trip:.3f} ms, {trip / ping:.2f} of {1e3 * ping:.2f} ms"
    return [
        ("Rate of the closed loop of three processes", "1000.0 ± 0.1 Hz", f"{rate:.3f} Hz",
         abs(rate - 1000.0) <= 0.1),
        ("Missed deadlines, relative to an empty thread in the same run", "≤ 2 ×",
         f"{missed} and {bare} of {loop['loop']['ticks']:,}", missed <= 2 * max(bare, 1)),
        ("Processor share of the sim node", "≤ 15 %", f"{100 * share:.1f} %", share <= 0.15),
        ("Torque round trip, median", "≤ 0.35 ms and ≤ 0.4 of a bare ping-pong", shown,
         trip <= 0.35e-3 and trip <= 0.4 * ping),
        ("Inverse-dynamics service, median", "≤ 0.5 ms and ≤ 0.5 of an empty rclpy service",
         f"{1e3 * service['p50']:.3f} ms, {asked:.2f} of {1e3 * empty:.3f} ms",
         service["p50"] <= 0.5e-3 and asked <= 0.5),
        ("Batches in Python, inverse and forward dynamics", "≥ 500 000 points/s",
         f"{core:,.0f} points/s", core >= 5e5),
        ("Batches through the service, inverse and forward dynamics", "≥ 200 000 points/s",
         f"{big:,.0f} points/s", big >= 2e5),
        ("Lockstep across processes", "≥ 2000 cycles/s", f"{apart:,.0f} cycles/s", apart >= 2000),
        ("Lockstep in one process, compiled controller", "≥ 50 000 cycles/s",
         f"{alone:,.0f} cycles/s", alone >= 5e4),
        (f"States of two runs of {lock['ticks']:,} cycles across processes and two in one process",
         "identical to the bit", "identical" if same else "different", same),
        (f"States of two runs of {lock['compiled ticks']:,} cycles with the compiled controller",
         "identical to the bit", "identical" if again else "different", again),
    ]  # fmt: skip


def page(r: Record) -> str:
    """The report in Markdown, without a heading of its own."""
    loop, services = r["loop"], r["services"]
    rows = [(text, bound, got, "yes" if holds else "**no**")
            for text, bound, got, holds in promises(r)]  # fmt: skip
    times = [(text, *(f"{1e3 * spread[name]:.3f}" for name in ("p50", "p99", "max")))
             for text, spread in (
        ("lateness of the sim node", loop["loop"]["lateness"]),
        ("lateness of an empty thread in the same run", loop["thread"]),
        ("torque round trip: state from `sim`, torque from `controller`", loop["round_trip"]),
        ("bare ping-pong", r["ping"]),
        ("inverse dynamics of one point", services),
        ("empty rclpy service, default settings, in alternation with it", services["bare"]),
    )]  # fmt: skip
    used = loop["share"] | {"empty thread": loop["thread"]["share"], "timer": r["timer"]["share"]}
    shares = ", ".join(f"{name} {100 * value:.1f} %" for name, value in used.items())
    return "\n\n".join([
        f"{loop['seconds']:.0f} s of closed loop, priority {loop['priority']}, load average "
        f"{r['load'][0]:.1f} at the start and {r['load'][1]:.1f} at the end.",
        table(("requirement", "limit", "measured", "met"), rows),
        table(("", "p50 [ms]", "p99 [ms]", "max [ms]"), times),
        f"Processor shares: {shares}.",
        "Batches, in points per second:",
        table(("", "inverse dynamics", "forward dynamics", "terms"), _batches(r)),
    ]) + "\n"  # fmt: skip


def _batches(r: Record) -> list[tuple[str, ...]]:
    served, core = r["services"]["batches"], r["core"]
    rows = [(f"through the service, {int(points):,} points a call",
             *(_count(served[name].get(points)) for name in KINDS))
            for points in served["inverse"]]  # fmt: skip
    return [*rows, ("in Python", *(_count(core[name]) for name in KINDS))]


def write(r: Record, out: Path) -> Path:
    """Write loop.json, loop.md and the figure."""
    (out / "figures").mkdir(parents=True, exist_ok=True)
    (out / "loop.json").write_text(json.dumps(r, indent=1) + "\n")
    draw(r, out / "figures/loop.png")
    path = out / "loop.md"
    path.write_text("# The loop over ROS\n\n" + page(r))
    return path


def _count(value: float | None) -> str:
    return "—" if value is None else f"{value:,.0f}"


def draw(record: dict[str, Any], file: Path) -> None:
    """Draw the share of cycles that started later than a time, against that time."""
    loop = record["loop"]
    with figure(file, 1, 1, (6.4, 3.6)) as axis:
        for label, bars in (
            ("sim node, loop closed across three processes", loop["loop"]["bars"]),
            ("empty thread at the same time", loop["thread"]["bars"]),
        ):
            late, share = _later_than(bars)
            axis.step(1e6 * late, share, where="post", label=label)
        axis.axvline(1000.0, color="0.4", lw=0.9, ls="--", label="one cycle")
        axis.set(xscale="log", yscale="log", xlabel="lateness [µs]",
                 ylabel="share of cycles that are later")  # fmt: skip


def _later_than(bars: Sequence[Sequence[float]]) -> tuple[np.ndarray, np.ndarray]:
    late, counts = np.array(bars, float).T
    total = counts.sum()
    return np.maximum(late, 1e-6), (total - np.cumsum(counts) + counts) / total
