# SPDX-License-Identifier: Apache-2.0
"""Segments of a tick between its events, as the compiled engine reports them."""

from __future__ import annotations

import ctypes

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.kernel import Kernel
from arm_sim.exceptions import NotDifferentiable, SimulationDiverged
from arm_sim.integrators.selection import Choice
from arm_sim.plant.plant import Plant
from arm_sim.stepping.adaptive import SubstepControl
from arm_sim.stepping.events import EventReport, layout

MOST_SEGMENTS = 1000


def segment_type(plant: Plant) -> np.dtype[np.void]:
    """Fields of a segment, ``record_t`` of ``native/modes.h``; modes are one array ``p``."""
    fields = layout("record_t", plant)
    modes = np.dtype((float, (fields["p"].itemsize // 8,)))
    names = fields.names or ()
    return np.dtype([(name, modes if name == "p" else fields[name]) for name in names])


def diverged(choice: Choice) -> SimulationDiverged:
    """The error of a tick that cannot be computed."""
    return SimulationDiverged(f"linearize: the tick cannot be computed{choice.remark}")


def trace_tick(
    kernel: Kernel, plant: Plant, choice: Choice, x: Array, u: Array, p: Array,
    control: SubstepControl | None,
) -> tuple[np.ndarray, Array]:  # fmt: skip
    """Compute one tick of a scene with events, segment by segment.

    Args:
        kernel: Compiled functions and engine of the scene.
        plant: Its equations.
        choice: Its method and tick.
        x: State at the beginning, shape (nx,).
        u: Command that acts, shape (n,).
        p: Tunable numbers.
        control: With error control, its state from one tick to the next.

    Returns:
        The segments, an array of ``segment_type``, and the state at the end.

    Raises:
        SimulationDiverged: If the tick cannot be computed.
        NotDifferentiable: If events accumulate in it.
    """
    records, after = np.zeros(MOST_SEGMENTS, segment_type(plant)), np.zeros(plant.nx)
    report, entry = EventReport(), kernel.library.trace_tick  # type: ignore[union-attr]
    entry.restype = ctypes.c_longlong
    given = [np.ascontiguousarray(array) for array in (x, u, p)]
    count = entry(
        *(ctypes.c_void_p(array.ctypes.data) for array in given),
        ctypes.c_double(choice.dt),
        None if control is None else ctypes.byref(control),
        ctypes.byref(report),
        ctypes.c_void_p(records.ctypes.data),
        ctypes.c_longlong(len(records)),
        ctypes.c_void_p(after.ctypes.data),
    )
    if count < 0:
        raise diverged(choice)
    if report.time_stepped or count > len(records):
        raise NotDifferentiable("linearize: events accumulate in the tick: it has no derivative")
    return records[:count], after
