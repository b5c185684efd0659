# SPDX-License-Identifier: Apache-2.0
"""Figures of recordings."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput, choices, known_names
from arm_sim.figures import legend_at_right
from arm_sim.recording.motion import RecordedMotion
from arm_sim.recording.tables import UNITS, parts

_STYLE = {
    "axes.grid": True, "grid.alpha": 0.3, "axes.spines.top": False, "axes.spines.right": False,
    "font.size": 9.0, "lines.linewidth": 1.2,
}  # fmt: skip
_LINES = ("-", "--", ":", "-.")
_POINTS = 4000  # points of a line; more than a figure has pixel columns
_MARKS = 40  # largest number of events drawn
NO_WINDOW = "no window: Matplotlib has no display"
LONG = 60_001  # rows up to which the energy account repeats ticks for curves

_log = logging.getLogger(__name__)


def draw(recordings: Sequence[RecordedMotion], joints: Sequence[str]) -> Any:
    """See ``Recording.plot``."""
    import matplotlib as mpl
    from matplotlib import pyplot

    names, first = _joints(recordings, joints), recordings[0]
    told = any(not recording.of_robot for recording in recordings)
    panels = [part for part in ("position", "velocity", "effort") if _there(recordings, part)]
    with mpl.rc_context(_STYLE):
        figure, axes = pyplot.subplots(
            len(panels) + told, 1, sharex=True, squeeze=False, layout="constrained",
            figsize=(9.0, 2.3 * (len(panels) + told) + 0.4),
        )  # fmt: skip
        colors = mpl.colormaps["tab10" if len(names) <= 10 else "tab20"]
        for axis, part in zip(axes[:, 0], panels, strict=False):
            for recording, line in zip(recordings, _cycled(len(recordings)), strict=True):
                _joint_lines(axis, recording, part, names, colors, line)
            axis.set_ylabel(f"{part} [{_unit(first, part)}]")
        if told:
            _energy(axes[-1, 0], recordings)
        for axis in axes[:, 0]:
            _marks(axis, first)
        axes[-1, 0].set_xlabel("time [s]")
        columns = 1 if len(names) <= 10 else 2
        legend_at_right(figure, *axes[0, 0].get_legend_handles_labels(), ncols=columns)
    if pyplot.get_backend().lower() == "agg":  # it would show nothing, without a word
        figure.canvas.manager.show = lambda: _log.warning(
            "%s; the figure's savefig('motion.png') writes a file", NO_WINDOW
        )
    return figure


def _joints(recordings: Sequence[RecordedMotion], asked: Sequence[str]) -> list[str]:
    """Joints to draw: the requested ones, else all that every recording has."""
    for other in recordings:
        if not isinstance(other, RecordedMotion):
            raise InvalidInput(
                f"plot: {other!r} is no recording; joints are chosen by plot(joints=[…])"
            )
    if isinstance(asked, str):
        raise InvalidInput(f"joints = '{asked}'; a list of names is expected, ['{asked}']")
    shared = [
        name for name in recordings[0].joint_names
        if all(name in recording.joint_names for recording in recordings)
    ]  # fmt: skip
    if not shared:
        told = "; ".join(known_names(recording.joint_names, 8) for recording in recordings)
        raise InvalidInput(f"the recordings share no joint: {told}")
    if unknown := [name for name in asked if name not in shared]:
        raise InvalidInput(
            f"unknown joint {known_names(unknown)}; allowed: {choices(unknown[0], shared)}"
        )
    return list(asked) or shared


def _there(recordings: Sequence[RecordedMotion], part: str) -> bool:
    """Whether any of the recordings has a quantity."""
    return any(np.isfinite(parts(recording)[part]).any() for recording in recordings)


def _cycled(count: int) -> list[str]:
    return [_LINES[i % len(_LINES)] for i in range(count)]


def _joint_lines(
    axis: Any, recording: RecordedMotion, part: str, names: list[str], colors: Any, line: str
) -> None:
    array = parts(recording)[part]
    for i, name in enumerate(names):
        k = recording.joint_names.index(name)
        label = name if line == _LINES[0] else None
        curve = thinned(recording.time, array[:, k : k + 1], _POINTS)
        axis.plot(*curve, line, color=colors(i % colors.N), label=label)
    if part == "position":
        _stops(axis, recording, names, colors)


def thinned(time: Array, values: Array, points: int) -> tuple[Array, Array]:
    """Curves with fewer points, which keep their extrema.

    Of every interval of time each curve keeps its minimum and its maximum, in order.

    Args:
        time: Shape (k,).
        values: Shape (k, m).
        points: Largest number of points that remain.

    Returns:
        Times and values.
    """
    stretches = points // 2
    if len(time) <= points:
        return time, values
    edges = np.linspace(0, len(time), stretches + 1).astype(int)
    times, rows = np.empty(2 * stretches), np.empty((2 * stretches, values.shape[1]))
    columns = np.arange(values.shape[1])
    for i, (a, b) in enumerate(zip(edges[:-1], edges[1:], strict=True)):
        part = np.nan_to_num(values[a:b])
        ends = np.sort([part.argmin(axis=0), part.argmax(axis=0)], axis=0)
        times[2 * i : 2 * i + 2] = time[a], time[(a + b) // 2]
        rows[2 * i : 2 * i + 2] = values[a:b][ends, columns]
    return times, rows


def _stops(axis: Any, recording: RecordedMotion, names: list[str], colors: Any) -> None:
    """Marks where joints reach their stops."""
    if recording.physics is None:
        return
    touched = recording.physics.model.stops.touched(recording.q)
    for i, name in enumerate(names):
        k = recording.joint_names.index(name)
        met = np.flatnonzero(np.diff(touched[:, k].astype(int), prepend=0) > 0)[:_MARKS]
        color = colors(i % colors.N)
        axis.plot(recording.time[met], recording.q[met, k], "v", ms=6, color=color)


def _energy(axis: Any, recordings: Sequence[RecordedMotion]) -> None:
    for recording, line in zip(recordings, _cycled(len(recordings)), strict=True):
        if recording.of_robot or recording.origin is None:
            continue
        for i, (label, values) in enumerate(_account(recording)):
            shown = label if line == _LINES[0] else None
            curve = thinned(recording.time, values[:, None], _POINTS)
            axis.plot(*curve, line, color=f"C{i}", label=shown)
    axis.set_ylabel("energy [J]")
    axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=5, fontsize=8, frameon=False)


def _account(recording: RecordedMotion) -> list[tuple[str, Array]]:
    """Work and heat, if they are cheap to compute; else the stored energies."""
    start = recording.energy[0]
    found = [("kinetic", recording.kinetic), ("total, less the initial", recording.energy - start)]
    if recording.account.makes_ticks_again(recording.x) and len(recording) > LONG:
        return found
    return [*found, ("supplied", recording.supplied), ("lost", recording.lost),
            ("unaccounted for", recording.balance)]  # fmt: skip


def _marks(axis: Any, recording: RecordedMotion) -> None:
    """Lines at changes, and grey areas where ticks are missing."""
    times = [recording.time[jump.row] for jump in recording.jumps]
    times += [event.time for event in recording.events]
    for time in sorted(set(times))[:_MARKS]:
        axis.axvline(time, color="0.4", lw=0.7, ls=":")
    for row in recording.gaps:
        axis.axvspan(recording.time[row - 1], recording.time[row], color="0.85", lw=0)


def _unit(recording: RecordedMotion, part: str) -> str:
    turning, sliding = UNITS[part]
    if recording.physics is None:
        return turning if part == "effort" else f"{turning}, {sliding}"
    kinds = {kind == "prismatic" for kind in recording.physics.model.joint_types}
    return ", ".join([turning] * (False in kinds) + [sliding] * (True in kinds))
