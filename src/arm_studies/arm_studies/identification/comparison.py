# SPDX-License-Identifier: Apache-2.0
"""Comparison of a scene with a recording: errors of its torques and of free simulation."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from arm_dynamics import ArmModel, Dynamics, InvalidInput, load_scene
from arm_dynamics.arrays import Array, positive, read_only
from arm_dynamics.attributes import frozen
from arm_sim import Recording, Simulator
from arm_studies._renaming import renamed_attribute
from arm_studies.identification.data import JointRecord, MeasuredMotion
from arm_studies.identification.names import joint_records
from arm_studies.identification.preparation.even_record import prepare

_LEAST_ROWS = 100  # with a valid torque
_LEAST_MOTION = 1e-6  # [rad] or [m] in all windows above which a joint has moved
_HAS_DRIVES = "the scene has drives, and the recording does not have their commands"


@frozen
class FreeRun:
    """Position errors at the end of short simulations that start at measured states.

    Attributes:
        window: Duration of each simulation in [s].
        count: Number of simulations.
        diverged: Number of simulations that diverged; they do not enter the errors.
        error: Root mean square error of each joint at the end in [rad] or [m], shape (n,).
        moved: Root mean square displacement of each joint in a window, likewise.
    """

    window: float
    count: int
    diverged: int
    error: Array
    moved: Array
    lost = renamed_attribute("lost", "diverged")

    def __repr__(self) -> str:
        """A summary: the windows, and the error of each joint."""
        errors = ", ".join(f"{x:.2g}" for x in self.error)
        diverged = f", {self.diverged} diverged" if self.diverged else ""
        return (
            f"<FreeRun: {self.count} windows of {self.window:.3g} s{diverged}; errors at their "
            f"ends {errors} rad or m>"
        )

    @property
    def relative(self) -> Array:
        """Error over displacement, NaN for joints that do not move, shape (n,)."""
        is_moving = self.moved > _LEAST_MOTION
        return np.where(is_moving, self.error / np.where(is_moving, self.moved, 1.0), np.nan)


@frozen
class Comparison:
    """Result of ``compare``; arrays are read-only.

    Attributes:
        joint_names: Order of every vector.
        error: Root mean square of measured minus computed torque in [N m] or [N], shape (n,).
        torque: Root mean square of the measured torque, likewise.
        free_run: None if the scene cannot be simulated from the recording.
        why_not: The reason, if ``free_run`` is None; else empty.
        time: For figures, in [s], shape (k,).
        measured: Measured torques, low-passed; NaN where they are not used, shape (k, n).
        computed: Torques of the scene, likewise.
        band: Cut-off frequency of the low-pass filter in [Hz].
        notes: Irregularities of the recording.
    """

    joint_names: tuple[str, ...]
    error: Array
    torque: Array
    free_run: FreeRun | None
    why_not: str
    time: Array
    measured: Array
    computed: Array
    band: float
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        """A summary: errors of all joints and of each, and of the free run."""
        relative = zip(self.joint_names, self.relative, strict=True)
        lines = [
            f"<Comparison: torque error {self.whole:.2%}",
            ", ".join(f"{name} {error:.2%}" for name, error in relative),
            f"no free run: {self.why_not}" if self.free_run is None else f"{self.free_run}",
            *(f"note: {note}" for note in self.notes),
        ]
        return "\n  ".join(lines) + ">"

    @property
    def relative(self) -> Array:
        """Error over torque of each joint, shape (n,)."""
        return np.where(self.torque > 0.0, self.error / np.maximum(self.torque, 1e-300), np.nan)

    @property
    def whole(self) -> float:
        """Error over torque of all joints together."""
        return float(np.linalg.norm(self.error) / np.linalg.norm(self.torque))


def compare(
    scene: Any,
    recording: JointRecord | Recording,
    *,
    band: float | None = None,
    window: float = 0.25,
    last: float = 1.0,
    names: Mapping[str, str] | None = None,
) -> Comparison:
    """Compare the inverse dynamics and the simulated motion of a scene with measurements.

    Computed torques are the inverse dynamics of the measured motion; both torques are filtered by
    the same low-pass. For the free run the recording is cut into windows; in each the simulator
    starts at the measured position and velocity and applies the measured torques.

    Args:
        scene: Anything ``load_scene`` accepts; efforts of the recording are its torques.
        recording: Joint states, or a recording of them.
        band: Cut-off frequency of the low-pass filter in [Hz]; None: chosen from the noise.
        window: Duration of each simulated window in [s].
        last: Fraction of the recording that is used, counted from its end.
        names: Joint names of the recording by those of the scene, where they cannot be matched.

    Raises:
        InvalidInput: If the recording is of another arm, has no torques or no motion, or an
            argument is not allowed.
    """
    positive("window", window)
    if not 0.0 < last <= 1.0:
        raise InvalidInput(f"last = {last}; a fraction above 0 and at most 1 is expected")
    model = ArmModel(load_scene(scene))
    if model.scene.bilateral:
        raise InvalidInput(
            "the scene has closed loops: its joint torques do not follow from the motion alone; "
            "an open chain is expected"
        )
    (record,) = joint_records(recording, model, names)
    if not np.any(np.nanmax(record.q, axis=0) - np.nanmin(record.q, axis=0) > _LEAST_MOTION):
        raise InvalidInput(f"{record.name}: no joint moves; a motion is expected")
    motion = prepare(record, band)
    motion = motion.span(slice(round((1.0 - last) * len(motion.time)), len(motion.time)))
    valid = motion.valid
    few = np.count_nonzero(valid, axis=0) < _LEAST_ROWS
    if few.any():
        joints = ", ".join(motion.joint_names[i] for i in np.flatnonzero(few))
        raise InvalidInput(
            f"{motion.name}: efforts of {joints} are missing or saturated; at least {_LEAST_ROWS} "
            "valid samples are expected"
        )
    if not np.any(motion.effort[valid]):
        raise InvalidInput(f"{motion.name}: all efforts are zero; measured torques are expected")
    computed = motion.filtered(Dynamics(model).inverse(motion.q, motion.v, motion.a))
    measured = motion.filtered(motion.effort)

    def rms(values: Array) -> Array:
        return read_only(np.sqrt(np.mean(values**2, axis=0, where=valid)))

    why_not = _HAS_DRIVES if any(model.drives) else ""
    return Comparison(
        joint_names=model.joint_names,
        error=rms(measured - computed),
        torque=rms(measured),
        free_run=None if why_not else _free_run(model, motion, window),
        why_not=why_not,
        time=read_only(motion.time),
        measured=read_only(np.where(valid, measured, np.nan)),
        computed=read_only(np.where(valid, computed, np.nan)),
        band=motion.band,
        notes=motion.notes,
    )


def _free_run(model: ArmModel, motion: MeasuredMotion, window: float) -> FreeRun:
    """Simulate the windows, with torques taken at the middle of each tick.

    They have acted already: no line delays or loses them again.
    """
    sim = Simulator(ArmModel(model.scene.model_copy(update={"commands": None})))
    rows = max(1, round(window / motion.dt))
    ticks = max(1, round(rows * motion.dt / sim.dt))
    has_torques = motion.valid.all(axis=1)
    starts = np.array([
        start for part in motion.stretches for start in range(part.start, part.stop - rows, rows)
        if has_torques[start : start + rows + 1].all()
    ], int)  # fmt: skip
    n, unknown = sim.n, np.full(sim.n, np.nan)
    if not len(starts):
        return FreeRun(rows * motion.dt, 0, 0, unknown, unknown)
    effort = motion.filtered(motion.effort)
    middle = (np.arange(ticks) + 0.5) * rows / ticks  # of each tick, in rows
    part = (middle % 1.0)[:, None]
    row = starts[:, None] + np.floor(middle).astype(int)
    tau = effort[row] * (1.0 - part) + effort[row + 1] * part
    begin, measured = motion.q[starts], motion.q[starts + rows]
    ends = sim.rollout(begin, motion.v[starts], tau, ticks, last_only=True)[:, :n]
    finite = np.isfinite(ends).all(axis=1)
    error = moved = unknown
    if finite.any():
        error, moved = (
            np.sqrt(np.mean(x[finite] ** 2, axis=0)) for x in (ends - measured, measured - begin)
        )
    diverged = int(np.count_nonzero(~finite))
    return FreeRun(rows * motion.dt, len(starts), diverged, read_only(error), read_only(moved))
