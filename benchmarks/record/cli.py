# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.record``: what is promised of recordings, measured."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import click

from arm_sim.cli.interrupts import interruptible
from benchmarks.record import again, overhead
from benchmarks.reporting.markdown import table

MB = 1e6


@click.command()
@click.option(
    "--seconds", type=float, default=600.0, show_default=True, help="Duration of the loops."
)
@click.option("--viewed", is_flag=True, help="Let a browser follow the recorded loop.")
@click.option(
    "--replayed", type=float, default=600.0, show_default=True, help="Seconds to replay."
)
@click.option("--out", type=click.Path(path_type=Path), help="JSON file for the results.")
def main(seconds: float, viewed: bool, replayed: float, out: Path | None) -> None:
    """Record a closed loop beside one that is not, and replay a long motion."""
    with tempfile.TemporaryDirectory() as name:
        folder, found = Path(name), dict[str, Any]()
        if replayed:
            path = folder / "long.mcap"
            found["again"] = again.record(replayed, path) | again.replay(path)
            path.unlink()
        if seconds:
            with interruptible():
                found["overhead"] = overhead.measure(seconds, folder, viewed)
    click.echo(table(("", "promised", "measured", "holds"), promises(found)))
    if out is not None:
        out.write_text(json.dumps(found, indent=1))


def promises(found: dict[str, Any]) -> list[tuple[str, str, str, str]]:
    """What must hold, and whether it does."""
    rows: list[tuple[str, str, str, bool]] = []
    if (long := found.get("again")) is not None:
        text = f"{long['ticks']:,} ticks with contact, dry friction, another load, pushes"
        rows.append((f"Replay of {text}", "equal to the bit", long["said"], long["equal"]))
    if (r := found.get("overhead")) is not None:
        rows += _overhead(r)
    return [(text, bound, got, "yes" if holds else "**no**") for text, bound, got, holds in rows]


def _overhead(r: dict[str, Any]) -> list[tuple[str, str, str, bool]]:
    mine, other, told = r["with"], r["without"], r["with"]["recording"]
    late, beside = (x["loop"]["lateness"]["p99"] for x in (mine, other))
    share, bare = mine["share"], other["share"]
    part = told["processor time"] / r["seconds"]
    whole = told["lost"] == 0 and r["gaps"] == 0 and r["ticks in the file"] == told["ticks"]
    return [
        ("Ticks lost", "0", f"{told['lost']} of {told['ticks']:,}, {r['gaps']} gaps", whole),
        ("Lateness p99 against a loop beside it", "≤ 1.1 ×",
         f"{1e6 * late:.0f} against {1e6 * beside:.0f} µs", late <= 1.1 * beside),
        ("Share of a core of the sim against that of the other", "≤ 1.1 ×",
         f"{100 * share:.2f} against {100 * bare:.2f} %", share <= 1.1 * bare),
        ("The recorder's thread", "≤ 5 % of a core", f"{100 * part:.2f} %", part <= 0.05),
        ("Bytes a tick", "≤ 400", f"{r['bytes a tick']:.0f}", r["bytes a tick"] <= 400),
        ("Memory gained while recording", "≤ 10 MB",
         f"{mine['memory'] / MB:.1f} MB (without {other['memory'] / MB:.1f} MB)",
         mine["memory"] <= 10 * MB),
    ]  # fmt: skip
