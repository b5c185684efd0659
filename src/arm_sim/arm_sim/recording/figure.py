# SPDX-License-Identifier: Apache-2.0
"""Figures of recordings."""

from __future__ import annotations

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
_LINES = ("-", "--", ":", "-.")
_POINTS = 4000  # points of a line; more than a figure has pixel columns
_MARKS = 40  # largest number of events drawn
_APART = 5e-3  # of the range of a panel: curves that are closer to each other coincide
_ENERGY = "energy [J]"
_ACCOUNT = ("T, kinetic", "V, potential", "T + V", "work", "heat", "residual")
_ENERGY_COLORS = (*figures.COLORS[:2], "#000000", *figures.COLORS[2:])
NO_WINDOW = "no window: Matplotlib has no display"
LONG = 60_001  # rows up to which the energy account repeats ticks for curves

type _Curve = tuple[str, Array, str]  # label, values, colour

_log = logging.getLogger(__name__)


def draw(recordings: Sequence[RecordedMotion], joints: Sequence[str]) -> Any:
    """See ``Recording.plot``."""
    import matplotlib as mpl
    from matplotlib import pyplot

    names, first = _joints(recordings, joints), recordings[0]
    words, panels = figures.joint_words(names), dict[str, list[list[_Curve]]]()
    drawn = [*zip(names, words, cycle(figures.COLORS), strict=False)]
    types = ("revolute", "prismatic") if first.physics is None else first.plant.model.joint_types
    for part, (attribute, *unit) in QUANTITIES.items():
        arrays: list[Array] = [getattr(one, attribute) for one in recordings]
        shown = {
            name for one, array in zip(recordings, arrays, strict=True) for name in names
            if part == "position" or np.nan_to_num(array[:, one.joint_names.index(name)]).any()
        }  # fmt: skip
        if shown:
            panels[f"{part} [{figures.units(types, *unit)}]"] = [
                [
                    (word, array[:, one.joint_names.index(name)], color)
                    for name, word, color in drawn
                    if name in shown
                ]
                for one, array in zip(recordings, arrays, strict=True)
            ]
    if any(energies := _energies(recordings)):
        panels[_ENERGY] = energies
    pyplot.draw_if_interactive()  # loads the backend, which may set rcParams to stay
    with mpl.rc_context(figures.STYLE | {"axes.xmargin": 0.0}):
        figure, axes = pyplot.subplots(
            len(panels), 1, sharex=True, squeeze=False, layout="constrained",
            figsize=(figures.WIDTH, 1.7 * len(panels) + 0.5),
        )  # fmt: skip
        for axis, (title, of_each) in zip(axes[:, 0], panels.items(), strict=True):
            for recording, curves, line in zip(recordings, of_each, cycle(_LINES), strict=False):
                for label, values, color in curves:
                    curve = thinned(recording.time, values[:, None], _POINTS)
                    axis.plot(*curve, line, color=color, label=label if line == "-" else None)
            axis.set_ylabel(title)
            _marks(axis, first)
        for i, line in enumerate(_LINES[: len(recordings)] if len(recordings) > 1 else (), 1):
            axes[0, 0].plot([], [], line, color="0.4", label=f"recording {i}")
        if _ENERGY in panels:
            axes[-1, 0].legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=6)
        figures.legend_outside(figure)
        axes[-1, 0].set(xlabel="time [s]")
        figure.align_ylabels()
    if pyplot.get_backend().lower() == "agg":  # it would show nothing, without a word
        figure.canvas.manager.show = lambda: _log.warning(
            "%s; the figure's savefig('motion.png') writes a file", NO_WINDOW
        )
    return figures.shown_once(figure, figure)


def _joints(recordings: Sequence[RecordedMotion], requested: Sequence[str]) -> list[str]:
    """Joints to draw: the requested ones, else all that every recording has."""
    for other in recordings:
        if not isinstance(other, RecordedMotion):
            raise InvalidInput(f"plot: {other!r} is no recording; plot(joints=[…]) chooses joints")
        if not len(other):
            raise InvalidInput("plot: a recording without states has nothing to draw")
    if isinstance(requested, str):
        raise InvalidInput(f"joints = '{requested}'; a list of names is expected, ['{requested}']")
    shared = [
        name for name in recordings[0].joint_names
        if all(name in recording.joint_names for recording in recordings)
    ]  # fmt: skip
    if not shared:
        joints = "; ".join(known_names(recording.joint_names, 8) for recording in recordings)
        raise InvalidInput(f"the recordings share no joint: {joints}")
    if unknown := [name for name in requested if name not in shared]:
        allowed = choices(unknown[0], shared)
        raise InvalidInput(f"unknown joint {known_names(unknown)}; allowed: {allowed}")
    if requested:
        return list(requested)
    columns = [recordings[0].joint_names.index(name) for name in shared]
    return [shared[i] for i in figures.most_moved(recordings[0].q[:, columns])]


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


def _energies(recordings: Sequence[RecordedMotion]) -> list[list[_Curve]]:
    """Energies of each: none that is zero in all, and one for those that coincide in all.

    Potential energies are counted from the least of all recordings; NaN where unknown.
    """
    rows = np.hstack([_account(one) for one in recordings])
    rows[1:3] -= np.min(rows[1], where=~np.isnan(rows[1]), initial=np.inf)
    numbers, curves = np.nan_to_num(rows), list[_Curve]()
    apart = _APART * np.ptp(numbers, axis=1).max()
    rest = [i for i in range(len(rows)) if abs(numbers[i]).max() > apart]
    while rest:
        alike = [i for i in rest if abs(numbers[i] - numbers[rest[0]]).max() <= apart]
        label = " = ".join(_ACCOUNT[i] for i in alike)
        curves.append((label, rows[rest[0]], _ENERGY_COLORS[rest[0]]))
        rest = [i for i in rest if i not in alike]
    ends = np.cumsum([len(one) for one in recordings]).tolist()
    return [
        [(label, values[end - len(one) : end], color) for label, values, color in curves]
        for one, end in zip(recordings, ends, strict=True)
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
