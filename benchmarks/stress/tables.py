# SPDX-License-Identifier: Apache-2.0
"""The numbers of the report, as Markdown tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from benchmarks.reporting.markdown import table
from benchmarks.stress.survey import REFERENCE, Found
from benchmarks.stress.verdict import FORBIDDEN, OUTCOMES, SURVIVED, Result

DECADES = (1e-3, 1e-2, 1e-1, 1.0, 10.0)  # ends of the intervals of step times rate
FRICTION = ("no friction", "viscous friction", "dry friction")
ROUNDING = 1e-9  # an error below it says nothing of an estimate
Point = tuple[float, Result, bool]


def runs(found: Sequence[Found], steady: bool = False) -> list[Result]:
    """All runs of all arms that were not refused, or only of those with a steady motion."""
    return [result for one in found if one.arm and (one.motion.steady or not steady)
            for result in one.results if result.name != REFERENCE]  # fmt: skip


def survival(found: Sequence[Found]) -> str:
    """How often each method survives at each step."""
    return _by_step(runs(found), lambda some: _percent(_survived(some), some))


def errors(found: Sequence[Found]) -> str:
    """How wrong each method is at each step where it survives: median and worst."""
    steady = runs(found, steady=True)
    return _by_step(steady, lambda some: _spread(r.error for r in _survived(some)))


def energies(found: Sequence[Found]) -> str:
    """Energy from nowhere where a method survives: median and worst."""
    return _by_step(runs(found), lambda some: _spread(r.energy for r in _survived(some)))


def outcomes(found: Sequence[Found]) -> str:
    """What became of the runs of each method."""
    everything = runs(found)
    rows = []
    for name in _names(everything):
        mine = [r for r in everything if r.name == name]
        number_of = [sum(r.outcome == outcome for r in mine) for outcome in OUTCOMES]
        rows.append([name, len(mine), *number_of, sum(r.false_alarm for r in mine)])
    total = [sum(int(row[k]) for row in rows) for k in range(1, len(OUTCOMES) + 3)]
    return table(["method", "runs", *OUTCOMES, "false alarms"], [*rows, ["**all**", *total]])


def by_rate(found: Sequence[Found]) -> str:
    """Survival and error against step times rate, fixed steps."""
    points = fixed(found)
    rows = []
    for name in _names([r for _, r, _ in points]):
        mine = [point for point in points if point[1].name == name]
        rows.append([name, *(_in_decade(mine, k) for k in range(len(DECADES) + 1))])
    head = [f"< {DECADES[0]:g}", *(f"to {end:g}" for end in DECADES[1:]), f"> {DECADES[-1]:g}"]
    return table(["method", *head], rows)


def fixed(found: Sequence[Found]) -> list[Point]:
    """Runs with fixed steps of arms without dry friction.

    Returns:
        Step times rate, the run, and whether the motion is steady.
    """
    arms = [one for one in found if one.arm and not one.arm.dry and one.motion.rate > 0]
    return [(r.dt * one.motion.rate, r, one.motion.steady) for one in arms for r in one.results
            if " " not in r.name and r.name != REFERENCE]  # fmt: skip


def by_friction(found: Sequence[Found]) -> str:
    """Survival with each kind of friction."""
    rows = []
    for name in _names(runs(found)):
        row = [name]
        for kind in FRICTION:
            mine = [r for r in runs([one for one in found if one.arm and kind in one.arm.traits])
                    if r.name == name]  # fmt: skip
            false = sum(r.false_alarm for r in mine)
            row.append(_percent(_survived(mine), mine) + (f", {false} false" if false else ""))
        rows.append(row)
    return table(["method", *FRICTION], rows)


def delivered(found: Sequence[Found]) -> str:
    """Error over the tolerance asked for, and over the error that the simulator states."""
    rows = []
    steady = [r for r in runs(found, steady=True) if r.claimed is not None]
    for name in _names(steady):
        mine = [(r.error, r.claimed) for r in steady if r.name == name and r.error is not None]
        asked = [error / float(name.split()[1]) for error, _ in mine]
        stated = [error / claimed for error, claimed in mine if claimed and error > ROUNDING]
        rows.append([name, len(mine), _spread(asked), len(stated), _spread(stated)])
    above = f"of them with an error above {ROUNDING:g}"
    return table(["method", "runs", "error / tolerance", above, "error / stated error"], rows)


def wrong(found: Sequence[Found]) -> str:
    """What must not be: each by name, with the seed that repeats it."""
    bad = [(one, r) for one in found for r in one.results if r.outcome in FORBIDDEN]
    lines = [
        f"- **{r.outcome}**: seed {r.seed}, {r.name}, tick {r.dt:g} s; "
        + (", ".join(one.arm.traits) if one.arm else r.message)
        for one, r in bad
    ]
    return "\n".join(lines) or "No silent NaN and no undetected blow-up."


def refused(found: Sequence[Found]) -> str:
    """Arms that were refused at once."""
    lines = [f"- seed {one.seed}: {one.motion.message}" for one in found if not one.arm]
    return "\n".join(lines) or "No arm was refused."


def counts(found: Sequence[Found]) -> dict[str, str]:
    """Numbers for the text."""
    everything = runs(found)
    arms = [one.arm for one in found if one.arm]
    motions = [one.motion for one in found if one.motion.q is not None]
    known = [motion for motion in motions if motion.known]
    count = Counter(r.outcome for r in everything)
    return {
        "arms": str(len(found)),
        "runs": str(len(everything)),
        "joints": f"{min(arm.n for arm in arms)} to {max(arm.n for arm in arms)}",
        **{name.replace(" ", "_"): str(count[name]) for name in OUTCOMES},
        "false_alarms": str(sum(r.false_alarm for r in everything)),
        "steady": str(sum(motion.steady for motion in motions)),
        "sensitive": str(sum(not motion.steady for motion in motions)),
        "impossible": str(len(arms) - len(motions)),
        "doubt": _spread(motion.doubt for motion in known),
        "reference_balance": _spread(motion.balance for motion in motions),
        "rates": f"{min(m.rate for m in motions):.2g} to {max(m.rate for m in motions):.2g}",
    }


def _by_step(results: Sequence[Result], cell: Callable[[Sequence[Result]], str]) -> str:
    steps = sorted({r.dt for r in results}, reverse=True)
    rows = [
        [name, *(cell([r for r in results if (r.name, r.dt) == (name, dt)]) for dt in steps)]
        for name in _names(results)
    ]
    return table(["method", *(f"{dt:g} s" for dt in steps)], rows)


def _in_decade(mine: list[Point], k: int) -> str:
    low = DECADES[k - 1] if k else 0.0
    high = DECADES[k] if k < len(DECADES) else np.inf
    some = [(r, steady) for x, r, steady in mine if low <= x < high]
    good = _survived([r for r, steady in some if steady])
    share = _percent(_survived([r for r, _ in some]), [r for r, _ in some])
    return f"{share}; {_spread(r.error for r in good)}"


def _names(results: Sequence[Result]) -> list[str]:
    return list(dict.fromkeys(r.name for r in results))


def _survived(some: Sequence[Result]) -> list[Result]:
    return [r for r in some if r.outcome == SURVIVED]


def _percent(part: Sequence[Result], whole: Sequence[Result]) -> str:
    return f"{len(part) / len(whole):.0%}" if whole else "—"


def _spread(values: Iterable[float | None]) -> str:
    """Median and worst."""
    known = [value for value in values if value is not None]
    return f"{_rough(np.median(known))}, {_rough(max(known))}" if known else "—"


def _rough(value: float | np.floating) -> str:
    if value == 0:
        return "0"
    if 0.01 <= value < 1000:
        return f"{value:.2g}" if value < 10 else f"{value:.0f}"
    return f"{value:.0e}".replace("e-0", "e-").replace("e+0", "e")
