# SPDX-License-Identifier: Apache-2.0
"""``./arm compare``: compare one or two scenes with a recording."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from arm_sim.cli.output import console, examples, number, progress_on_stderr, show, table

if TYPE_CHECKING:
    import numpy as np
    from rich.table import Table

    from arm_studies.identification import Comparison

_PATH = click.Path(path_type=Path)


@click.command(
    epilog=examples(
        "./arm compare panda run.mcap",
        "./arm compare panda bag_of_my_robot identified.yaml --figure before_and_after.png",
        "./arm compare ur10 bag.db3 identified.yaml --last 0.3 --json",
    )
)
@click.argument("scene")
@click.argument("recording", type=_PATH)
@click.argument("scene2", required=False, metavar="[SCENE2]")
@click.option("--band", type=click.FloatRange(0.0, min_open=True),
              help="Cut-off of the low-pass filter in Hz.  [default: from the noise]")  # fmt: skip
@click.option("--window", default=0.25, show_default=True,
              type=click.FloatRange(0.0, min_open=True),
              help="Duration of each simulated window in s.")  # fmt: skip
@click.option("--last", default=1.0, show_default=True,
              type=click.FloatRange(0.0, 1.0, min_open=True),
              help="Use only this fraction of the recording, counted from its end.")  # fmt: skip
@click.option("--topic", help="Topic of the joint states, if a bag has several.")
@click.option("--map", "names", multiple=True, metavar="JOINT=NAME",
              help="Name of a joint in the recording; may be repeated.")  # fmt: skip
@click.option("--figure", type=_PATH, help="Figure to write (.png, .pdf or .svg).")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def compare(
    scene: str, recording: Path, scene2: str | None, band: float | None, window: float,
    last: float, topic: str | None, names: tuple[str, ...], figure: Path | None, as_json: bool,
) -> None:  # fmt: skip
    """Compare SCENE, and optionally SCENE2, with a RECORDING of the arm.

    Torque error: measured torques minus the inverse dynamics of the measured motion, both filtered
    by the same low-pass. Free run: position error at the end of short simulations that start at
    measured states and apply the measured torques. Accepts every recording that ./arm plot
    accepts.
    """
    from arm_studies.identification import compare as set_beside
    from arm_studies.identification.files import read_joint_record

    called = dict(_pair(word) for word in names)
    record = read_joint_record(recording, topic)
    scenes = [name for name in (scene, scene2) if name is not None]
    with progress_on_stderr():
        found = []
        for name in scenes:
            click.echo(f"comparing {name} with {recording.name} …", err=True)
            found.append(
                set_beside(name, record, band=band, window=window, last=last, names=called)
            )
    if figure is not None:
        from arm_studies.cli.comparison_figure import draw

        draw(found, scenes, figure)
    if as_json:
        result = {"recording": str(recording), "scenes": [
            _result(name, made) for name, made in zip(scenes, found, strict=True)]}  # fmt: skip
        click.echo(json.dumps(result))
        return
    _show(scenes, found)
    if figure is not None:
        console().print(f"{figure}", markup=False)


def _pair(word: str) -> tuple[str, str]:
    joint, equals, name = word.partition("=")
    if not (joint and equals and name):
        raise click.UsageError(f"--map: '{word}'; JOINT=NAME is expected")
    return joint, name


def _result(name: str, made: Comparison) -> dict[str, Any]:
    run = made.free_run
    free = None if run is None else {
        "window": run.window, "windows": run.count, "diverged": run.lost,
        "error": _named(made, run.error), "relative": _named(made, run.relative),
    }  # fmt: skip
    return {
        "scene": name, "band": made.band, "torque_error": _named(made, made.error),
        "relative": _named(made, made.relative), "relative_of_all": made.whole,
        "free_run": free, "notes": [*made.notes, *([made.why_not] if made.why_not else [])],
    }  # fmt: skip


def _named(made: Comparison, values: np.ndarray) -> dict[str, float | None]:
    """Values by joint; None for NaN, which JSON cannot represent."""
    pairs = zip(made.joint_names, values.tolist(), strict=True)
    return {name: value if math.isfinite(value) else None for name, value in pairs}


def _show(scenes: list[str], found: list[Comparison]) -> None:
    out, first = console(), found[0]
    marks = [""] if len(found) == 1 else ["before ", "after "]
    for mark, name in zip(marks, scenes, strict=True):
        out.print(f"{mark}{name}", markup=False)
    show(out, _errors(found, marks))
    for made, mark in zip(found, marks, strict=True):
        if made.free_run is None:
            out.print(f"{mark}no free run: {made.why_not}", markup=False)
        elif made.free_run.lost:
            run = made.free_run
            out.print(f"{mark}{run.lost} of {run.count} windows diverged", markup=False)
    if first.free_run is not None:
        out.print(f"free run: {first.free_run.count} windows of {first.free_run.window:.3g} s",
                  markup=False)  # fmt: skip
    out.print(f"low-pass filter {first.band:.3g} Hz", markup=False)
    for note in first.notes:
        out.print(f"note: {note}", markup=False)


def _errors(found: list[Comparison], marks: list[str]) -> Table:
    """Errors of each joint, and of all."""
    first, free = found[0], [made.free_run for made in found]
    columns = ["joint", "torque\nrms", *(f"{mark}error\nrms" for mark in marks)]
    columns += [f"{mark}relative\nerror" for mark in marks]
    if all(run is not None for run in free):
        columns += ["motion in\na window"] + [f"{mark}free\nrun error" for mark in marks]
    rows = []
    for i, joint in enumerate(first.joint_names):
        row = [joint, number(first.torque[i], 4)]
        row += [number(made.error[i], 3) for made in found]
        row += [_percent(made.relative[i]) for made in found]
        if all(run is not None for run in free):
            row += [number(free[0].moved[i], 3)] + [number(run.error[i], 2) for run in free]
        rows.append(row)
    rows.append(["all", number(math.hypot(*first.torque), 4),
                 *(number(math.hypot(*made.error), 3) for made in found),
                 *(_percent(made.whole) for made in found),
                 *([""] * (len(columns) - 2 - 2 * len(found)))])  # fmt: skip
    return table(columns, rows)


def _percent(share: float) -> str:
    return f"{100.0 * share:.2f} %" if math.isfinite(share) else "-"
