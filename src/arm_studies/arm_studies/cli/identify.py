# SPDX-License-Identifier: Apache-2.0
"""``./arm identify``: identify the parameters of a scene from recordings."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import click

from arm_dynamics.exceptions import InvalidInput
from arm_sim.cli.arguments import BagTopic, Band, Json, Pair, Pairs, Positive, YamlFile
from arm_sim.cli.command import command
from arm_sim.cli.output import number, say, table, to_json

if TYPE_CHECKING:
    from arm_studies.identification import Identification, JointRecord, PayloadEstimate

# Attributes of an identification that the option --json prints under their names.
REPORTED = ("parameters", "intervals", "scatter", "written", "missing", "notes")


@command(
    "./arm identify run.mcap --scene panda --out my_panda.yaml",
    "./arm identify bag_1 bag_2 --scene ur10 --effort scale --out my_ur10.yaml",
    "./arm identify table.csv --scene arm.urdf --out arm.yaml --map shoulder=axis_1",
    "./arm identify run.mcap --scene my_panda.yaml --payload panda_hand --out holding.yaml",
)
def identify(
    recordings: Annotated[tuple[Path, ...], "RECORDING…"],
    *,
    scene: str,
    out: YamlFile,
    band: Band | None = None,
    effort: Literal["torque", "scale"] = "torque",
    units: Annotated[Pairs, "--per-unit", Pair("JOINT=TORQUE", float)] = (),
    names: Annotated[Pairs, "--map", Pair("JOINT=NAME")] = (),
    total_mass: Positive | None = None,
    masses: Annotated[Pairs, "--mass", Pair("JOINT=KG", float)] = (),
    payload: Annotated[str | None, "--payload FRAME"] = None,
    accept_worse: bool = False,
    topic: BagTopic | None = None,
    as_json: Json = False,
) -> None:
    """Identify masses, inertias and friction of an arm from RECORDINGs of motion and torque.

    Writes the scene OUT and, beside it, its URDF, a report and figures. Writes nothing if the
    recordings do not determine the parameters, or the nominal scene predicts them better. Accepts
    every recording that ./arm plot accepts.

    Args:
        scene: Nominal scene: geometry, and first guess of the inertias.
        out: Scene to write (.yaml), with its URDF and a report beside it.
        effort: Recorded efforts are torques, or proportional to torques with an unknown scale per
            joint.
        units: Torque per unit of effort, as N m/A; once for every joint.
        names: Name of a joint in the recordings; may be repeated.
        total_mass: Known mass of all moving links in kg, without payloads.
        masses: Known mass of the link that a joint moves; may be repeated.
        payload: Identify only the payload on this frame of a known arm.
        accept_worse: Write the scene even if it predicts the held-out part of the recordings worse
            than the nominal scene does.
    """
    if payload is not None and (effort != "torque" or units or total_mass or masses):
        raise InvalidInput(
            "--payload needs a known arm and efforts in N m; --effort, --per-unit, "
            "--total-mass and --mass are not allowed with it"
        )
    if units and effort != "torque":
        raise InvalidInput("--effort scale and --per-unit are given; one of them is expected")
    from arm_studies import identification
    from arm_studies.identification.data import read_joint_record
    from arm_studies.identification.report import write

    records = [read_joint_record(path, topic) for path in recordings]
    if payload is not None:
        facts, lines, files = _payload(records, scene, payload, out, band, dict(names))
    else:
        result = identification.identify(
            scene, records, band=band, effort=dict(units) or effort, names=dict(names),
            total_mass=total_mass, masses=dict(masses), accept_worse=accept_worse,
            on_progress=lambda step: click.echo(f"{step} …", err=True),
        )  # fmt: skip
        click.echo("writing the scene, the report and the figures …", err=True)
        files = write(result, out, [path.name for path in recordings])
        facts = {
            "band": result.band, "error": result.error.identified,
            "nominal_error": result.error.nominal, "torque_error": result.torque_error,
            **{name: getattr(result, name) for name in REPORTED},
            "scales": {joint.name: joint.scale for joint in result.joints},
        }  # fmt: skip
        lines = _lines(result)
    if as_json:
        click.echo(to_json({"files": files, **facts}))
    else:
        say(*lines)
        say(*files)


def _payload(
    records: list[JointRecord], scene: str, frame: str, out: Path, band: float | None,
    names: Mapping[str, str],
) -> tuple[dict[str, Any], list[Any], list[Path]]:  # fmt: skip
    """Identify only the payload, and write the scene: facts, lines to print, and files."""
    from arm_dynamics import load_scene
    from arm_studies.identification import estimate_payload
    from arm_studies.identification.report import write_scene

    arm = load_scene(scene)
    estimate = estimate_payload(
        arm, records, frame, band=band, names=names,
        on_note=lambda text: click.echo(f"note: {text}", err=True),
    )  # fmt: skip
    rows = _payload_rows(estimate)
    head = "".join(f"# {' '.join(filter(None, row))}\n" for row in rows)
    head = f"# Payload on {frame}, with 95 % intervals:\n{head}"
    carrying = arm.model_copy(update={"payloads": (*arm.payloads, estimate.payload)})
    files = write_scene(carrying, out, head)
    columns = ["", "value", "", "95 % interval", ""]
    lines = [f"payload on {frame}", table(columns, rows, text=(0, 2, 3, 4))]
    facts = {
        "payload": estimate.payload.model_dump(mode="json"), "intervals": estimate.intervals,
        "scatter": estimate.scatter, "missing": estimate.missing,
    }  # fmt: skip
    return facts, lines, files


def _payload_rows(estimate: PayloadEstimate) -> list[list[str]]:
    """Of each number of a payload: name, value, unit, interval, and a remark."""
    remarks = dict.fromkeys(estimate.scatter, "scatter, not 95 %")
    remarks |= dict.fromkeys(estimate.missing, "the motion does not determine it")
    rows = []
    for name, value, unit in estimate.rows():
        interval = None if name in estimate.missing else estimate.intervals.get(name)
        span = "{:.4g} to {:.4g}".format(*interval) if interval else ""
        rows.append([name, number(value, 4), unit, span, remarks.get(name, "")])
    return rows


def _lines(result: Identification) -> list[Any]:
    """A table and lines about an identification, to print."""
    from arm_studies.identification.report import joint_rows, share

    columns = ["joint", "nominal\nerror", "error", "residual\nrms", "friction"]
    identified = result.parameters.keys() - result.missing.keys()
    lines = [
        f"torque error on held-out data: {share(result.error.identified, 2)}, nominal "
        f"{share(result.error.nominal, 2)}; "
        f"low-pass filter {result.band:.3g} Hz; condition number {result.condition:.3g}; "
        f"{len(identified)} parameters identified, {len(result.missing)} not"
    ]
    if result.scatter:
        lines.append(
            f"intervals of {len(result.scatter & identified)} of these are scatter, not 95 %: "
            "errors of the model, not noise, cause most of their width"
        )
    notes = [f"note: {note}" for note in result.notes]
    return [table(columns, joint_rows(result, 1), text=(0, 4)), *lines, *notes]
