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
from arm_studies.identification.drives.evenly import even_table
from arm_studies.identification.drives.matching import Law, Match, Trial, match
from arm_studies.identification.regression.estimation import solved

Kind = Literal["blocked", "free", "coast"]
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
        given = {"voltage": voltage, "current": current, "speed": speed, "torque": torque}
        t, columns = even_table(name, time, given)
        made = cls(kind, t, **columns, name=name)
        made._check()
        return made

    @property
    def dt(self) -> float:
        """Sampling interval in [s]."""
        return float((self.time[-1] - self.time[0]) / (len(self.time) - 1))

    def _check(self) -> None:
        needed = {"blocked": ("voltage", "current"), "free": ("voltage", "current", "speed"),
                  "coast": ("speed",)}[self.kind]  # fmt: skip
        for key in needed:
            column = getattr(self, key)
            if not np.all(np.isfinite(column)):
                missing = int(np.sum(~np.isfinite(column)))
                raise InvalidInput(
                    f"{self.name}: a {self.kind} test needs {' and '.join(needed)}; {key} is "
                    f"missing in {missing} of {len(column)} samples"
                )
        if np.ptp(getattr(self, needed[-1])) == 0.0:
            raise InvalidInput(
                f"{self.name}: {needed[-1]} does not vary; a {self.kind} test in which it varies "
                "is expected"
            )


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
    if any(r.kind == "coast" for r in records) and all(
        r.kind == "coast" and not np.isfinite(r.voltage).any() for r in records
    ):
        raise InvalidInput(
            "coasting alone determines only friction over inertia; a free or blocked test of the "
            "same motor is expected, or the voltage at the open winding"
        )
    apart = any(np.isfinite(record.torque).any() for record in records)
    guess = _guess(records, apart)
    return match([_trial(record, apart) for record in records], guess)


@one_at_a_time
def _trial(record: MotorRecord, apart: bool) -> Trial:
    """The trial of a record: its model, inputs and outputs."""
    y = np.column_stack([record.current, record.speed, record.voltage, record.torque])
    u = np.column_stack([np.nan_to_num(record.voltage), _direction(record)])
    states, outputs = {"blocked": ([0], [0, 3]), "coast": ([1], [1, 2])}.get(
        record.kind, ([0, 1], [0, 1])
    )
    x0 = np.nan_to_num(y[0])[states]
    law = _law_of(record.kind, apart)
    return Trial(law, record.dt, u, y[:, outputs], x0, np.zeros((1, len(x0))), record.name)


def _law_of(kind: Kind, apart: bool) -> Law:
    """The model of a test; ``apart``: with a torque constant besides that of the back EMF."""
    R, L, Kt, Ke, J, B, C = (ca.SX.sym(name) for name in UNITS)
    Ke = Ke if apart else Kt
    i, w, V, way = (ca.SX.sym(name) for name in ("i", "w", "V", "way"))
    electric = motor.current_slope(V, i, motor.back_emf(w, Ke), L, R)
    friction = B * w + C * way
    if kind == "blocked":
        slope = ca.substitute(electric, w, 0)
        outputs = ca.vertcat(i, motor.torque(i, Kt) if apart else 0)
        return _law(i, (V, way), slope, outputs, {"resistance": R, "inductance": L} | (
            {"torque_constant": Kt} if apart else {}))  # fmt: skip
    if kind == "coast":
        slope = -friction / J
        outputs = ca.vertcat(w, motor.back_emf(w, Ke))
        numbers = {"rotor_inertia": J, "rotor_damping": B, "coulomb": C}
        numbers |= {"back_emf_constant": Ke} if apart else {"torque_constant": Kt}
        return _law(w, (V, way), slope, outputs, numbers)
    slope = ca.vertcat(electric, (motor.torque(i, Kt) - friction) / J)
    numbers = dict(zip(UNITS, (R, L, Kt, Ke, J, B, C), strict=True))
    if not apart:
        del numbers["back_emf_constant"]
    return _law(ca.vertcat(i, w), (V, way), slope, ca.vertcat(i, w), numbers)


def _law(
    x: ca.SX, u: tuple[ca.SX, ca.SX], slope: ca.SX, outputs: ca.SX, numbers: dict[str, ca.SX]
) -> Law:
    p = ca.vertcat(*numbers.values())
    return Law(x, ca.vertcat(*u), p, slope, outputs, tuple(numbers))


def _direction(record: MotorRecord) -> Array:
    """Which way the rotor turns from each sample to the next: -1, 0 or 1."""
    w = np.nan_to_num(record.speed)
    way: Array = np.sign(w + np.append(w[1:], w[-1]))
    return way


def _guess(records: Sequence[MotorRecord], apart: bool) -> dict[str, float]:
    """Least squares on the equations integrated over each interval, currents by trapezoids."""
    electric = [_electric(record) for record in records if np.isfinite(record.voltage).all()]
    R, L, Ke = _solved(electric, 3)
    dt = min(record.dt for record in records)
    R = R if R > 0.0 else 1.0
    Ke = Ke if Ke > 0.0 else 0.1
    Kt = _torque_over_current(records) if apart else Ke
    mechanical = [_mechanical(record) for record in records if record.kind != "blocked"]
    J, B, C = Kt * _solved(mechanical, 3)
    J = J if J > 0.0 else 1e-4
    small = 1e-3 * J / max((r.time[-1] - r.time[0]) for r in records)
    found = {
        "resistance": R, "inductance": max(L, R * dt / 20.0), "torque_constant": Kt,
        "back_emf_constant": Ke, "rotor_inertia": J, "rotor_damping": max(B, small),
        "coulomb": max(C, small),
    }  # fmt: skip
    return {name: float(value) for name, value in found.items()}


def _electric(record: MotorRecord) -> Array:
    """Columns of mean current, its slope, mean speed and voltage in each interval."""
    V, (mean_i, mean_w) = record.voltage, _means(record)
    if record.kind == "coast":
        return np.column_stack([mean_i, np.zeros_like(mean_i), mean_w, (V[1:] + V[:-1]) / 2])
    slope = np.diff(np.nan_to_num(record.current)) / record.dt
    return np.column_stack([mean_i, slope, mean_w, V[:-1]])


def _mechanical(record: MotorRecord) -> Array:
    """Columns of acceleration, mean speed, direction and mean current in each interval."""
    mean_i, mean_w = _means(record)
    acceleration = np.diff(np.nan_to_num(record.speed)) / record.dt
    return np.column_stack([acceleration, mean_w, _direction(record)[:-1], mean_i])


def _means(record: MotorRecord) -> tuple[Array, Array]:
    """Mean current, none while it coasts, and mean speed in each interval."""
    i, w = np.nan_to_num(record.current), np.nan_to_num(record.speed)
    mean_i = (i[1:] + i[:-1]) / 2
    return np.zeros_like(mean_i) if record.kind == "coast" else mean_i, (w[1:] + w[:-1]) / 2


def _solved(parts: list[Array], count: int) -> Array:
    """Least-squares coefficients of the first columns for the last; zeros without any row."""
    if not parts:
        return np.zeros(count)
    table = np.vstack(parts)
    return solved(table[:, :count], table[:, count], 1e-9)


def _torque_over_current(records: Sequence[MotorRecord]) -> float:
    i, tau = (np.concatenate([getattr(r, key) for r in records]) for key in ("current", "torque"))
    both = np.isfinite(i) & np.isfinite(tau)
    power = float(i[both] @ i[both])
    slope = float(i[both] @ tau[both]) / power if power else 0.0
    return slope if slope > 0.0 else 0.1
