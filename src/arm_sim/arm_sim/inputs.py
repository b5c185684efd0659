# SPDX-License-Identifier: Apache-2.0
"""Checks of the simulator's arguments."""

import logging
import os
from typing import Any

import numpy as np

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import (
    Array,
    Joints,
    are_finite,
    count,
    real_array,
    real_number,
    vector,
    vector_or_batch,
    without_number,
)

MOST_TICKS = 10**9  # of a recording, which would take more memory than machines have
# Relative difference that rounding causes, of numbers in single precision too.
SAME_DURATION = 1e-7

_log = logging.getLogger(__name__)


def check_torque(tau: Any, joints: Joints) -> list[float]:
    """Check torques for one tick, finite numbers of shape (n,); return n plain numbers."""
    n = count(joints)
    command = tau if type(tau) is np.ndarray and tau.dtype == float else real_array("tau", tau)
    if command.shape != (n,):
        text = f"tau has shape {command.shape}; expected ({n},)"
        raise InvalidInput(text + without_number(joints, command))
    numbers: list[float] = command.tolist()
    if not are_finite(numbers):
        vector("tau", command, joints)  # which raises the error
    return numbers


def check_torque_table(control: Any, ticks: int, joints: Joints, dt: float) -> Array:
    """Check torques for a run: None for zero, held ones of shape (n,), or a row for each tick."""
    if control is not None and np.ndim(control) == 0:
        n = count(joints)
        raise InvalidInput(
            f"control = {control!r}: a function of the state, a controller, or numbers of shape "
            f"({n},) or (steps, {n}) are expected"
            + "; ClosedLoop(scene, 'NAME') makes controllers by name"
            * isinstance(control, str)
        )
    torques = np.zeros(count(joints)) if control is None else control
    table = vector_or_batch("control", torques, joints)
    if table.ndim == 2 and len(table) != ticks:
        raise InvalidInput(f"control has {len(table)} rows; the run {ticks} time steps of {dt} s")
    return np.ascontiguousarray(table)


def check_row(name: str, value: Any, joints: Joints) -> Array:
    """Check one row of finite numbers, by joint or count; it may be empty."""
    if joints == 0 and np.size(value) == 0:
        return np.zeros(0)
    return vector(name, value, joints)


def check_rows(name: str, value: Any, arms: int, joints: int) -> Array:
    """Check a row of finite numbers for each arm, shape (b, n)."""
    table = np.atleast_2d(vector_or_batch(name, value, joints))
    if len(table) != arms:
        raise InvalidInput(f"{name} has {len(table)} rows; expected one for each of {arms} arms")
    return table


def check_whole(name: str, value: Any, least: int) -> None:
    """Reject anything but a whole number of at least ``least``."""
    if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < least:
        raise InvalidInput(f"{name} = {value!r}; expected a whole number of at least {least}")


def check_side(side: Any) -> int | None:
    """Check the side of a derivative: 1, -1, or None for one that both sides agree on."""
    if side is not None and (isinstance(side, bool) or side not in (1, -1)):
        raise InvalidInput(f"side = {side!r}; allowed: 1, -1 or None")
    return None if side is None else int(side)


def scene_name(scene: Any) -> str:
    """Path or name by which a scene is specified; empty for its text or an object."""
    text = os.fspath(scene) if isinstance(scene, str | os.PathLike) else ""
    return "" if "<" in text or "\n" in text else str(text)


def tick_count(duration: Any, dt: float) -> int:
    """Check a duration in [s] and round it to whole ticks, with a warning."""
    seconds = real_number(duration)
    if not 0.0 <= seconds < np.inf:
        raise InvalidInput(f"duration = {duration!r}; expected a finite time in s, not negative")
    ticks = round(seconds / dt)
    if ticks > MOST_TICKS:
        raise InvalidInput(
            f"duration = {duration!r} is {ticks:.1e} time steps of {dt:g} s; allowed: up to "
            f"{MOST_TICKS:.0e}, recorded in parts"
        )
    if seconds and not ticks:
        raise InvalidInput(
            f"duration = {duration!r} is less than the time step of {dt:g} s; allowed: 0, or at "
            f"least {dt:g} s"
        )
    if abs(seconds - ticks * dt) > SAME_DURATION * seconds:
        _log.warning(
            "duration = %r is no multiple of the time step of %g s and is rounded to %.12g s",
            duration, dt, ticks * dt,
        )  # fmt: skip
    return ticks
