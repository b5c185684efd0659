# SPDX-License-Identifier: Apache-2.0
"""Figures of recordings."""

import logging
from collections.abc import Sequence
from itertools import cycle, pairwise
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput, choices, known_names
from arm_sim import figures
from arm_sim.recording.motion import RecordedMotion

# Of joints: attribute of a recording, and units of revolute and of prismatic ones
QUANTITIES = {
    "position": ("q", "rad", "m"), "velocity": ("v", "rad/s", "m/s"), "effort": ("tau", "N m", "N")
}  # fmt: skip
_LINES = ("-", "--", ":", "-.")  # of recordings; further ones have them again, thinner
_POINTS = 4000  # points of a line; more than a figure has pixel columns
_MARKS = 40  # largest number of events drawn
_COINCIDENCE = 5e-3  # of the range of a panel: curves that are closer to each other coincide
_ENERGY = "energy [J]"
_ACCOUNT = ("T, kinetic", "V, potential", "T + V", "work", "heat", "residual")
# Olive, wine, black, grey, indigo and sand (Tol, Colour Schemes): no joint but the seventh has one
_ENERGY_COLORS = "#999933", "#882255", "#000000", "0.6", "#332288", "#DDCC77"
NO_WINDOW = "no window: Matplotlib has no display"
LONG = 60_001  # rows up to which the energy account repeats ticks for curves

type _Curve = tuple[str, Array, str]  # label, values of all recordings, colour

_log = logging.getLogger(__name__)


def draw(recordings: Sequence[RecordedMotion], joints: Sequence[str]) -> Any:
    """See ``Recording.plot``."""
    import matplotlib as mpl
    from matplotlib import pyplot

    panels = _panels(recordings, _joints(recordings, joints))
    pyplot.draw_if_interactive()  # loads the backend, which may set rcParams to stay
    with mpl.rc_context(figures.STYLE | {"axes.xmargin": 0.0}):
        figure, axes = pyplot.subplots(
            len(panels), 1, sharex=True, squeeze=False, layout="constrained",
            figsize=(figures.WIDTH, 1.7 * len(panels) + 0.5),
        )  # fmt: skip
        ends = np.cumsum([len(one) for one in recordings])[:-1]
        width = mpl.rcParams["lines.linewidth"]
        styles = [
            {"ls": _LINES[i % len(_LINES)], "lw": width / (1 + i // len(_LINES))}
            for i in range(len(recordings))
        ]
        for axis, (title, curves) in zip(axes[:, 0], panels.items(), strict=True):
            for label, values, color in curves:
                own = np.split(values[:, None], ends)
                for i, (recording, y) in enumerate(zip(recordings, own, strict=True)):
                    curve = thinned(recording.time, y, _POINTS)
                    axis.plot(*curve, color=color, label=None if i else label, **styles[i])
            axis.set_ylabel(title)
            _marks(axis, recordings[0])
        for i, style in enumerate(styles if len(styles) > 1 else (), 1):
            axes[0, 0].plot([], [], color="0.4", label=f"recording {i}", **style)
        if _ENERGY in panels:
            axes[-1, 0].legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=6)
        figures.legend_outside(figure)
        axes[-1, 0].set(xlabel="time [s]")
        figure.align_ylabels()
    if pyplot.get_backend().lower() == "agg":  # it would show nothing, without a word
        figure.canvas.manager.show = lambda: _log.warning(
            "%s; the figure's savefig('motion.png') writes a file", NO_WINDOW
        )
    return figures.show_once(figure, figure)


def _panels(recordings: Sequence[RecordedMotion], names: Sequence[str]) -> dict[str, list[_Curve]]:
    """Curves by the titles of their panels, of which none is empty."""
    words, panels, first = figures.joint_words(names), dict[str, list[_Curve]](), recordings[0]
    types = ("revolute", "prismatic") if first.physics is None else first.plant.model.joint_types
    stacked = {
        part: np.hstack([getattr(one, attribute)[:, _columns(one, names)].T for one in recordings])
        for part, (attribute, *_) in QUANTITIES.items()
    }
    known = [np.nan_to_num(rows) for rows in stacked.values()]
    groups = _coincident(np.hstack([rows / (np.ptp(rows) or 1.0) for rows in known]), _COINCIDENCE)
    for (part, rows), numbers in zip(stacked.items(), known, strict=True):
        panels[f"{part} [{figures.units(types, *QUANTITIES[part][1:])}]"] = [
            (" = ".join(words[j] for j in group), rows[group[0]], color)
            for group, color in zip(groups, cycle(figures.COLORS), strict=False)
            if part == "position" or numbers[group].any()
        ]
    panels[_ENERGY] = _energies(recordings)
    return {title: curves for title, curves in panels.items() if curves}


def _joints(recordings: Sequence[RecordedMotion], requested: Sequence[str]) -> list[str]:
    """Joints to draw: the requested ones, else all that every recording has."""
    for other in recordings:
        if not isinstance(other, RecordedMotion):
            raise InvalidInput(f"plot: {other!r} is no recording; plot(joints=[…]) chooses joints")
        if not len(other):
            raise InvalidInput("plot: a recording without states has nothing to draw")
    if isinstance(requested, str):
        raise InvalidInput(f"joints = '{requested}'; a list of names is expected, ['{requested}']")
    names = [one.joint_names for one in recordings]
    shared = [name for name in names[0] if all(name in each for each in names)]
    if not shared:
        joints = "; ".join(known_names(each, 8) for each in names)
        raise InvalidInput(f"the recordings share no joint: {joints}")
    if unknown := [name for name in requested if name not in shared]:
        allowed = choices(unknown[0], shared)
        raise InvalidInput(f"unknown joint {known_names(unknown)}; allowed: {allowed}")
    if requested:
        return list(requested)
    moved = figures.widest_columns(recordings[0].q[:, _columns(recordings[0], shared)])
    return [shared[i] for i in moved]


def _columns(recording: RecordedMotion, names: Sequence[str]) -> list[int]:
    return [recording.joint_names.index(name) for name in names]


def _coincident(rows: Array, apart: float) -> list[list[int]]:
    """Rows in groups of those that differ by no more from the first of the group."""
    rest, groups = [*range(len(rows))], list[list[int]]()
    while rest:
        groups.append([i for i in rest if abs(rows[i] - rows[rest[0]]).max() <= apart])
        rest = [i for i in rest if i not in groups[-1]]
    return groups


def thinned(time: Array, values: Array, points: int) -> tuple[Array, Array]:
    """Curves with fewer points, which keep their extrema and their end.

    Of every interval of time each curve keeps its minimum and its maximum, in order.

    Args:
        time: Shape (k,).
        values: Shape (k, m).
        points: Largest number of points that remain.

    Returns:
        Times and values.
    """
    if len(time) <= points:
        return time, values
    edges = np.linspace(0, len(time), (points + 1) // 2).astype(int)
    columns, times, rows = np.arange(values.shape[1]), [], []
    for a, b in pairwise(edges):
        part, unknown = values[a:b], np.isnan(values[a:b])
        least = np.where(unknown, np.inf, part).argmin(axis=0)
        ends = np.sort([least, np.where(unknown, -np.inf, part).argmax(axis=0)], axis=0)
        times += [time[a], time[(a + b) // 2]]
        rows += list(part[ends, columns])
    return np.array([*times, time[-1]]), np.array([*rows, values[-1]])


def _energies(recordings: Sequence[RecordedMotion]) -> list[_Curve]:
    """Energies: none that is zero in all recordings, and one for those that coincide in all.

    Potential energies are counted from the least of all recordings; NaN where unknown.
    """
    rows = np.hstack([*map(_account, recordings)])
    rows[1:3] -= np.min(rows[1], where=~np.isnan(rows[1]), initial=np.inf)
    numbers = np.nan_to_num(rows)
    apart = _COINCIDENCE * np.ptp(numbers, axis=1).max()
    kept = np.flatnonzero(abs(numbers).max(axis=1) > apart)
    groups = [kept[group] for group in _coincident(numbers[kept], apart)]
    return [
        (" = ".join(_ACCOUNT[i] for i in group), rows[group[0]], _ENERGY_COLORS[group[0]])
        for group in groups
    ]


def _account(recording: RecordedMotion) -> Array:
    """Rows of ``_ACCOUNT``, NaN where they are unknown, or work and heat take long to compute."""
    rows = np.full((len(_ACCOUNT), len(recording)), np.nan)
    if recording.of_robot or recording.origin is None:
        return rows
    rest = recording.energy - recording.kinetic
    rows[:3] = recording.kinetic, rest, recording.kinetic + rest
    if not recording.account.repeats(recording.x) or len(recording) <= LONG:
        rows[3:] = recording.supplied, recording.lost, recording.balance
    return rows


def _marks(axis: Any, recording: RecordedMotion) -> None:
    """Lines at changes, and grey areas where ticks are missing."""
    times = [recording.time[jump.row] for jump in recording.jumps]
    times += [event.time for event in recording.events]
    for time in sorted(set(times))[:_MARKS]:
        axis.axvline(time, color="0.4", lw=0.7, ls=":")
    for row in recording.gaps:
        axis.axvspan(recording.time[row - 1], recording.time[row], color="0.85", lw=0.7)
