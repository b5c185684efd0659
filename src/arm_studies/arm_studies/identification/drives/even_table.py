# SPDX-License-Identifier: Apache-2.0
"""Columns of numbers at a constant sampling rate."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array, read_only, real_array
from arm_dynamics.exceptions import InvalidInput

_SHORTEST = 20  # samples
_TOLERANCE = 1e-2  # of times, relative to a step


def even_table(
    name: str, time: ArrayLike, values: Mapping[str, ArrayLike | None]
) -> tuple[Array, dict[str, Array]]:
    """Check times and columns; a column of None, which was not measured, becomes NaN.

    Args:
        name: Of the record, for messages.
        time: In [s], shape (k,).
        values: Columns of shape (k,) by name.

    Raises:
        InvalidInput: If times are too few or not even, or a column is of another length.
    """
    t = real_array("time", time)
    if t.ndim != 1 or len(t) < _SHORTEST:
        raise InvalidInput(
            f"{name}: time has shape {t.shape}; at least {_SHORTEST} samples are expected"
        )
    if not np.isfinite(t).all():
        raise InvalidInput(f"{name}: time {np.argmin(np.isfinite(t))} is not a finite number")
    steps = np.diff(t)
    median = float(np.median(steps))
    if not median > 0.0:
        raise InvalidInput(f"{name}: times do not increase; a constant step is expected")
    uneven = abs(steps - median) > _TOLERANCE * median
    if uneven.any():
        i = int(np.argmax(uneven))
        raise InvalidInput(
            f"{name}: times are not even: {t[i]:.9g} s, then {t[i + 1]:.9g} s; a constant step of "
            f"{median:.4g} s within {_TOLERANCE:.0%} is expected"
        )
    columns = {}
    for key, value in values.items():
        column = np.full(len(t), np.nan) if value is None else real_array(key, value)
        if column.shape != t.shape:
            raise InvalidInput(f"{name}: {key} has shape {column.shape}; ({len(t)},) is expected")
        columns[key] = read_only(column)
    return read_only(t), columns


def step_of(time: Array) -> float:
    """Sampling interval of even times in [s]."""
    return float((time[-1] - time[0]) / (len(time) - 1))


def check_motion(name: str, columns: Mapping[str, Array]) -> None:
    """Refuse columns in which a sample is missing, or that do not vary.

    Raises:
        InvalidInput: Naming the record and the column.
    """
    for key, column in columns.items():
        if not np.all(np.isfinite(column)):
            raise InvalidInput(f"{name}: {key} is missing in some samples; all are expected")
        if np.ptp(column) == 0.0:
            raise InvalidInput(f"{name}: {key} does not vary; a motion is expected")
