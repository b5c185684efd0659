# SPDX-License-Identifier: Apache-2.0
"""Checks of the simulator's arguments, and notices."""

from __future__ import annotations

import inspect
import logging
import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from arm_dynamics import ArmModel, Dynamics, InvalidInput
from arm_dynamics.actuation.command_map import gravity_compensated
from arm_dynamics.arrays import (
    Array,
    Joints,
    count,
    finite_numbers,
    real_array,
    real_number,
    vector,
    without_number,
)
from arm_dynamics.trajectory.reference import Motion
from arm_dynamics.trajectory.trajectory import hold

if TYPE_CHECKING:
    from arm_sim.state import State

MOST_TICKS = 10**9  # of a recording, which would take more memory than machines have
# Relative difference that rounding causes, of numbers in single precision too.
SAME_DURATION = 1e-7

_log = logging.getLogger(__name__)


def torque(tau: Any, joints: Joints) -> list[float]:
    """Check torques for one tick, finite numbers of shape (n,); return n plain numbers."""
    n = count(joints)
    command = tau if type(tau) is np.ndarray and tau.dtype == float else real_array("tau", tau)
    if command.shape != (n,):
        text = f"tau has shape {command.shape}; expected ({n},)"
        raise InvalidInput(text + without_number(joints, command))
    numbers: list[float] = command.tolist()
    if not finite_numbers(numbers):
        vector("tau", command, joints)  # which raises the error
    return numbers


def answers(
    control: Any, reference: Motion | None, dynamics: Dynamics, begin: State
) -> Callable[[State], Any]:
    """Commands of a controller as a function of the state.

    Args:
        control: An object with ``torque(state, reference)``.
        reference: The reference from the state ``begin`` on; None: stay there.
        dynamics: Dynamics of the arm, for drives with commands other than torques.
        begin: The state at the start of the run.
    """
    if inspect.isclass(control):
        raise InvalidInput(f"control is class {control.__name__}; an instance of it is expected")
    motion: Motion = hold(begin.q) if reference is None else reference
    if not hasattr(motion, "sample"):
        raise InvalidInput(
            f"reference is of type {type(motion).__name__}; an object with sample(t) is expected, "
            "such as trajectory.quintic(…)"
        )

    def answer(state: State) -> Any:
        tau = control.torque(state, motion.sample(state.time - begin.time))
        return dynamics.command_map(state.q, state.v, tau)

    return answer


def torque_table(control: Any, ticks: int, joints: Joints, dt: float) -> Array:
    """Check torques for a run: None for zero, held ones of shape (n,), or a row for each tick."""
    if control is not None and np.ndim(control) == 0:
        n = count(joints)
        raise InvalidInput(
            f"control = {control!r}: a function of the state, a controller, or numbers of shape "
            f"({n},) or (steps, {n}) are expected"
            + "; ClosedLoop(scene, 'NAME') makes controllers by name"
            * isinstance(control, str)
        )
    table = vector("control", np.zeros(count(joints)) if control is None else control, joints)
    if table.ndim == 2 and len(table) != ticks:
        raise InvalidInput(f"control has {len(table)} rows; the run {ticks} time steps of {dt} s")
    return np.ascontiguousarray(table)


def row(name: str, value: Any, joints: Joints) -> Array:
    """Check one row of finite numbers, by joint or count; it may be empty."""
    if joints == 0 and np.size(value) == 0:
        return np.zeros(0)
    given = vector(name, value, joints)
    if given.ndim != 1:
        raise InvalidInput(f"{name} has shape {given.shape}; expected {given.shape[1:]}")
    return given


def rows(name: str, value: Any, arms: int, joints: int) -> Array:
    """Check a row of finite numbers for each arm, shape (b, n)."""
    given = np.atleast_2d(vector(name, value, joints))
    if len(given) != arms:
        raise InvalidInput(f"{name} has {len(given)} rows; expected one for each of {arms} arms")
    return given


def whole(name: str, value: Any, least: int) -> None:
    """Reject anything but a whole number of at least ``least``."""
    if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < least:
        raise InvalidInput(f"{name} = {value!r}; expected a whole number of at least {least}")


def one_side(side: Any) -> int | None:
    """Check the side of a derivative: 1, -1, or None for one that both sides agree on."""
    if side is not None and (isinstance(side, bool) or side not in (1, -1)):
        raise InvalidInput(f"side = {side!r}; allowed: 1, -1 or None")
    return None if side is None else int(side)


def named(scene: Any) -> str:
    """Path or name of a scene that was given as one; else empty."""
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


def function_of_state(control: Callable[..., Any]) -> Callable[..., Any]:
    """Refuse a function that does not take a state alone; what has no signature is taken."""
    try:
        inspect.signature(control).bind(None)
    except TypeError:
        text = f"control = {control!r}: a function of one argument, the state, is expected"
        raise InvalidInput(text) from None
    except ValueError:
        pass
    return control


def clipping_message(model: ArmModel, joint: int, command: float, whose: str = "command") -> str:
    """The warning that a command beyond its limit is clipped.

    Args:
        model: The arm.
        joint: Index of the joint.
        command: The command.
        whose: Whose it is.
    """
    unit, limit = model.command_unit[joint], model.command_limit[joint]
    return (
        f"{whose} {command:.6g} {unit} of joint '{model.joint_names[joint]}' exceeds its limit of "
        f"{limit:.6g} {unit} and is clipped to it"
    )


class SaturationNotice:
    """Warns once that a command was clipped at its limit, and once that a servo's was.

    Attributes:
        logged: Whether the warning for commands was logged, or there are no limits.
    """

    def __init__(self, model: ArmModel) -> None:
        self._model = model
        self.logged = self._logged_for_servo = not np.isfinite(model.command_limit).any()
        self._compensated = gravity_compensated(model.scene)

    def check(self, command: Array, effort: Array, servo: bool = False) -> None:
        """Compare commands, or a servo's, with the effective ones, of shape (n,) or (k, n)."""
        # Comparing the bytes of a single row takes a tenth of the time; -0.0 is compared again.
        if (
            self._logged_for_servo if servo else self.logged
        ) or command.tobytes() == effort.tobytes():
            return
        cut = np.atleast_2d(command) != effort
        if self._compensated:  # the arm's gravity compensation changes commands, too
            cut &= abs(effort) >= self._model.command_limit
        if not cut.any():
            return
        joint = np.argmax(np.any(cut, axis=0))
        asked = np.atleast_2d(command)[:, joint]
        farthest, whose = asked[np.argmax(abs(asked))], "servo's command" if servo else "command"
        text = clipping_message(self._model, int(joint), float(farthest), whose)
        _log.warning("%s; reported once", text)
        if servo:
            self._logged_for_servo = True
        else:
            self.logged = True
