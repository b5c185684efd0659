# SPDX-License-Identifier: Apache-2.0
"""Measured motions of a robot: joint states as recorded, and resampled and filtered."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm_dynamics.arrays import Array, read_only, real_array
from arm_dynamics.attributes import frozen
from arm_dynamics.exceptions import InvalidInput, counted, known_names
from arm_sim.recording.recording import Recording

MOST_SPANS = 3  # Spans of time that a note lists; of more, only the number.
_COLUMNS = ("q", "effort", "v", "a")


def arrays_at(motion: Any, which: slice | NDArray[np.bool_]) -> dict[str, Any]:
    """Some rows of the arrays of a record or a motion, by name."""
    return {k: read_only(getattr(motion, k)[which]) for k in ("time", *_COLUMNS)}


def _summary(motion: JointRecord | MeasuredMotion) -> str:
    """A summary of a record or a motion: its rows, joints and notes."""
    names = known_names(motion.joint_names, 8)
    lines = [
        f"<{type(motion).__name__} {motion.name}: {len(motion.time)} rows from "
        f"{motion.time[0]:g} to {motion.time[-1]:g} s, {len(motion.joint_names)} joints: {names}",
        *(f"note: {note}" for note in motion.notes),
    ]
    return "\n  ".join(lines) + ">"


@frozen
class JointRecord:
    """Joint states as a robot reported them, in order of time; arrays are read-only.

    Attributes:
        joint_names: Order of the joints in each row.
        time: In [s], increasing, shape (k,).
        q: Positions in [rad] or [m], shape (k, n); NaN where missing.
        effort: What the robot calls effort: torques in [N m] or forces in [N], currents in [A], or
            values proportional to them, shape (k, n); NaN where missing.
        v: Velocities in [rad/s] or [m/s], shape (k, n); NaN where missing.
        a: Accelerations in [rad/s²] or [m/s²], shape (k, n); NaN where missing.
        name: Its source, for messages.
        notes: Irregularities found when it was read.
        effort_age: Time in [s] by which efforts are older than the positions of their row, such as
            half of the tick in which they acted; None if it is unknown.
    """

    joint_names: tuple[str, ...]
    time: Array
    q: Array
    effort: Array
    v: Array
    a: Array
    name: str = "recording"
    notes: tuple[str, ...] = ()
    effort_age: float | None = None

    __repr__ = _summary

    @classmethod
    def of(
        cls, joint_names: Sequence[str], time: ArrayLike, q: ArrayLike, effort: ArrayLike,
        v: ArrayLike | None = None, a: ArrayLike | None = None, *, name: str = "recording",
        notes: Sequence[str] = (), effort_age: float | None = None,
    ) -> JointRecord:  # fmt: skip
        """From arrays; see the attributes. ``None`` stands for what was not measured.

        Raises:
            InvalidInput: If shapes do not match, or time does not increase.
        """
        names, t = tuple(joint_names), real_array("time", time)
        if t.ndim != 1 or len(t) < 2:
            raise InvalidInput(f"{name}: time has shape {t.shape}; (k,) with k > 1 is expected")
        if (bad := np.flatnonzero(~np.isfinite(t))).size:
            i = int(bad[0])
            raise InvalidInput(f"{name}: time[{i}] = {t[i]}; finite times are expected")
        if (back := np.flatnonzero(np.diff(t) <= 0.0)).size:
            i = int(back[0]) + 1
            raise InvalidInput(
                f"{name}: time[{i}] = {t[i]:.9g} s after {t[i - 1]:.9g} s: the clock stops or "
                "jumps back; increasing times are expected"
            )
        shape, arrays = (len(t), len(names)), {}
        for key, part in {"q": q, "effort": effort, "v": v, "a": a}.items():
            array = np.full(shape, np.nan) if part is None else real_array(key, part)
            if array.shape != shape:
                raise InvalidInput(f"{name}: {key} has shape {array.shape}; {shape} is expected")
            arrays[key] = read_only(array)
        if len(set(names)) != len(names):
            raise InvalidInput(f"{name}: a joint name is repeated: {known_names(names)}")
        return cls(
            names, read_only(t), **arrays, name=name, notes=tuple(notes), effort_age=effort_age
        )

    @classmethod
    def from_recording(cls, recording: Recording, name: str = "recording") -> JointRecord:
        """From a recording of a robot or of a simulation.

        From a simulation it takes the measurements of its sensors, if it has any, whose efforts
        are those of the tick before; else the state at each time, and the mean of the torques of
        the ticks before and after. Torques of ticks in which the arm was held are NaN. When the
        efforts of a robot acted is unknown.

        Raises:
            InvalidInput: If it has fewer than two rows, or its time does not increase.
        """
        sensed, of_robot = recording.measured, recording.of_robot
        q, v, effort = recording.q, recording.v, recording.tau
        age = None if of_robot else 0.0
        if sensed is not None:
            q, v, effort = sensed.q, sensed.v, sensed.effort
            age = None if recording.origin is None else 0.5 * recording.origin.dt
        elif not of_robot:
            effort = 0.5 * (effort + np.vstack([effort[:1], effort[:-1]]))
        if recording.hold is not None:
            effort = np.where(recording.hold[:, None] != 0, np.nan, effort)
        notes = [event.text for event in recording.events if of_robot]
        names = recording.joint_names
        return cls.of(names, recording.time, q, effort, v, name=name, notes=notes, effort_age=age)

    def joints(self, names: Sequence[str]) -> JointRecord:
        """The record of some joints, in this order.

        Raises:
            InvalidInput: If one of them is missing.
        """
        if missing := [joint for joint in names if joint not in self.joint_names]:
            raise InvalidInput(
                f"{self.name}: no joint {known_names(missing)}; it has "
                f"{known_names(self.joint_names)}"
            )
        place = [self.joint_names.index(joint) for joint in names]
        parts = {k: read_only(getattr(self, k)[:, place]) for k in _COLUMNS}
        return replace(self, joint_names=tuple(names), **parts)  # type: ignore[arg-type]

    def rows(self, which: slice | NDArray[np.bool_]) -> JointRecord:
        """Some of its rows, by a slice or by a mask of shape (k,)."""
        return replace(self, **arrays_at(self, which))


@frozen
class MeasuredMotion:
    """A motion at a constant sampling rate, with velocities and accelerations.

    A recording with gaps becomes several stretches without gaps, whose rows follow one another.
    Arrays are read-only.

    Attributes:
        joint_names: Order of the joints in each row.
        time: In [s], shape (k,).
        q: Positions in [rad] or [m], low-pass filtered, shape (k, n).
        v: Velocities in [rad/s] or [m/s], low-pass filtered, shape (k, n).
        a: Accelerations in [rad/s²] or [m/s²], low-pass filtered, shape (k, n).
        effort: What the robot calls effort, *not* filtered, shape (k, n).
        valid: Which efforts may be used, shape (k, n): neither interpolated over a hole, nor
            saturated, nor so near an end that the filter has not settled.
        dt: Sampling interval within a stretch in [s].
        stretches: The rows of each stretch.
        band: Cut-off frequency of the low-pass filter in [Hz]; infinite if it is not filtered.
        low_pass: The zero-phase filter of one stretch, shape (m, …) to the same shape.
        name: Its source, for messages.
        notes: Irregularities of the recording.
        aged: Whether the age of its efforts is known; q, v and a are those at the efforts' times.
        noise: Standard deviations of the white noise of positions and of efforts, shape (2, n).
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
    aged: bool = True
    noise: Array = field(default_factory=lambda: np.zeros((2, 1)))

    __repr__ = _summary

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @property
    def independent(self) -> float:
        """Independent values of low-pass filtered noise per row, at most one."""
        return min(1.0, 2.0 * self.band * self.dt)

    def filtered(self, values: Array) -> Array:
        """Low-pass filter values with one row for each time, stretch by stretch; shape (k, …)."""
        smooth = np.empty_like(values, dtype=float)
        for stretch in self.stretches:
            smooth[stretch] = self.low_pass(values[stretch])
        return smooth

    def span(self, rows: slice) -> MeasuredMotion:
        """Consecutive rows as a motion of its own.

        Args:
            rows: First and end; without a step.
        """
        start, stop, _ = rows.indices(len(self.time))
        cut = [
            slice(max(s.start, start) - start, min(s.stop, stop) - start) for s in self.stretches
        ]
        kept = tuple(s for s in cut if s.stop > s.start)
        return replace(self, **arrays_at(self, rows), valid=self.valid[rows], stretches=kept)


def joined(motions: Sequence[MeasuredMotion], notes: Sequence[str] = ()) -> MeasuredMotion:
    """Concatenate motions of the same rate and filter, each as stretches of its own."""
    first = motions[0]
    starts = np.cumsum([0, *(len(motion.time) for motion in motions)])
    stretches = tuple(
        slice(s.start + int(start), s.stop + int(start))
        for motion, start in zip(motions, starts, strict=False)
        for s in motion.stretches
    )
    parts: dict[str, Any] = {
        key: read_only(np.concatenate([getattr(motion, key) for motion in motions]))
        for key in ("time", "q", "v", "a", "effort")
    }
    valid = np.concatenate([motion.valid for motion in motions])
    return replace(first, **parts, valid=valid, stretches=stretches, notes=tuple(notes))


def read_joint_record(path: str | os.PathLike[str], topic: str | None = None) -> JointRecord:
    """Read a file of any kind that ``Recording.load`` opens; see there.

    Raises:
        InvalidInput: If it is not a recording, or too damaged to be used.
        OSError: If it cannot be read.
    """
    path = Path(path)
    try:
        return JointRecord.from_recording(Recording.load(path, topic=topic), path.name)
    except InvalidInput as error:
        text = str(error)
        raise InvalidInput(text if str(path) in text else f"'{path}': {text}") from None


def records_of(recordings: Any) -> list[JointRecord]:
    """One or several recordings of any kind as joint records.

    Raises:
        InvalidInput: If there is none, or it is something else.
    """
    several = recordings if isinstance(recordings, list | tuple) else [recordings]
    if not several:
        raise InvalidInput("no recording is given; at least one is expected")
    for each in several:
        if not isinstance(each, JointRecord) and not hasattr(each, "joint_names"):
            raise InvalidInput(
                f"recording = {each!r}; allowed: a Recording, such as Recording.load(path), or a "
                "JointRecord"
            )
    return [r if isinstance(r, JointRecord) else JointRecord.from_recording(r) for r in several]


def interpolated(at: Array, time: Array, values: Array) -> Array:
    """Values of shape (k, n) at other times, linear between rows."""
    return np.column_stack([np.interp(at, time, column) for column in values.T])


def runs(mask: NDArray[np.bool_]) -> NDArray[np.int_]:
    """First row and end of each stretch in which a condition holds, shape (m, 2)."""
    return np.flatnonzero(np.diff(mask.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)


def row_words(mask: NDArray[np.bool_], time: Array) -> str:
    """How often and when a condition holds, in words."""
    return f"{counted(int(np.count_nonzero(mask)), 'row')} ({in_words(time[runs(mask) - [0, 1]])})"


def in_words(spans: Array) -> str:
    """Spans of time in [s] from the start, shape (m, 2), in words."""
    texts = [f"{a:.3f} s" if a == b else f"{a:.3f} to {b:.3f} s" for a, b in spans[:MOST_SPANS]]
    more = f" and {len(spans) - MOST_SPANS} times more," if len(spans) > MOST_SPANS else ""
    return f"{', '.join(texts)}{more} after the start"
