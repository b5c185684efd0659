# SPDX-License-Identifier: Apache-2.0
"""A Panda of known bodies and friction, measured with noise: are its numbers found?"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from arm_dynamics import ArmModel, Dynamics, Scene, load_scene
from arm_dynamics.arrays import Array
from arm_studies.identification import Excitation, JointRecord, Room, excite, identify
from arm_studies.identification.regression import bodies
from arm_studies.identification.regression.base_parameters import base_parameters
from arm_studies.identification.regression.regressor import EACH, RigidRegressor

RATE = 1000.0
PERIOD, PERIODS = 10.0, 6
NOISE, RESOLUTION = 0.05, 1e-4
"""Of torques, as a part of each joint's root mean square, and of positions in [rad]."""


@dataclass(frozen=True)
class Outcome:
    """Of one identification.

    Attributes:
        mass_error: Mean of the links' relative errors of mass.
        held: Whether each interval holds the truth, shape (intervals,).
        possible: Whether a body can have each link's numbers.
        seconds: Processor time.
        worst_joint: Largest torque error of a joint on the part held out.
    """

    mass_error: float
    held: Array
    possible: bool
    seconds: float
    worst_joint: float


def motion() -> Excitation:
    """The motion that all are measured in: it tells masses, within the Panda's limits."""
    room = Room(Dynamics("panda"), acceleration=10.0)
    return excite(room, period=PERIOD, aim="masses")


def outcome(nominal: Scene, excitation: Excitation, seed: int) -> Outcome:
    """Identify one robot, whose links are of other density than the nominal ones."""
    model, rng = ArmModel(nominal), np.random.default_rng(seed)
    regressor, n = RigidRegressor(model), model.n
    theta = regressor.nominal * np.repeat(rng.uniform(0.8, 1.2, len(regressor.bodies)), EACH)
    armature, viscous, coulomb = rng.uniform([[0.1], [0.5], [0.5]], [[0.4], [2.0], [2.0]], (3, n))
    t = np.arange(0.0, PERIOD * PERIODS, 1.0 / RATE)
    q, v, a = sampled(excitation, t)
    tau = torques(regressor, theta, q, v, a)
    tau += armature * a + viscous * v + coulomb * np.sign(v)
    tau += NOISE * np.sqrt((tau**2).mean(axis=0)) * rng.standard_normal(tau.shape)
    record = JointRecord.of(model.joint_names, t, RESOLUTION * np.round(q / RESOLUTION), tau)
    begun = time.process_time()
    found = identify(nominal, record, total_mass=float(theta[::EACH].sum()))
    seconds = time.process_time() - begun
    true = {f"{name}.viscous": viscous[j] for j, name in enumerate(model.joint_names)}
    true |= {f"{name}.coulomb": coulomb[j] for j, name in enumerate(model.joint_names)}
    true |= base_truth(regressor, theta, armature)
    told = {name: true.get(name, 0.0) for name in found.intervals}
    held = [low <= told[name] <= high for name, (low, high) in found.intervals.items()]
    masses = found.bodies[:, 0] / theta[::EACH] - 1.0
    return Outcome(
        float(abs(masses).mean()), np.array(held, float),
        all(bodies.possible(body) for body in found.bodies), seconds,
        max(found.torque_error.values()),
    )  # fmt: skip


def sampled(excitation: Excitation, t: Array) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration of the motion, over and over, shapes (k, n)."""
    states = [excitation.motion.sample(float(x)) for x in t[: round(PERIOD * RATE)]]
    q, v, a = (np.tile([getattr(s, key) for s in states], (PERIODS, 1)) for key in "qva")
    return q, v, a


def torques(regressor: RigidRegressor, theta: Array, q: Array, v: Array, a: Array) -> Array:
    """Torques of rigid bodies, some thousand rows at a time, shape (k, n)."""
    pieces = np.array_split(np.arange(len(q)), max(1, len(q) // 4000))
    return np.concatenate([regressor(q[i], v[i], a[i]) @ theta for i in pieces])


def base_truth(regressor: RigidRegressor, theta: Array, armature: Array) -> dict[str, float]:
    """True base parameters by the names that ``identify`` gives them."""
    n, names = len(armature), regressor.model.joint_names

    def columns(q: Array, v: Array, a: Array) -> Array:
        return np.concatenate([np.eye(n) * a[:, :, None], regressor(q, v, a)], axis=2)

    base = base_parameters(columns, n, [*(f"{x}.armature" for x in names), *regressor.names()])
    values = base.of(np.concatenate([armature, theta]))
    return dict(zip(base.names, values.tolist(), strict=True))


def nominal_scene() -> Scene:
    """The Panda as its description has it."""
    return load_scene("panda")
