# SPDX-License-Identifier: Apache-2.0
"""Joint states that different messages name, as those of several drivers, merged into rows."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_sim.recording.files.messages import PARTS, JointState

Indices = NDArray[np.int_]
Stamps = NDArray[np.int64]
_LEAST_CLOCK_OFFSET = 5e7  # [ns] between clocks that are not the same one
HOLE = 4.0  # median steps between two messages across which values are not interpolated


class Series(NamedTuple):
    """Joint states of the same joints, in order of time."""

    names: tuple[str, ...]
    time: Stamps  # [ns], shape (k,)
    parts: list[Array]  # as ``PARTS``, each of shape (k, n), NaN where a message has none


def merged(states: Sequence[JointState], arrival: Sequence[int]) -> tuple[Series, list[str]]:
    """Rows at the times of the joints that most messages name.

    Joints that only other messages name are interpolated to these times.

    Args:
        states: Messages, at least one.
        arrival: Time at which each arrived in [ns].

    Returns:
        The rows, and what users should know of them.

    Raises:
        InvalidInput: If no message names a joint.
    """
    groups, notes = _groups(states)
    if not groups:
        raise InvalidInput("the joint states name no joints")
    stamps, clock_notes = _clock(states, np.array(arrival, np.int64), groups)
    notes += clock_notes
    first, *rest = (_series(states, stamps, group) for group in groups)
    names, parts = first.names, first.parts
    for series in rest:
        new = [i for i, name in enumerate(series.names) if name not in names]
        added = tuple(series.names[i] for i in new)
        notes.append(
            f"{known_names(added)}: from {len(series.time)} messages of their own, interpolated "
            f"to the times of {known_names(names)}"
        )
        parts = [
            np.hstack([part, _interpolated(first.time, series.time, values[:, new])])
            for part, values in zip(parts, series.parts, strict=True)
        ]
        names += added
    used = sum(len(series.time) for series in (first, *rest))
    if repeated := sum(map(len, groups)) - used:
        notes.append(f"{repeated} messages have the time of another one")
    return Series(names, first.time, parts), notes


def _groups(states: Sequence[JointState]) -> tuple[list[Indices], list[str]]:
    """Messages of the same joints, the most first, without those of no further joint; notes."""
    members_of: dict[frozenset[str], list[int]] = {}
    for i, state in enumerate(states):
        members_of.setdefault(frozenset(state.name), []).append(i)
    groups, joints, notes = list[Indices](), frozenset[str](), list[str]()
    for names, members in sorted(members_of.items(), key=lambda item: -len(item[1])):
        if names <= joints:
            notes.append(f"{len(members)} messages name no further joint than others")
            continue
        groups.append(np.array(members))
        joints |= names
    return groups, notes


def _clock(
    states: Sequence[JointState], arrival: Stamps, groups: list[Indices]
) -> tuple[Stamps, list[str]]:
    """Time of each message in [ns]: its stamp, or that of arrival where stamps are of no use."""
    times, notes = np.array([state.stamp for state in states], np.int64), list[str]()
    for group in groups:
        if not np.all(np.diff(times[group]) > 0):
            times[group] = arrival[group]
            names = known_names(states[group[0]].name)
            notes.append(f"{names}: stamps do not increase, times are those of arrival")
    apart = np.ptp([np.median(arrival[group] - times[group]) for group in groups])
    arrival_span, span = (np.ptp(clock[groups[0]]) for clock in (arrival, times))
    if apart > _LEAST_CLOCK_OFFSET and abs(arrival_span - span) < 0.1 * span:
        notes.append(f"clocks of joints are {1e-9 * apart:.3g} s apart, times are of arrival")
        return arrival, notes
    return times, notes


def _series(states: Sequence[JointState], stamps: Stamps, group: Indices) -> Series:
    """The states of a group as one series in the order of their stamps, each stamp once."""
    rows = group[np.argsort(stamps[group], kind="stable")]
    unique = rows[np.diff(stamps[rows], prepend=stamps[rows[0]] - 1) > 0]
    names, parts = states[group[0]].name, list[Array]()
    for part in PARTS:
        values = np.full((len(unique), len(names)), np.nan)
        for row, state in zip(values, (states[row] for row in unique), strict=True):
            numbers = getattr(state, part)
            if len(numbers) == len(names):
                row[:] = numbers[[state.name.index(name) for name in names]]
        parts.append(values)
    return Series(names, stamps[unique], parts)


def _interpolated(times: Stamps, own: Stamps, values: Array) -> Array:
    """Values of ``own`` times at others; NaN where no two of them on either side are near."""
    interpolated = np.full((len(times), values.shape[1]), np.nan)
    if len(own) > 1:
        after = np.clip(np.searchsorted(own, times), 1, len(own) - 1)
        steps = np.diff(own)
        share = (times - own[after - 1]) / steps[after - 1]
        near = (share >= 0.0) & (share <= 1.0) & (steps[after - 1] <= HOLE * np.median(steps))
        last, share = after[near], share[near, None]
        interpolated[near] = (1.0 - share) * values[last - 1] + share * values[last]
    return interpolated
