# SPDX-License-Identifier: Apache-2.0
"""LuGre friction of one joint, from torques and small motions.

Below breakaway a joint moves as on a spring and a damper, σ0 and σ1; sliding determines the levels
Fc and Fs, the Stribeck velocity and viscous friction (Canudas de Wit, Lischinsky, "Adaptive
friction compensation with partially known dynamic friction model", Int. J. Adaptive Control 11,
1997, section 3). The law is that of ``equations.lugre``; the inertia of the joint is identified
with it. Gravity must not act on the axis, or its torque must be subtracted.
"""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.equations import friction, lugre
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_studies.identification.drives.even_table import check_motion, even_table, step_of
from arm_studies.identification.drives.law import Law, Trial
from arm_studies.identification.drives.matching import Match, match
from arm_studies.identification.regression.estimation import solved

_WINDOW = 40  # samples of a part that is simulated at a time
# Error of the simulation, and its longest step, where |v| has a kink as the motion turns
_KINK_ERROR, _KINK_STEP = 2e-5, 0.04
UNITS = {
    "inertia": "kg m²", "sigma0": "N m/rad", "sigma1": "N m s/rad", "coulomb": "N m",
    "static": "N m", "stribeck_velocity": "rad/s", "viscous": "N m s/rad",
}  # fmt: skip


@frozen
class SmallMotion:
    """A record of a joint under small torques; arrays are read-only.

    Attributes:
        time: At a constant step in [s], shape (k,).
        torque: Constant between samples, in [N m], shape (k,).
        position: In [rad], shape (k,).
        name: For messages.
    """

    time: Array
    torque: Array
    position: Array
    name: str = "record"

    @classmethod
    def of(
        cls, time: ArrayLike, torque: ArrayLike, position: ArrayLike, name: str = "record"
    ) -> SmallMotion:
        """From arrays.

        Raises:
            InvalidInput: If times are not even, shapes differ, numbers are missing, or nothing
                varies.
        """
        t, columns = even_table(name, time, {"torque": torque, "position": position})
        check_motion(name, columns)
        return cls(t, **columns, name=name)

    @property
    def dt(self) -> float:
        """Sampling interval in [s]."""
        return step_of(self.time)

    @property
    def velocity(self) -> Array:
        """Differences of the positions in [rad/s], shape (k,)."""
        return np.gradient(self.position, self.dt)


@one_at_a_time
def identify_bristles(
    records: list[SmallMotion], guess: Mapping[str, float] | None = None
) -> Match:
    """Identify the parameters of the LuGre model, and the inertia of the joint.

    Args:
        records: Of one joint: motions below breakaway determine σ0 and σ1, those beyond the rest.
        guess: First guesses to use instead of those from the records; see ``UNITS``.

    Returns:
        All of ``UNITS``; ``missing`` names those that the records do not determine.

    Raises:
        InvalidInput: If there is no record, or a guess is of an unknown parameter or not positive.
    """
    if not records:
        raise InvalidInput("no record of small motions; at least one is expected")
    if unknown := set(guess or {}) - set(UNITS):
        raise InvalidInput(
            f"guess: unknown parameter {known_names(unknown)}; allowed: {known_names(UNITS)}"
        )
    parameters = {name: ca.SX.sym(name) for name in UNITS}
    J, s0, s1, Fc, Fs, vs, s2 = parameters.values()
    q, v, z, tau = (ca.SX.sym(name) for name in "qvzt")
    rate = lugre.bending(v, z, s0, friction.dry(v, 1.0, Fc, Fs - Fc, vs))
    resistance = lugre.torque(z, rate, s0, s1) + friction.viscous(v, s2)
    slope = ca.vertcat(v, (tau - resistance) / J, rate)
    law = Law(ca.vertcat(q, v, z), tau, parameters, slope, q, _KINK_ERROR, _KINK_STEP)
    by_size = sorted(records, key=lambda record: float(np.ptp(record.position)))
    start = _guess(by_size[0], by_size[-1]) | dict(guess or {})
    if len(records) > 1:  # the fit of the smallest motion is a better guess for the others
        start |= match(_windows(by_size[0], law, start), start).values
    return match([trial for r in records for trial in _windows(r, law, start)], start)


def _windows(record: SmallMotion, law: Law, start: Mapping[str, float]) -> list[Trial]:
    """Short parts of a record, each with an initial state of its own.

    A stick-slip motion diverges quickly when a parameter changes a little; within a window it does
    not (multiple shooting: Bock, "Recent advances in parameter identification techniques for
    O.D.E.", 1983).
    """
    v, tau = record.velocity, record.torque
    limit = start["static"] / start["sigma0"]
    deflection = (tau - start["inertia"] * np.gradient(v, record.dt)) / start["sigma0"]
    x0 = np.column_stack([record.position, v, np.clip(deflection, -limit, limit)])
    typical_states = np.array([[0.0, speed, 0.0] for speed in (0.0, abs(v).max())])
    count = max(1, len(v) // _WINDOW)
    size = len(v) // count
    rows = [slice(k * size, (k + 1) * size) for k in range(count)]
    return [
        Trial(law, record.dt, tau[part, None], record.position[part, None], x0[part.start],
              typical_states, f"{record.name}, from {record.time[part.start]:.4g} s")
        for part in rows
    ]  # fmt: skip


def _guess(narrow_motion: SmallMotion, wide_motion: SmallMotion) -> dict[str, float]:
    """First guesses: orders of magnitude, from which the fit converges.

    Least squares on the sticking motion, and on the fastest part of the widest one.
    """
    q, tau = narrow_motion.position, narrow_motion.torque
    acceleration = np.gradient(narrow_motion.velocity, narrow_motion.dt)
    table = np.column_stack([acceleration, narrow_motion.velocity, q, np.ones_like(q)])
    J, s1, s0, _ = solved(table, tau, 1e-12)
    s0 = s0 if s0 > 0.0 else float(np.ptp(tau) / np.ptp(q))
    J = J if J > 0.0 else s0 * narrow_motion.dt**2  # it swings on its bristles within some samples
    v = wide_motion.velocity
    is_fast = abs(v) > 0.2 * abs(v).max()  # where its sign is certain
    columns = np.column_stack([np.gradient(v, wide_motion.dt), np.sign(v), v])[is_fast]
    J_wide, Fc, s2 = np.linalg.lstsq(columns, wide_motion.torque[is_fast], rcond=1e-12)[0]
    # Bristles alone give way by the range of torques over σ0.
    is_sliding = np.ptp(wide_motion.position) > 3.0 * np.ptp(wide_motion.torque) / s0
    if not is_sliding or Fc <= 0.0:
        Fc = 1.5 * float(abs(wide_motion.torque).max())  # breakaway is beyond all of these torques
    elif J_wide > 0.0:
        J = J_wide
    damp = 0.3 * np.sqrt(s0 * J)  # a damping ratio of 0.15; one above 0.45 is not believed
    guess = {
        "inertia": J, "sigma0": s0, "sigma1": s1 if 0.0 < s1 < 3.0 * damp else damp,
        "coulomb": Fc, "static": 1.3 * Fc,
        # Friction falls at speeds that were seen, if it slides, else above them.
        "stribeck_velocity": (0.3 if is_sliding else 3.0) * abs(v).max(),
        "viscous": s2 if is_sliding and s2 > 0.0 else 0.1 * damp,
    }  # fmt: skip
    return {name: float(value) for name, value in guess.items()}
