# SPDX-License-Identifier: Apache-2.0
"""Stiffness and damping of a flexible joint, from the motor's torque and the angles at its ends.

Two tests: the link *held*, so that the motor swings against the transmission alone; or *free*,
with the angle of the link measured as well, on an axis without gravity load. The law is that of
``equations.transmission``, k δ + k₃ δ³ + d δ' for a twist δ = θ - q (Spong, "Modeling and control
of elastic joint robots", ASME J. Dyn. Sys. Meas. Control 109, 1987); angles and torques of the
motor are reflected to the joint.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.equations import transmission
from arm_studies.identification.drives.even_table import check_motion, even_table, step_of
from arm_studies.identification.drives.law import Law, Trial
from arm_studies.identification.drives.matching import Match, match

UNITS = {
    "stiffness": "N m/rad", "damping": "N m s/rad", "motor_inertia": "kg m²",
    "motor_damping": "N m s/rad", "link_inertia": "kg m²", "link_damping": "N m s/rad",
}  # fmt: skip
# First guesses where least squares give none above zero: an inertia in [kg m²]; the time constant
# of the swing in samples, which have to resolve it; and the smallest damping relative to that of
# √(stiffness · inertia), since a parameter at zero could not be searched by its logarithm.
_INERTIA, _SWING, _DAMPING = 0.1, 20.0, 0.01


@frozen
class JointTest:
    """A record of a flexible joint; arrays are read-only.

    Attributes:
        time: At a constant step in [s], shape (k,).
        torque: Of the motor, reflected to the joint, constant between samples, in [N m], (k,).
        motor: Angle of the motor, reflected to the joint, in [rad], shape (k,).
        link: Angle of the link in [rad], shape (k,); NaN where the link was held.
        name: For messages.
    """

    time: Array
    torque: Array
    motor: Array
    link: Array
    name: str = "record"

    @classmethod
    def of(
        cls, time: ArrayLike, torque: ArrayLike, motor: ArrayLike, link: ArrayLike | None = None,
        name: str = "record",
    ) -> JointTest:  # fmt: skip
        """From arrays; no ``link`` if it was held.

        Raises:
            InvalidInput: If times are not even, shapes differ, numbers are missing, or nothing
                varies.
        """
        values = {"torque": torque, "motor": motor, "link": link}
        t, columns = even_table(name, time, values)
        check_motion(name, {key: columns[key] for key in values if values[key] is not None})
        return cls(t, **columns, name=name)


@one_at_a_time
def identify_joint(record: JointTest) -> Match:
    """Identify stiffness, damping and inertias of a flexible joint.

    With the link held, damping of the transmission and of the motor cannot be separated and count
    as that of the transmission.

    Args:
        record: The test.

    Returns:
        Those of ``UNITS`` that the test involves; ``missing`` names those that it does not
        determine.
    """
    is_held, dt = not np.isfinite(record.link).any(), step_of(record.time)
    trial = _held_trial(record, dt) if is_held else _free_trial(record, dt)
    return match([trial], _guess(record, dt, is_held=is_held))


def _held_trial(record: JointTest, dt: float) -> Trial:
    """The motor swings against the link, which stands still at an unknown angle q."""
    names = "stiffness", "damping", "motor_inertia"
    k, d, Jm = (ca.SX.sym(name) for name in names)
    th, om, q, tau = (ca.SX.sym(name) for name in ("th", "om", "q", "tau"))
    slope = ca.vertcat(om, (tau - transmission.elastic_torque(th - q, k, 0.0) - d * om) / Jm, 0)
    parameters = dict(zip(names, (k, d, Jm), strict=True))
    law = Law(ca.vertcat(th, om, q), tau, parameters, slope, th)
    # Held about the middle of its swing.
    x0 = np.array([record.motor[0], np.diff(record.motor[:2])[0] / dt, record.motor.mean()])
    y = record.motor[:, None]
    return Trial(law, dt, record.torque[:, None], y, x0, np.zeros((1, 3)), record.name)


def _free_trial(record: JointTest, dt: float) -> Trial:
    """Motor and link swing against each other."""
    parameters = {name: ca.SX.sym(name) for name in UNITS}
    k, d, Jm, Bm, Jl, Bl = parameters.values()
    th, om, q, v, tau = (ca.SX.sym(name) for name in ("th", "om", "q", "v", "tau"))
    joint_torque = transmission.elastic_torque(th - q, k, 0.0) + d * (om - v)
    slope = ca.vertcat(om, (tau - joint_torque - Bm * om) / Jm, v, (joint_torque - Bl * v) / Jl)
    law = Law(ca.vertcat(th, om, q, v), tau, parameters, slope, ca.vertcat(th, q))
    y = np.column_stack([record.motor, record.link])
    (th0, q0), (om0, v0) = y[0], np.diff(np.nan_to_num(y[:2]), axis=0)[0] / dt
    x0 = np.array([th0, om0, np.nan_to_num(q0), v0])
    return Trial(law, dt, record.torque[:, None], y, x0, np.zeros((1, 4)), record.name)


def _guess(record: JointTest, dt: float, *, is_held: bool) -> dict[str, float]:
    """Least squares on the equations of motion with differences for velocities."""
    angles = np.column_stack([record.motor, np.nan_to_num(record.link)])
    speed, link_speed = ((angles[2:] - angles[:-2]) / (2 * dt)).T
    acceleration, link_acceleration = (np.diff(angles, 2, axis=0) / dt**2).T
    # Constant from sample to sample: at a sample, the mean of the steps before and after it.
    torque, zero = (record.torque[:-2] + record.torque[1:-1]) / 2.0, np.zeros_like(speed)
    if is_held:
        columns = [record.motor[1:-1], speed, acceleration, zero + 1.0]
        solution = np.linalg.lstsq(np.column_stack(columns), torque, rcond=1e-12)[0]
        (stiffness, damping, inertia, _), link_inertia = solution, _INERTIA
    else:
        twist, rate = angles[1:-1, 0] - angles[1:-1, 1], speed - link_speed
        motor = np.column_stack([twist, rate, acceleration, speed, zero, zero])
        link = np.column_stack([-twist, -rate, zero, zero, link_acceleration, link_speed])
        table, y = np.vstack([motor, link]), np.concatenate([torque, zero])
        stiffness, damping, inertia, _, link_inertia, _ = np.linalg.lstsq(table, y, rcond=1e-12)[0]
    inertia, link_inertia = (x if x > 0.0 else _INERTIA for x in (inertia, link_inertia))
    stiffness = stiffness if stiffness > 0.0 else inertia / (_SWING * dt) ** 2
    least_damping = _DAMPING * np.sqrt(stiffness * inertia)
    return {
        "stiffness": float(stiffness), "damping": float(max(damping, least_damping)),
        "motor_inertia": float(inertia), "motor_damping": float(least_damping),
        "link_inertia": float(link_inertia), "link_damping": float(least_damping),
    }  # fmt: skip
