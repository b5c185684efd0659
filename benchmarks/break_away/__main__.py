# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.break_away``."""

from __future__ import annotations

import sys

import click

from benchmarks.break_away.measure import WITHIN, Result, results
from benchmarks.break_away.sets import FAMILIES
from benchmarks.reporting.markdown import table


@click.command()
@click.option("--count", default=200, show_default=True, help="Number of sets.")
@click.option("--seed", default=0, show_default=True, help="Of the first scene.")
@click.option("--loads", default=5, show_default=True, help="Sets with the same scene.")
def main(count: int, seed: int, loads: int) -> None:
    """Compare break-away loads of random indeterminate sets with linear programs.

    Ends with an error if one is further off than a millionth, or has no motion beyond it.
    """
    found = [result for _, result in zip(range(count), results(seed, loads), strict=False)]
    rows = [row(family.__name__, found) for family in FAMILIES]
    head = ("sets", "number", "largest error", "of Dynamics", "wrong")
    click.echo(table(head, rows))
    wrong = [result for result in found if not result.good]
    for result in wrong:
        click.echo(f"wrong: {result}", err=True)
    sys.exit(1 if wrong else 0)


def row(kind: str, found: list[Result]) -> tuple[str, ...]:
    """One family as a row of the table; errors are relative to the limit."""
    own = [result for result in found if result.kind == kind]
    alone = [result.of_dynamics for result in own if result.of_dynamics is not None]
    return (
        kind,
        str(len(own)),
        f"{max((result.error for result in own), default=0.0):.0e}",
        f"{max(alone):.0e}" if alone else "",
        f"{sum(not result.good for result in own)} (beyond {WITHIN:.0e})",
    )


main(prog_name="python -m benchmarks.break_away")
