# SPDX-License-Identifier: Apache-2.0
"""What was measured of a robot in motion: as it came, and as it is computed with."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm_dynamics.arrays import Array, read_only, real_array
from arm_dynamics.exceptions import InvalidInput, known_names


class Recorded(Protocol):
    """What a recording has, whoever made it."""

    @property
    def joint_names(self) -> tuple[str, ...]: ...  # noqa: D102 - see JointRecord, as below
    @property
    def time(self) -> Array: ...  # noqa: D102
    @property
    def q(self) -> Array: ...  # noqa: D102
    @property
    def v(self) -> Array: ...  # noqa: D102
    @property
    def tau(self) -> Array: ...  # noqa: D102


@dataclass(frozen=True)
class JointRecord:
    """Joint states as a robot told them, in the order of time; arrays are read-only.

    Attributes:
        joint_names: Order of the joints in each row.
        time: In [s], increasing, shape (k,).
        q: Positions in [rad] or [m], shape (k, n); NaN where none was told.
        effort: What the robot calls effort: torques in [N m] or forces in [N], currents in [A], or
            something in proportion to them, shape (k, n); NaN where none was told.
        v: Velocities in [rad/s] or [m/s], shape (k, n); NaN where none was told.
        a: Accelerations in [rad/s²] or [m/s²], shape (k, n); NaN where none was told.
        name: Where it is from, for messages.
        notes: What was odd about it when it was read.
    """

    joint_names: tuple[str, ...]
    time: Array
    q: Array
    effort: Array
    v: Array
    a: Array
    name: str = "recording"
    notes: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, joint_names: Sequence[str], time: ArrayLike, q: ArrayLike, effort: ArrayLike,
        v: ArrayLike | None = None, a: ArrayLike | None = None, *, name: str = "recording",
        notes: Sequence[str] = (),
    ) -> JointRecord:  # fmt: skip
        """From arrays; see the attributes. ``None`` stands for what was not told.

        Raises:
            InvalidInput: If shapes do not go together, or time does not increase.
        """
        names = tuple(joint_names)
        t = real_array("time", time)
        if t.ndim != 1 or len(t) < 2:
            raise InvalidInput(f"{name}: time has shape {t.shape}; (k,) with k > 1 is expected")
        _check_time(name, t)
        shape = (len(t), len(names))
        parts = {"q": q, "effort": effort, "v": v, "a": a}
        arrays = {key: _column_block(name, key, part, shape) for key, part in parts.items()}
        if len(set(names)) != len(names):
            raise InvalidInput(f"{name}: joints are named twice: {known_names(names)}")
        return cls(names, read_only(t), **arrays, name=name, notes=tuple(notes))

    @classmethod
    def from_recording(cls, recording: Recorded, name: str = "recording") -> JointRecord:
        """Of a recording of a robot or of a simulation.

        Of a simulation it is what its sensors told, where it has any; else the state at each time,
        and the torque that acted about it: the mean of the ticks before and after. Ticks in which
        something held the arm tell no torque.

        Raises:
            InvalidInput: If it has no two rows, or its time does not increase.
        """
        told, of_robot = getattr(recording, "measured", None), getattr(recording, "of_robot", True)
        q, v, effort = recording.q, recording.v, recording.tau
        if told is not None:
            q, v, effort = told.q, told.v, told.effort
        elif not of_robot:
            effort = 0.5 * (effort + np.vstack([effort[:1], effort[:-1]]))
        if (hold := getattr(recording, "hold", None)) is not None:
            effort = np.where(hold[:, None] != 0, np.nan, effort)
        notes = [event.text for event in getattr(recording, "events", ()) if of_robot]
        names = recording.joint_names
        return cls.of(names, recording.time, q, effort, v, name=name, notes=notes)

    def joints(self, names: Sequence[str]) -> JointRecord:
        """The same of some joints, in this order.

        Raises:
            InvalidInput: If one of them is missing.
        """
        if missing := [joint for joint in names if joint not in self.joint_names]:
            raise InvalidInput(
                f"{self.name}: no joint {known_names(missing)} in it, but "
                f"{known_names(self.joint_names)}"
            )
        place = [self.joint_names.index(joint) for joint in names]
        kinds = ("q", "effort", "v", "a")
        parts: dict[str, Any] = {k: read_only(getattr(self, k)[:, place]) for k in kinds}
        return replace(self, joint_names=tuple(names), **parts)

    def rows(self, which: slice | NDArray[np.bool_]) -> JointRecord:
        """Some of its rows, by a slice or by a mask of shape (k,)."""
        kinds = ("time", "q", "effort", "v", "a")
        parts: dict[str, Any] = {k: read_only(getattr(self, k)[which]) for k in kinds}
        return replace(self, **parts)


def _check_time(name: str, time: Array) -> None:
    if (bad := np.flatnonzero(~np.isfinite(time))).size:
        raise InvalidInput(f"{name}: time[{bad[0]}] = {time[bad[0]]}; finite times are expected")
    if (back := np.flatnonzero(np.diff(time) <= 0.0)).size:
        i = int(back[0]) + 1
        raise InvalidInput(
            f"{name}: time[{i}] = {time[i]:.9g} s after {time[i - 1]:.9g} s: the clock stands or "
            "jumps back; times that increase are expected"
        )


def _column_block(name: str, key: str, part: ArrayLike | None, shape: tuple[int, int]) -> Array:
    if part is None:
        return read_only(np.full(shape, np.nan))
    array = real_array(key, part)
    if array.shape != shape:
        raise InvalidInput(f"{name}: {key} has shape {array.shape}; {shape} is expected")
    return read_only(array)


@dataclass(frozen=True)
class MeasuredMotion:
    """A motion at even steps of time, with velocities and accelerations; arrays are read-only.

    A recording with gaps becomes several stretches, each of them even in itself; the rows of all
    of them follow one another.

    Attributes:
        joint_names: Order of the joints in each row.
        time: In [s], shape (k,).
        q: Positions in [rad] or [m], low-passed, shape (k, n).
        v: Velocities in [rad/s] or [m/s], low-passed, shape (k, n).
        a: Accelerations in [rad/s²] or [m/s²], low-passed, shape (k, n).
        effort: What the robot calls effort, *not* low-passed, shape (k, n).
        valid: Which efforts may be used, shape (k, n): neither interpolated over a hole, nor
            saturated, nor so near an end that the filter has not settled.
        dt: Time from row to row within a stretch in [s].
        stretches: The rows of each stretch.
        band: Cut-off frequency of the low-pass in [Hz]; infinite if it is not filtered.
        low_pass: The zero-phase filter, which takes and returns a stretch, shape (m, …).
        name: Where it is from, for messages.
        notes: What was odd about it.
    """

    joint_names: tuple[str, ...]
    time: Array
    q: Array
    v: Array
    a: Array
    effort: Array
    valid: NDArray[np.bool_]
    dt: float
    stretches: tuple[slice, ...]
    band: float
    low_pass: Callable[[Array], Array]
    name: str = "recording"
    notes: tuple[str, ...] = ()

    @property
    def n(self) -> int:
        """How many joints."""
        return len(self.joint_names)

    @property
    def every(self) -> int:
        """Each how many rows low-passed values carry all there is to know: twice the band."""
        if not np.isfinite(self.band):
            return 1
        return max(1, int(0.5 / (self.band * self.dt) * (1.0 + 1e-9)))

    @property
    def independent(self) -> float:
        """How many numbers low-passed noise has in a row: at most one."""
        return min(1.0, 2.0 * self.band * self.dt)

    def filtered(self, values: Array) -> Array:
        """Low-pass what has one row for each time, stretch by stretch; shape (k, …)."""
        found = np.empty_like(values, dtype=float)
        for stretch in self.stretches:
            found[stretch] = self.low_pass(values[stretch])
        return found

    def parts(self) -> Iterator[MeasuredMotion]:
        """Each stretch as a motion of its own."""
        for stretch in self.stretches:
            yield self.span(stretch)

    def span(self, rows: slice) -> MeasuredMotion:
        """Some rows that follow one another, as a motion of its own.

        Args:
            rows: First and end; without a step.
        """
        start, stop, _ = rows.indices(len(self.time))
        cut = [
            slice(max(s.start, start) - start, min(s.stop, stop) - start) for s in self.stretches
        ]
        parts = ("time", "q", "v", "a", "effort")
        arrays: dict[str, Any] = {k: read_only(getattr(self, k)[rows]) for k in parts}
        kept = tuple(s for s in cut if s.stop > s.start)
        return replace(self, **arrays, valid=self.valid[rows], stretches=kept)


def records_of(recordings: Any) -> list[JointRecord]:
    """One or several recordings of any kind as joint records.

    Raises:
        InvalidInput: If there is none.
    """
    several = isinstance(recordings, list | tuple)
    found = [
        r if isinstance(r, JointRecord) else JointRecord.from_recording(r)
        for r in (recordings if several else [recordings])
    ]
    if not found:
        raise InvalidInput("no recording is given; one is expected at least")
    return found
