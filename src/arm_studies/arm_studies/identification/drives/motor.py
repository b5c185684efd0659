# SPDX-License-Identifier: Apache-2.0
"""Parameters of a DC motor from records of voltage, current and speed.

The tests of the textbooks (Krause, Wasynczuk, Sudhoff, Analysis of Electric Machinery, 2002,
section 2.6), each of which determines some of the parameters:

* *blocked*: the rotor is held. V = R i + L di/dt gives R and L, a measured torque gives K_t.
* *free*: the motor runs under varying voltage. K_e follows from speed over voltage;
  J ω' + B ω + C sgn ω = K_t i gives inertia and friction relative to K_t.
* *coast*: the winding is open, i = 0. ω falls by B/J and C/J; a measured voltage is K_e ω.

In SI units K_t and K_e are equal, by the balance of power; if a torque is measured they are
identified separately. A first guess comes from the equations integrated from sample to sample,
linear in the parameters; then simulated currents and speeds are fitted to the measured ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, get_args

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.equations import motor
from arm_dynamics.exceptions import InvalidInput
from arm_studies.identification.drives.even_table import even_table, step_of
from arm_studies.identification.drives.law import Law, Trial
from arm_studies.identification.drives.matching import Match, match
from arm_studies.identification.regression.estimation import solved

Kind = Literal["blocked", "free", "coast"]
# Guesses of what records give no positive value of, in SI units: sizes of small motors.
_RESISTANCE, _CONSTANT, _INERTIA = 1.0, 0.1, 1e-4
# Most electric time constants L/R in a sampling interval: a faster current leaves no trace in it.
_FASTEST = 20.0
UNITS = {
    "resistance": "Ω", "inductance": "H", "torque_constant": "N m/A",
    "back_emf_constant": "V s/rad", "rotor_inertia": "kg m²", "rotor_damping": "N m s/rad",
    "coulomb": "N m",
}  # fmt: skip


@frozen
class MotorRecord:
    """A record of one test; arrays are read-only, and NaN where not measured.

    Attributes:
        kind: ``blocked``, ``free`` or ``coast``, see the module's docstring.
        time: At a constant step in [s], shape (k,).
        voltage: At the winding, constant between samples, in [V], shape (k,).
        current: In [A], shape (k,).
        speed: Of the rotor in [rad/s], shape (k,).
        torque: Measured at the blocked rotor in [N m], shape (k,).
        name: For messages.
    """

    kind: Kind
    time: Array
    voltage: Array
    current: Array
    speed: Array
    torque: Array
    name: str = "record"

    @classmethod
    def of(
        cls, kind: Kind, time: ArrayLike, *, voltage: ArrayLike | None = None,
        current: ArrayLike | None = None, speed: ArrayLike | None = None,
        torque: ArrayLike | None = None, name: str = "record",
    ) -> MotorRecord:  # fmt: skip
        """From arrays; None stands for what was not measured.

        Raises:
            InvalidInput: If times are not even, shapes differ, samples that the test needs are
                missing, or nothing varies.
        """
        if kind not in get_args(Kind):
            raise InvalidInput(f"kind = {kind!r}; allowed: {', '.join(get_args(Kind))}")
        values = {"voltage": voltage, "current": current, "speed": speed, "torque": torque}
        t, columns = even_table(name, time, values)
        needed = {"blocked": ("voltage", "current"), "free": ("voltage", "current", "speed"),
                  "coast": ("speed",)}[kind]  # fmt: skip
        for key in needed:
            if missing := int(np.sum(~np.isfinite(columns[key]))):
                raise InvalidInput(
                    f"{name}: a {kind} test needs {' and '.join(needed)}; {key} is missing in "
                    f"{missing} of {len(t)} samples"
                )
        if np.ptp(columns[needed[-1]]) == 0.0:
            raise InvalidInput(
                f"{name}: {needed[-1]} does not vary; a {kind} test in which it varies is expected"
            )
        return cls(kind, t, **columns, name=name)

    @property
    def dt(self) -> float:
        """Sampling interval in [s]."""
        return step_of(self.time)


def identify_motor(records: Sequence[MotorRecord]) -> Match:
    """Identify the parameters of a motor from any of the tests.

    Args:
        records: Of one motor.

    Returns:
        Those of ``UNITS`` that the tests involve; friction is that at the rotor.
        ``missing`` names those that the records do not determine.

    Raises:
        InvalidInput: If there is no record, or the records cannot be used.
    """
    if not records:
        raise InvalidInput("no record of a motor; at least one is expected")
    if all(r.kind == "coast" and not np.isfinite(r.voltage).any() for r in records):
        raise InvalidInput(
            "coasting alone determines only friction over inertia; a free or blocked test of the "
            "same motor is expected, or the voltage at the open winding"
        )
    has_two_constants = any(np.isfinite(record.torque).any() for record in records)
    guess = _guess(records, has_two_constants=has_two_constants)
    trials = [_trial(record, has_two_constants=has_two_constants) for record in records]
    return match(trials, guess)


@one_at_a_time
def _trial(record: MotorRecord, *, has_two_constants: bool) -> Trial:
    """The trial of a record, with a torque constant besides that of the back EMF or without."""
    parameters = {name: ca.SX.sym(name) for name in UNITS}
    if not has_two_constants:
        parameters["back_emf_constant"] = parameters["torque_constant"]
    R, L, Kt, Ke, J, B, C = parameters.values()
    i, w, V, direction = (ca.SX.sym(name) for name in ("i", "w", "V", "direction"))
    electric = motor.current_slope(V, i, motor.back_emf(w, Ke), L, R)
    friction = B * w + C * direction
    constant = "back_emf_constant" if has_two_constants else "torque_constant"
    if record.kind == "blocked":
        states, slope = {"current": i}, ca.substitute(electric, w, 0)
        outputs = states | {"torque": motor.torque(i, Kt) if has_two_constants else 0}
        names = ["resistance", "inductance", *(["torque_constant"] if has_two_constants else [])]
    elif record.kind == "coast":
        states, slope = {"speed": w}, -friction / J
        outputs = states | {"voltage": motor.back_emf(w, Ke)}
        names = ["rotor_inertia", "rotor_damping", "coulomb", constant]
    else:
        states = outputs = {"current": i, "speed": w}
        slope = ca.vertcat(electric, (motor.torque(i, Kt) - friction) / J)
        names = [name for name in UNITS if has_two_constants or name != "back_emf_constant"]
    x, u, y = (ca.vertcat(*parts) for parts in (states.values(), (V, direction), outputs.values()))
    law = Law(x, u, {name: parameters[name] for name in names}, slope, y)
    inputs = np.column_stack([np.nan_to_num(record.voltage), _direction(record)])
    measured = np.column_stack([getattr(record, name) for name in outputs])
    x0 = np.nan_to_num([getattr(record, name)[0] for name in states])
    return Trial(law, record.dt, inputs, measured, x0, np.zeros((1, len(x0))), record.name)


def _direction(record: MotorRecord) -> Array:
    """Which direction the rotor turns from each sample to the next: -1, 0 or 1."""
    w = np.nan_to_num(record.speed)
    return np.asarray(np.sign(w + np.append(w[1:], w[-1])))


def _guess(records: Sequence[MotorRecord], *, has_two_constants: bool) -> dict[str, float]:
    """Least squares on the equations integrated over each interval, currents by trapezoids."""
    electric, mechanical = [np.zeros((0, 4))], [np.zeros((0, 4))]
    for record in records:
        i, w, V = np.nan_to_num(record.current), np.nan_to_num(record.speed), record.voltage
        is_coasting = record.kind == "coast"
        i = np.zeros_like(i) if is_coasting else i
        mean_i, mean_w = (i[1:] + i[:-1]) / 2, (w[1:] + w[:-1]) / 2
        if np.isfinite(V).all():
            mean_V = (V[1:] + V[:-1]) / 2 if is_coasting else V[:-1]
            electric.append(np.column_stack([mean_i, np.diff(i) / record.dt, mean_w, mean_V]))
        if record.kind != "blocked":
            direction, rise = _direction(record)[:-1], np.diff(w) / record.dt
            mechanical.append(np.column_stack([rise, mean_w, direction, mean_i]))
    (R, L, Ke), (J, B, C) = (
        solved(table[:, :3], table[:, 3], 1e-9) if len(table := np.vstack(parts)) else np.zeros(3)
        for parts in (electric, mechanical)
    )
    R, Ke = R if R > 0.0 else _RESISTANCE, Ke if Ke > 0.0 else _CONSTANT
    Kt = _torque_constant(records) if has_two_constants else Ke
    J, B, C = Kt * np.array([J if J > 0.0 else _INERTIA / Kt, B, C])
    small = 1e-3 * J / max((r.time[-1] - r.time[0]) for r in records)
    dt = min(record.dt for record in records)
    guess = {
        "resistance": R, "inductance": max(L, R * dt / _FASTEST), "torque_constant": Kt,
        "back_emf_constant": Ke, "rotor_inertia": J, "rotor_damping": max(B, small),
        "coulomb": max(C, small),
    }  # fmt: skip
    return {name: float(value) for name, value in guess.items()}


def _torque_constant(records: Sequence[MotorRecord]) -> float:
    """Least squares on measured torques."""
    i, tau = (np.concatenate([getattr(r, x) for r in records]) for x in ("current", "torque"))
    both = np.isfinite(i) & np.isfinite(tau)
    slope = float(solved(i[both, None], tau[both])[0]) if both.any() else 0.0
    return slope if slope > 0.0 else _CONSTANT
