# SPDX-License-Identifier: Apache-2.0
"""``./arm identify-drive``: identify a motor, a flexible joint or LuGre friction."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from arm_sim.cli.output import console, examples, number, show, table

if TYPE_CHECKING:
    from arm_studies.identification.drives import Match

_FILE = click.Path(dir_okay=False, path_type=Path)


@click.command(
    "identify-drive",
    epilog=examples(
        "./arm identify-drive --blocked held.csv --free run.csv --coast off.csv",
        "./arm identify-drive --flexible knocked.csv",
        "./arm identify-drive --bristles small.csv --bristles wide.csv --json",
    ),
)
@click.option("--blocked", multiple=True, type=_FILE,
              help="Motor, blocked: time, voltage, current; torque if measured.")  # fmt: skip
@click.option("--free", multiple=True, type=_FILE,
              help="Motor, running freely: time, voltage, current, speed.")  # fmt: skip
@click.option("--coast", multiple=True, type=_FILE,
              help="Motor, winding open: time, speed; voltage if measured.")  # fmt: skip
@click.option("--flexible", type=_FILE,
              help="Flexible joint: time, torque, motor; link unless it is held.")  # fmt: skip
@click.option("--bristles", multiple=True, type=_FILE,
              help="LuGre friction, from small motions: time, torque, position.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def identify_drive(
    blocked: tuple[Path, ...], free: tuple[Path, ...], coast: tuple[Path, ...],
    flexible: Path | None, bristles: tuple[Path, ...], as_json: bool,
) -> None:  # fmt: skip
    """Identify the parameters of a drive from simple tests.

    Records are tables (.csv) with a header: time in s at a constant step, voltage in V, current in
    A, speed of the rotor in rad/s, torque in N m, and the angles motor, link and position in rad.
    --blocked, --free, --coast and --bristles may be repeated.
    Exits with status 1 if the model does not fit the records.
    """
    motor = {"blocked": blocked, "free": free, "coast": coast}
    kinds = [any(motor.values()), flexible is not None, bool(bristles)]
    if sum(kinds) != 1:
        raise click.UsageError(
            "exactly one kind of test is expected: of a motor (--blocked, --free, --coast), "
            "--flexible, or --bristles"
        )
    click.echo("fitting …", err=True)
    if kinds[0]:
        found, units = _motor(motor)
    elif flexible is not None:
        found, units = _flexible(flexible)
    else:
        found, units = _bristles(bristles)
    if as_json:
        click.echo(json.dumps(_result(found, units)))
    else:
        _show(found, units)
    if not found.follows:
        raise click.exceptions.Exit(1)


def _motor(files: dict[str, tuple[Path, ...]]) -> tuple[Match, dict[str, str]]:
    from arm_studies.identification.drives import MOTOR_UNITS, MotorRecord, identify_motor

    columns = ("voltage", "current", "speed", "torque")
    records = []
    for kind, paths in files.items():
        for path in paths:
            read = _read(path, columns)
            time = read.pop("time")
            records.append(MotorRecord.of(kind, time, **read, name=str(path)))  # type: ignore[arg-type]
    return identify_motor(records), MOTOR_UNITS


def _flexible(path: Path) -> tuple[Match, dict[str, str]]:
    from arm_studies.identification.drives import JOINT_UNITS, JointTest, identify_joint

    read = _read(path, ("torque", "motor", "link"), needed=("torque", "motor"))
    record = JointTest.of(read["time"], read["torque"], read["motor"], read.get("link"), str(path))
    return identify_joint(record), JOINT_UNITS


def _bristles(paths: tuple[Path, ...]) -> tuple[Match, dict[str, str]]:
    from arm_studies.identification.drives import BRISTLE_UNITS, SmallMotion, identify_bristles

    records = []
    for path in paths:
        read = _read(path, ("torque", "position"), needed=("torque", "position"))
        records.append(SmallMotion.of(read["time"], read["torque"], read["position"], str(path)))
    return identify_bristles(records), BRISTLE_UNITS


def _read(path: Path, known: tuple[str, ...], needed: tuple[str, ...] = ()) -> dict[str, Any]:
    """Columns of a table by name, without those that it does not have."""
    from arm_sim.recording.files.table import Table

    table = Table.read(path)
    if unknown := [name for name in table.names if name not in ("time", *known)]:
        raise click.ClickException(
            f"'{path}': unknown column '{unknown[0]}'; allowed: time, {', '.join(known)}"
        )
    for name in ("time", *needed):
        if name not in table.names:
            raise click.ClickException(
                f"'{path}' has no column '{name}'; it has {', '.join(table.names)}"
            )
    read = {name: table.numbers(i) for i, name in enumerate(table.names) if name != "time"}
    read["time"] = table.times(table.names.index("time"))
    for note in table.notes:
        click.echo(f"note: '{path}': {note}", err=True)
    return read


def _result(found: Match, units: dict[str, str]) -> dict[str, Any]:
    return {
        "follows": found.follows, "residual": found.residual, "missing": found.missing,
        "parameters": {
            name: {"value": e.value, "interval": e.interval, "unit": units[name]}
            for name, e in found.estimates.items() if e.found
        },
    }  # fmt: skip


def _show(found: Match, units: dict[str, str]) -> None:
    out = console()
    rows = [
        (name, number(e.value, 6), f"± {number(e.interval, 2)}", units[name])
        for name, e in found.estimates.items()
        if e.found
    ]
    if rows:
        show(out, table(("", "value", "95 %", "unit"), rows, text=(0, 3)))
    out.print(f"residual: {found.residual:.2%} of the variation of the records", markup=False)
    if not found.follows:
        out.print(
            "the model does not fit the records: the residual is not noise, so no parameter is "
            "identified (wrong columns or units, another friction model, or another kind of test?)"
        )
    elif found.missing:
        out.print(f"not determined by these records: {', '.join(found.missing)}", markup=False)
