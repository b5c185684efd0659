# SPDX-License-Identifier: Apache-2.0
"""The controllers that compete, all tuned to one bandwidth on the model they know."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from arm_dynamics.control import Array, ComputedTorque
from arm_dynamics.control_joint import PD, PID, FeedForwardPD, JointImpedance, PDGravity, tuned
from arm_dynamics.control_run import AnyController, DisturbanceObserver
from arm_dynamics.control_task import AlongJoints, CartesianImpedance, OperationalSpace
from arm_sim.compare_controllers.cases import Arm

OMEGA = 15.0  # [rad/s], critically damped
_OBSERVER = 40.0  # [1/s]

type Builder = Callable[[Arm, float, Array], AnyController]


def _pd(arm: Arm, dt: float, limit: Array) -> AnyController:
    return PD(arm.nominal.n, *tuned(arm.nominal, OMEGA))


def _pid(arm: Arm, dt: float, limit: Array) -> AnyController:
    kp, kd = tuned(arm.nominal, OMEGA)
    return PID(arm.nominal.n, kp, kp * OMEGA / 3.0, kd, dt, limit)


def _pd_gravity(arm: Arm, dt: float, limit: Array) -> AnyController:
    return PDGravity(arm.nominal, *tuned(arm.nominal, OMEGA))


def _feed_forward(arm: Arm, dt: float, limit: Array) -> AnyController:
    return FeedForwardPD(arm.nominal, *tuned(arm.nominal, OMEGA))


def _computed_torque(arm: Arm, dt: float, limit: Array) -> AnyController:
    return ComputedTorque(arm.nominal, OMEGA)


def _observed(arm: Arm, dt: float, limit: Array) -> AnyController:
    inner = ComputedTorque(arm.nominal, OMEGA)
    return DisturbanceObserver(inner, arm.nominal, dt, _OBSERVER, limit)


def _joint_impedance(arm: Arm, dt: float, limit: Array) -> AnyController:
    return JointImpedance(arm.nominal, tuned(arm.nominal, OMEGA)[0], 1.0)


def _operational_space(arm: Arm, dt: float, limit: Array) -> AnyController:
    control = OperationalSpace(arm.task, OMEGA, posture_bandwidth=OMEGA, friction=True)
    return AlongJoints(control, arm.task)


def _cartesian_impedance(arm: Arm, dt: float, limit: Array) -> AnyController:
    inertia = arm.task.terms(arm.nominal.model.q0).inertia
    stiffness = OMEGA**2 / np.linalg.inv(inertia).diagonal()
    control = CartesianImpedance(
        arm.task, stiffness, 1.0, posture_bandwidth=OMEGA, friction=True
    )
    return AlongJoints(control, arm.task)


CONTENDERS: dict[str, Builder] = {
    "PD": _pd,
    "PID": _pid,
    "PD + gravity": _pd_gravity,
    "feed-forward + PD": _feed_forward,
    "computed torque": _computed_torque,
    "computed torque + observer": _observed,
    "operational space": _operational_space,
    "joint impedance": _joint_impedance,
    "Cartesian impedance": _cartesian_impedance,
}
