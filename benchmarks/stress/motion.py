# SPDX-License-Identifier: Apache-2.0
"""What an arm really does: an error-controlled run at tight tolerance, checked by another method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from arm_dynamics import ArmError, ArmModel
from arm_sim import Recording, Simulator
from benchmarks.stress.arms import Arm
from benchmarks.stress.balances import energy_balance

HORIZON = 0.2  # [s]
GRID = 1e-2  # [s] between the instants that are compared; every tick divides it
TICK = 1e-4  # [s] of the reference
METHOD, TOLERANCE = "dop853", 1e-12
OTHER_METHOD, OTHER_TOLERANCE = "dopri5", 1e-10
TURNS = 1000.0  # after so many turns of its fastest link there is nothing more to learn
KNOWN = 1e-4  # disagreement of the two beyond which the motion is chaos and has no known end
Vector = np.ndarray


@dataclass(frozen=True)
class Motion:
    """A reference motion.

    Attributes:
        horizon: how long it lasts [s], a multiple of ``GRID``.
        q: positions every ``GRID``, shape (k+1, n); None if it cannot be computed.
        speed: largest |v| of each joint, shape (n,).
        kinetic: largest kinetic energy [J].
        rate: of the fastest change in it [1/s].
        balance: energy from nowhere, relative to what is exchanged.
        doubt: largest difference to the other method, relative to 1 + |q|.
        message: why it cannot be computed, or ends early.
    """

    horizon: float
    q: Vector | None = None
    speed: Vector | None = None
    kinetic: float = 0.0
    rate: float = 0.0
    balance: float = 0.0
    doubt: float = np.inf
    message: str = ""

    @property
    def known(self) -> bool:
        """Whether errors can be measured against it."""
        return self.doubt <= KNOWN


def solve(arm: Arm, model: ArmModel, backend: str = "auto", horizon: float = HORIZON) -> Motion:
    """Compute the reference motion of an arm.

    Args:
        arm: the arm.
        model: of it.
        backend: of the simulator.
        horizon: how long to follow it [s]; less if it turns too often or cannot be computed.
    """
    simulator = Simulator(model, METHOD, TICK, TOLERANCE, backend)
    parts, turned, message = [], 0.0, ""
    simulator.reset(arm.q, arm.v)
    while len(parts) < round(horizon / GRID) and turned < TURNS:
        try:
            parts.append(simulator.run(GRID, arm.tau))
        except ArmError as error:
            message = str(error)
            break
        turned += GRID * _turning(model, parts[-1]) / (2 * np.pi)
    if not parts:
        return Motion(horizon, message=message)
    return _described(arm, model, parts, message, backend)


def _described(
    arm: Arm, model: ArmModel, parts: list[Recording], message: str, backend: str
) -> Motion:
    horizon = len(parts) * GRID
    q = np.array([parts[0].q[0], *(part.q[-1] for part in parts)])
    v = np.vstack([part.v for part in parts])
    speed = np.abs(v).max(axis=0)
    return Motion(
        horizon, q, speed,
        kinetic=max(float(part.kinetic.max()) for part in parts),
        rate=max(arm.rate, _change(v, speed), max(_turning(model, part) for part in parts)),
        balance=max(energy_balance(part) for part in parts),
        doubt=_doubt(arm, model, q, horizon, backend),
        message=message,
    )  # fmt: skip


def _change(v: Vector, speed: Vector) -> float:
    """Fastest change of a joint's speed, relative to its top speed [1/s]."""
    gained = np.abs(np.diff(v, axis=0)).max(axis=0) / TICK
    return float(np.max(gained / np.maximum(speed, 1e-12)))


def _turning(model: ArmModel, run: Recording) -> float:
    """Angular speed of the fastest link [rad/s], at ten instants of the run."""
    data, top = model.pin.createData(), 0.0
    rows = slice(0, None, max(1, len(run) // 10))
    pairs = zip(model.configuration(run.q[rows]), model.spread(run.v[rows]), strict=True)
    for q, v in pairs:
        pin.forwardKinematics(model.pin, data, q, v)
        top = max(top, *(float(np.linalg.norm(link.angular)) for link in data.v))
    return top


def _doubt(arm: Arm, model: ArmModel, q: Vector, horizon: float, backend: str) -> float:
    try:
        simulator = Simulator(model, OTHER_METHOD, GRID, OTHER_TOLERANCE, backend)
        simulator.reset(arm.q, arm.v)
        return difference(simulator.run(horizon, arm.tau).q, q)
    except ArmError:
        return np.inf


def difference(q: Vector, wanted: Vector) -> float:
    """Largest difference of positions, relative to 1 + |q|."""
    return float(np.max(np.abs(q - wanted) / (1 + np.abs(wanted))))
