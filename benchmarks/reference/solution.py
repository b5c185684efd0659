# SPDX-License-Identifier: Apache-2.0
"""The motion that every error is measured against, and how far it can be trusted."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

from benchmarks.peers.base import TICK
from benchmarks.reference.closed_loop import Loop
from benchmarks.reference.extended_precision import REAL, torque_free
from benchmarks.reference.extrapolation import integrate
from benchmarks.robots.models import Robot

AGREED = 1e-13  # [rad] between a run and the run with half its step
COLUMNS = 7
Vector = np.ndarray


@dataclass(frozen=True)
class Truth:
    """A reference motion and its two checks."""

    q: Vector  # positions; (n,) at the end of a free motion, (ticks + 1, n) of a closed loop [rad]
    halving: float  # largest change of q when the step is halved [rad]
    other: float  # largest difference to another method on Pinocchio in double precision [rad]


def free_motion(robot: Robot, doublings: int = 4) -> Truth:
    """Free motion in extended precision; the step is halved until the end no longer moves."""
    f = torque_free(robot.pin)
    x0 = np.concatenate([robot.q0, np.zeros(robot.n)]).astype(REAL)
    steps = round(200 * robot.duration)
    x = integrate(f, x0, robot.duration, steps, COLUMNS)
    for _ in range(doublings):
        steps *= 2
        finer = integrate(f, x0, robot.duration, steps, COLUMNS)
        halving = float(np.abs(finer - x)[: robot.n].max())
        x = finer
        if halving < AGREED:
            break
    q = x[: robot.n].astype(float)
    f = _right_hand_side(robot, np.zeros(robot.n))
    tight = {"method": "DOP853", "rtol": 3e-14, "atol": 3e-14}
    end = solve_ivp(lambda _t, x: f(x), (0.0, robot.duration), x0.astype(float), **tight).y[:, -1]
    return Truth(q, halving, float(np.abs(end[: robot.n] - q).max()))


def closed_loop(robot: Robot, loop: Loop) -> Truth:
    """The controlled motion, torque held for each tick, the plant solved to rounding."""
    q = _held(robot, loop, 1, 4)
    finer = _held(robot, loop, 2, 4)
    other = _held(robot, loop, 1, 3)
    return Truth(q, float(np.abs(finer - q).max()), float(np.abs(other - q).max()))


def _held(robot: Robot, loop: Loop, steps: int, columns: int) -> Vector:
    n = robot.n
    history = [robot.q0]
    x = np.concatenate([robot.q0, np.zeros(n)])
    for k in range(loop.ticks):
        f = _right_hand_side(robot, loop.torque(k, x[:n], x[n:]))
        x = integrate(f, x, TICK, steps, columns)
        history.append(x[:n])
    return np.array(history)


def _right_hand_side(robot: Robot, tau: Vector) -> Callable[[Vector], Vector]:
    n, model, data = robot.n, robot.pin, robot.pin.createData()

    def rhs(x: Vector) -> Vector:
        return np.concatenate([x[n:], pin.aba(model, data, x[:n], x[n:], tau)])

    return rhs
