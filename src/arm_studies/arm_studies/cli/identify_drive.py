# SPDX-License-Identifier: Apache-2.0
"""``./arm identify-drive``: identify a motor, a flexible joint or LuGre friction."""

from pathlib import Path
from typing import Any

import click

from arm_sim.cli.arguments import File, Json
from arm_sim.cli.command import command
from arm_sim.cli.output import number, say, table, to_json


@command(
    "./arm identify-drive --blocked held.csv --free run.csv --coast off.csv",
    "./arm identify-drive --flexible knocked.csv",
    "./arm identify-drive --bristles small.csv --bristles wide.csv --json",
)
def identify_drive(
    *,
    blocked: tuple[File, ...] = (),
    free: tuple[File, ...] = (),
    coast: tuple[File, ...] = (),
    flexible: File | None = None,
    bristles: tuple[File, ...] = (),
    as_json: Json = False,
) -> None:
    """Identify the parameters of a drive from simple tests.

    Records are tables (.csv) with a header: time in s at a constant step, voltage in V, current in
    A, speed of the rotor in rad/s, torque in N m, and the angles motor, link and position in rad.
    --blocked, --free, --coast and --bristles may be repeated.
    Exits with status 1 if the model does not fit the records.

    Args:
        blocked: Motor, blocked: time, voltage, current; torque if measured.
        free: Motor, running freely: time, voltage, current, speed.
        coast: Motor, winding open: time, speed; voltage if measured.
        flexible: Flexible joint: time, torque, motor; link unless it is held.
        bristles: LuGre friction, from small motions: time, torque, position.
    """
    motor = {"blocked": blocked, "free": free, "coast": coast}
    if any(motor.values()) + (flexible is not None) + bool(bristles) != 1:
        raise click.UsageError(
            "exactly one kind of test is expected: of a motor (--blocked, --free, --coast), "
            "--flexible, or --bristles"
        )
    from arm_studies.identification import drives

    click.echo("fitting …", err=True)
    if flexible is not None:
        test = _read(flexible, ("torque", "motor", "link"), needed=("torque", "motor"))
        drive, units = drives.identify_joint(drives.JointTest.of(**test)), drives.JOINT_UNITS
    elif bristles:
        both = "torque", "position"
        tests = [drives.SmallMotion.of(**_read(path, both, needed=both)) for path in bristles]
        drive, units = drives.identify_bristles(tests), drives.BRISTLE_UNITS
    else:
        columns = ("voltage", "current", "speed", "torque")
        records = [
            drives.MotorRecord.of(kind, **_read(path, columns))
            for kind, paths in motor.items()
            for path in paths
        ]
        drive, units = drives.identify_motor(records), drives.MOTOR_UNITS
    estimates = {name: e for name, e in drive.estimates.items() if e.determined}
    if as_json:
        parameters = {
            name: {"value": e.value, "interval": e.interval, "unit": units[name]}
            for name, e in estimates.items()
        }
        facts = {"follows": drive.follows, "residual": drive.residual, "missing": drive.missing}
        click.echo(to_json(facts | {"parameters": parameters}))
    else:
        rows = [(name, number(e.value, 6), f"± {number(e.interval, 2)}", units[name])
                for name, e in estimates.items()]  # fmt: skip
        if rows:
            say(table(("", "value", "95 %", "unit"), rows, text=(0, 3)))
        say(f"residual: {drive.residual:.2%} of the variation of the records")
        if not drive.follows:
            say(
                "the model does not fit the records: the residual is not noise, so no parameter "
                "is identified (wrong columns or units, another friction model, or another kind "
                "of test?)"
            )
        elif drive.missing:
            say(f"not determined by these records: {', '.join(drive.missing)}")
    if not drive.follows:
        raise click.exceptions.Exit(1)


def _read(path: Path, allowed: tuple[str, ...], needed: tuple[str, ...] = ()) -> dict[str, Any]:
    """Columns of a table by name, without those that it does not have, and the table's name."""
    from arm_sim.recording.files.table import Table

    table = Table.read(path)
    if unknown := [name for name in table.names if name not in ("time", *allowed)]:
        raise click.ClickException(
            f"'{path}': unknown column '{unknown[0]}'; allowed: time, {', '.join(allowed)}"
        )
    for name in ("time", *needed):
        if name not in table.names:
            raise click.ClickException(
                f"'{path}' has no column '{name}'; it has {', '.join(table.names)}"
            )
    for note in table.notes:
        click.echo(f"note: '{path}': {note}", err=True)
    numbers = {name: table.numbers(i) for i, name in enumerate(table.names) if name != "time"}
    return numbers | {"time": table.times(table.names.index("time")), "name": str(path)}
