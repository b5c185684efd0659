# SPDX-License-Identifier: Apache-2.0
"""``./arm compare``: compare one or two scenes with a recording."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import click

from arm_dynamics.writing import warn_if_replaced
from arm_sim.cli.arguments import BagTopic, Band, Figure, Json, Pair, Pairs, Positive, Share
from arm_sim.cli.command import command
from arm_sim.cli.output import number, say, table, to_json

if TYPE_CHECKING:
    import numpy as np

    from arm_studies.identification import Comparison


@command(
    "./arm compare panda run.mcap",
    "./arm compare panda bag_of_my_robot identified.yaml --figure before_and_after.png",
    "./arm compare ur10 bag.db3 identified.yaml --last 0.3 --json",
)
def compare(
    scene: str,
    recording: Path,
    scene2: Annotated[str | None, "[SCENE2]"] = None,
    *,
    band: Band | None = None,
    window: Positive = 0.25,
    last: Share = 1.0,
    topic: BagTopic | None = None,
    names: Annotated[Pairs, "--map", Pair("JOINT=NAME")] = (),
    figure: Figure | None = None,
    as_json: Json = False,
) -> None:
    """Compare SCENE, and optionally SCENE2, with a RECORDING of the arm.

    Torque error: measured torques minus the inverse dynamics of the measured motion, both filtered
    by the same low-pass. Free run: position error at the end of short simulations that start at
    measured states and apply the measured torques. Accepts every recording that ./arm plot
    accepts.

    Args:
        window: Duration of each simulated window in s.
        last: Use only this fraction of the recording, counted from its end.
        names: Name of a joint in the recording; may be repeated.
    """
    from arm_studies import identification
    from arm_studies.identification.data import read_joint_record

    record = read_joint_record(recording, topic)
    scenes, comparisons = [name for name in (scene, scene2) if name is not None], []
    for name in scenes:
        click.echo(f"comparing {name} with {recording.name} …", err=True)
        comparison = identification.compare(
            name, record, band=band, window=window, last=last, names=dict(names)
        )
        comparisons.append(comparison)
    if figure is not None:
        from arm_studies.identification.figures import draw_comparison

        warn_if_replaced(figure)
        draw_comparison(comparisons, scenes, figure)
    if as_json:
        results = [_result(name, result) for name, result in zip(scenes, comparisons, strict=True)]
        click.echo(to_json({"recording": recording, "scenes": results}))
        return
    marks = ["before ", "after "] if scene2 is not None else [""]
    say(*map("".join, zip(marks, scenes, strict=True)))
    marked = dict(zip(marks, comparisons, strict=True))
    columns = _columns(marked)
    say(table(list(columns), zip(*columns.values(), strict=True)), *_remarks(marked))
    if figure is not None:
        say(figure)


def _result(name: str, result: Comparison) -> dict[str, Any]:
    """The content of a scene's comparison as JSON."""

    def named(values: np.ndarray) -> dict[str, float]:
        return dict(zip(result.joint_names, values, strict=True))

    run = result.free_run
    free = None if run is None else {
        "window": run.window, "windows": run.count, "diverged": run.diverged,
        "error": named(run.error), "relative": named(run.relative),
    }  # fmt: skip
    return {
        "scene": name, "band": result.band, "torque_error": named(result.error),
        "relative": named(result.relative), "relative_of_all": result.whole,
        "free_run": free, "notes": [*result.notes, *([result.why_not] if result.why_not else [])],
    }  # fmt: skip


def _columns(marked: dict[str, Comparison]) -> dict[str, list[str]]:
    """Columns of the table by heading: a row for each joint, and one for all.

    Args:
        marked: Comparisons by what distinguishes them in headings.
    """
    first = next(iter(marked.values()))
    columns = {"joint": [*first.joint_names, "all"], "torque\nrms": _of_all(first.torque, 4)}
    columns |= {f"{mark}error\nrms": _of_all(result.error, 3) for mark, result in marked.items()}
    for mark, result in marked.items():
        shares = (*result.relative, result.whole)
        columns[f"{mark}relative\nerror"] = [
            f"{100.0 * share:.2f} %" if math.isfinite(share) else "-" for share in shares
        ]
    runs = [
        (mark, result.free_run) for mark, result in marked.items() if result.free_run is not None
    ]
    if len(runs) == len(marked):
        columns["motion in\na window"] = [*(number(x, 3) for x in runs[0][1].moved), ""]
        for mark, run in runs:
            columns[f"{mark}free\nrun error"] = [*(number(x, 2) for x in run.error), ""]
    return columns


def _remarks(marked: dict[str, Comparison]) -> Iterator[str]:
    """What the table does not say: simulations that are missing or diverged, the filter, notes."""
    first = next(iter(marked.values()))
    for mark, result in marked.items():
        run = result.free_run
        if run is None:
            yield f"{mark}no free run: {result.why_not}"
        elif run.diverged:
            yield f"{mark}{run.diverged} of {run.count} windows diverged"
    if first.free_run is not None:
        yield f"free run: {first.free_run.count} windows of {first.free_run.window:.3g} s"
    yield f"low-pass filter {first.band:.3g} Hz"
    yield from (f"note: {note}" for note in first.notes)


def _of_all(values: np.ndarray, digits: int) -> list[str]:
    """A number for each joint, and for all."""
    return [number(x, digits) for x in (*values, math.hypot(*values))]
