# SPDX-License-Identifier: Apache-2.0
"""``./arm identify``: identify the parameters of a scene from recordings."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from arm_dynamics.exceptions import InvalidInput
from arm_sim.cli.output import console, examples, number, progress_on_stderr, show, table

if TYPE_CHECKING:
    from arm_studies.identification import Identification, JointRecord

_PATH = click.Path(path_type=Path)


@click.command(
    epilog=examples(
        "./arm identify run.mcap --scene panda --out my_panda.yaml",
        "./arm identify bag_1 bag_2 --scene ur10 --effort scale --out my_ur10.yaml",
        "./arm identify table.csv --scene arm.urdf --out arm.yaml --map shoulder=axis_1",
        "./arm identify run.mcap --scene my_panda.yaml --payload panda_hand --out holding.yaml",
    )
)
@click.argument("recordings", type=_PATH, nargs=-1, required=True, metavar="RECORDING…")
@click.option("--scene", required=True,
              help="Nominal scene: geometry, and first guess of the inertias.")  # fmt: skip
@click.option("--out", type=_PATH, required=True,
              help="Scene to write (.yaml), with its URDF and a report beside it.")  # fmt: skip
@click.option("--band", type=click.FloatRange(0.0, min_open=True),
              help="Cut-off of the low-pass filter in Hz.  [default: from the noise]")  # fmt: skip
@click.option("--effort", type=click.Choice(["torque", "scale"]), default="torque",
              show_default=True,
              help="Recorded efforts are torques, or proportional to torques with an unknown "
              "scale per joint.")  # fmt: skip
@click.option("--per-unit", "units", multiple=True, metavar="JOINT=TORQUE",
              help="Torque per unit of effort, as N m/A; once for every joint.")  # fmt: skip
@click.option("--map", "names", multiple=True, metavar="JOINT=NAME",
              help="Name of a joint in the recordings; may be repeated.")  # fmt: skip
@click.option("--total-mass", type=click.FloatRange(0.0, min_open=True),
              help="Known mass of all moving links in kg, without payloads.")  # fmt: skip
@click.option("--mass", "masses", multiple=True, metavar="JOINT=KG",
              help="Known mass of the link that a joint moves; may be repeated.")  # fmt: skip
@click.option("--payload", metavar="FRAME",
              help="Identify only the payload on this frame of a known arm.")  # fmt: skip
@click.option("--accept-worse", is_flag=True,
              help="Write the scene even if it predicts the held-out part of the recordings worse "
              "than the nominal scene does.")  # fmt: skip
@click.option("--topic", help="Topic of the joint states, if a bag has several.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def identify(
    recordings: tuple[Path, ...], scene: str, out: Path, band: float | None, effort: str,
    units: tuple[str, ...], names: tuple[str, ...], total_mass: float | None,
    masses: tuple[str, ...], payload: str | None, accept_worse: bool, topic: str | None,
    as_json: bool,
) -> None:  # fmt: skip
    """Identify masses, inertias and friction of an arm from RECORDINGs of motion and torque.

    Writes the scene OUT and, beside it, its URDF, a report and figures. Writes nothing if the
    recordings do not determine the parameters, or the nominal scene predicts them better. Accepts
    every recording that ./arm plot accepts.
    """
    if out.suffix not in (".yaml", ".yml"):
        raise InvalidInput(f"--out is '{out}'; a name that ends in .yaml is expected")
    if payload is not None:
        _refuse_for_payload(effort != "torque" or units or total_mass or masses)
        records = _records(recordings, topic)
        _carried(records, scene, payload, out, band, _pairs("--map", names), as_json)
        return
    from arm_studies.identification import identify as find
    from arm_studies.identification.report import write

    per_unit = _pairs("--per-unit", units)
    with progress_on_stderr():
        found = find(
            scene, _records(recordings, topic), band=band,
            effort=_numbers("--per-unit", per_unit) or effort,
            names=_pairs("--map", names), total_mass=total_mass,
            masses=_numbers("--mass", _pairs("--mass", masses)), accept_worse=accept_worse,
            told=lambda text: click.echo(f"{text} …", err=True),
        )  # fmt: skip
        click.echo("writing the scene, the report and the figures …", err=True)
        files = write(found, out, [path.name for path in recordings])
    if as_json:
        click.echo(json.dumps(_result(found, files)))
        return
    _show(found)
    _show_files(files)


def _refuse_for_payload(given: object) -> None:
    if given:
        raise InvalidInput(
            "--payload needs a known arm and efforts in N m; --effort, --per-unit, "
            "--total-mass and --mass are not allowed with it"
        )


def _show_files(files: list[Path]) -> None:
    for path in files:
        console().print(f"{path}", markup=False)


def _records(recordings: tuple[Path, ...], topic: str | None) -> list[JointRecord]:
    from arm_studies.identification.files import read_joint_record

    return [read_joint_record(path, topic) for path in recordings]


def _carried(
    records: list[JointRecord], scene: str, frame: str, out: Path, band: float | None,
    names: dict[str, str], as_json: bool,
) -> None:  # fmt: skip
    """Identify only the payload, and write the scene with it."""
    from arm_dynamics import load_scene
    from arm_studies.identification import estimate_payload
    from arm_studies.identification.report import write_scene

    arm = load_scene(scene)
    with progress_on_stderr():
        found = estimate_payload(
            arm, records, frame, band=band, names=names,
            told=lambda text: click.echo(f"note: {text}", err=True),
        )  # fmt: skip
    rows = [
        [name, number(value, 4), unit, "{:.4g} to {:.4g}".format(*found.intervals[name])
         if name in found.intervals else "",
         "the motion does not determine it" if name in found.missing
         else "scatter, not 95 %" if name in found.scatter else ""]
        for name, value, unit in found.rows()
    ]  # fmt: skip
    head = "".join(f"# {' '.join(filter(None, row))}\n" for row in rows)
    head = f"# Payload on {frame}, with 95 % intervals:\n{head}"
    carrying = arm.model_copy(update={"payloads": (*arm.payloads, found.payload)})
    files = write_scene(carrying, out, head)
    if as_json:
        click.echo(json.dumps({
            "files": [*map(str, files)], "payload": found.payload.model_dump(mode="json"),
            "intervals": dict(found.intervals), "scatter": sorted(found.scatter),
            "missing": found.missing,
        }))  # fmt: skip
        return
    console().print(f"payload on {frame}", markup=False)
    show(console(), table(["", "value", "", "95 % interval", ""], rows, text=(0, 2, 3, 4)))
    _show_files(files)


def _pairs(option: str, given: tuple[str, ...]) -> dict[str, str]:
    pairs = [text.partition("=") for text in given]
    for name, sign, value in pairs:
        if not (name and sign and value):
            raise InvalidInput(f"{option} is '{name}{sign}{value}'; NAME=VALUE is expected")
    return {name: value for name, _, value in pairs}


def _numbers(option: str, pairs: dict[str, str]) -> dict[str, float]:
    found = {}
    for name, text in pairs.items():
        try:
            found[name] = float(text)
        except ValueError:
            raise InvalidInput(f"{option}: '{name}={text}'; a number is expected") from None
    return found


def _result(found: Identification, files: list[Path]) -> dict[str, Any]:
    return {
        "files": [str(path) for path in files], "band": found.band,
        "error": _known(found.error[0]), "nominal_error": _known(found.error[1]),
        "torque_error": {name: _known(x) for name, x in found.torque_error.items()},
        "parameters": dict(found.parameters), "intervals": dict(found.intervals),
        "scatter": sorted(found.scatter),
        "written": dict(found.written), "missing": dict(found.missing), "notes": list(found.notes),
        "scales": dict(zip(found.joint_names, found.scales.tolist(), strict=True)),
    }  # fmt: skip


def _known(error: float) -> float | None:
    """An error, or null in place of NaN, which JSON does not have."""
    return None if math.isnan(error) else error


def _show(found: Identification) -> None:
    from arm_studies.identification.report import joint_rows, share

    out = console()
    columns = ["joint", "nominal\nerror", "error", "residual\nrms", "friction"]
    show(out, table(columns, joint_rows(found, 1), text=(0, 4)))
    count = len(found.parameters.keys() - found.missing.keys())
    out.print(
        f"torque error on held-out data: {share(found.error[0], 2)}, nominal "
        f"{share(found.error[1], 2)}; "
        f"low-pass filter {found.band:.3g} Hz; condition number {found.condition:.3g}; "
        f"{count} parameters identified, {len(found.missing)} not",
        markup=False,
    )
    if found.scatter:
        whose = len(found.scatter & (found.parameters.keys() - found.missing.keys()))
        out.print(
            f"intervals of {whose} of these are scatter, not 95 %: errors of the model, not "
            "noise, cause most of their width",
            markup=False,
        )
    for note in found.notes:
        out.print(f"note: {note}", markup=False)
