# SPDX-License-Identifier: Apache-2.0
"""What an arm really does: a run under tight error control, checked by another method."""

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
NUDGE = 1e-7  # of the start, relative to 1 + |x|, to see how sensitive the motion is
STEADY = 1e3  # a motion that magnifies a nudge by more leaves the true one whatever the method
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
        travel: how far it goes, relative to 1 + |q|.
        balance: energy from nowhere, relative to what is exchanged.
        doubt: largest difference to the other method, relative to 1 + |q|.
        sensitivity: by how much it magnifies a nudge of the start.
        finite: whether every number of it is.
        message: why it cannot be computed, or ends early.
    """

    horizon: float
    q: Vector | None = None
    speed: Vector | None = None
    kinetic: float = 0.0
    rate: float = 0.0
    travel: float = 0.0
    balance: float = 0.0
    doubt: float = np.inf
    sensitivity: float = np.inf
    finite: bool = True
    message: str = ""

    @property
    def known(self) -> bool:
        """Whether errors can be measured against it."""
        return self.doubt <= KNOWN

    @property
    def steady(self) -> bool:
        """Whether errors grow so little that a method has to answer for them."""
        return self.known and self.sensitivity < STEADY


def solve(arm: Arm, model: ArmModel, backend: str = "auto", horizon: float = HORIZON) -> Motion:
    """Compute the reference motion of an arm.

    Args:
        arm: the arm.
        model: of it.
        backend: of the simulator.
        horizon: how long to follow it [s]; less if it turns too often or cannot be computed.
    """
    parts, message = _followed(arm, model, backend, horizon)
    if not parts:
        return Motion(horizon, message=message)
    if not all(np.isfinite([part.q, part.v]).all() for part in parts):
        return Motion(horizon, finite=False, message="the reference is not finite")
    q = np.array([parts[0].q[0], *(part.q[-1] for part in parts)])
    v = np.vstack([part.v for part in parts])
    speed = np.abs(v).max(axis=0)
    doubt, sensitivity = _checked(arm, model, q, backend)
    return Motion(
        len(parts) * GRID, q, speed,
        kinetic=max(float(part.kinetic.max()) for part in parts),
        rate=max(arm.rate, _change(v, speed), max(_turning(model, part) for part in parts)),
        travel=difference(q, q[0]),
        balance=max(energy_balance(part) for part in parts),
        doubt=doubt, sensitivity=sensitivity, message=message,
    )  # fmt: skip


def difference(q: Vector, wanted: Vector) -> float:
    """Largest difference of positions, relative to 1 + |q|."""
    return float(np.max(np.abs(q - wanted) / (1 + np.abs(wanted))))


def _followed(
    arm: Arm, model: ArmModel, backend: str, horizon: float
) -> tuple[list[Recording], str]:
    """The motion in pieces of ``GRID``, and why it ends before the horizon, if it cannot go on."""
    simulator = Simulator(model, METHOD, TICK, TOLERANCE, backend)
    simulator.reset(arm.q, arm.v)
    parts: list[Recording] = []
    turned = 0.0
    while len(parts) < round(horizon / GRID) and turned < TURNS:
        try:
            parts.append(simulator.run(GRID, arm.tau))
        except ArmError as error:
            return parts, str(error)
        turned += GRID * _turning(model, parts[-1]) / (2 * np.pi)
    return parts, ""


def _checked(arm: Arm, model: ArmModel, q: Vector, backend: str) -> tuple[float, float]:
    """Difference to another method, and how much that one magnifies a nudge of the start."""
    simulator = Simulator(model, OTHER_METHOD, GRID, OTHER_TOLERANCE, backend)
    duration, nudge = (len(q) - 1) * GRID, NUDGE * np.where(np.arange(arm.n) % 2, 1.0, -1.0)
    try:
        simulator.reset(arm.q, arm.v)
        other = simulator.run(duration, arm.tau).q
        simulator.reset(arm.q + nudge * (1 + abs(arm.q)), arm.v - nudge * (1 + abs(arm.v)))
        nudged = simulator.run(duration, arm.tau).q
    except ArmError:
        return np.inf, np.inf
    return difference(other, q), difference(nudged, other) / NUDGE


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
