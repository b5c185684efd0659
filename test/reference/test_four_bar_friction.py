# SPDX-License-Identifier: Apache-2.0
"""A four-bar with Coulomb friction in every hinge against its one coordinate.

The linkage is reduced to its crank by hand: knee and rocker follow from the two equations of the
loop, in closed form. What remains, one equation whose friction jumps where a hinge reverses, is
solved by DOP853 between reversals that are located as events.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.integrate import solve_ivp

import models
from arm_dynamics import load_scene
from arm_sim import Recording, Simulator
from models.oracle import Oracle
from tolerances import assert_close

CRANK, COUPLER, ROCKER, GROUND = 0.1, 0.3, 0.25, 0.35
COULOMB = np.array([0.02, 0.03, 0.04])
JOINTS = ("crank_pivot", "knee", "rocker_pivot")
DURATION = 10.0


class Reduced:
    """The linkage as one coordinate θ, the angle of its crank."""

    def __init__(self) -> None:
        self.tree = Oracle(load_scene(models.SCENES / "four_bar.yaml"))

    def pose(self, theta: float) -> np.ndarray:
        """All joint angles: the rocker's end is where two circles meet."""
        knee = CRANK * np.array([np.cos(theta), np.sin(theta)])
        across = np.array([GROUND, 0.0]) - knee
        distance = np.hypot(*across)
        turn = (COUPLER**2 + distance**2 - ROCKER**2) / (2 * COUPLER * distance)
        coupler = np.arctan2(across[1], across[0]) + np.arccos(turn)
        end = knee + COUPLER * np.array([np.cos(coupler), np.sin(coupler)])
        rocker = np.arctan2(end[1], end[0] - GROUND)
        return np.array([theta, coupler - theta, rocker])

    def motion(self, q: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
        """Speeds per speed of the crank, and accelerations of the others if it turns evenly."""
        lengths, angles = np.array([CRANK, COUPLER, -ROCKER]), np.array([q[0], q[0] + q[1], q[2]])
        along = lengths * np.array([-np.sin(angles), np.cos(angles)])
        inward = -lengths * np.array([np.cos(angles), np.sin(angles)])
        speeds = np.concatenate([[1.0], np.linalg.solve(along[:, 1:], -along[:, 0])])
        bends = np.linalg.solve(along[:, 1:], -inward @ speeds**2) * rate**2
        # From absolute angles to those of the joints.
        to_joints = np.array([[1.0, 0, 0], [-1, 1, 0], [0, 0, 1]])
        return to_joints @ speeds, to_joints @ np.array([0.0, *bends])

    def forces(self, theta: float, rate: float) -> tuple[float, float, np.ndarray]:
        """Inertia, force along the crank without friction, and speeds per speed of the crank."""
        q = self.pose(theta)
        N, bent = self.motion(q, rate)
        needed = self.tree.inverse(q, N * rate, bent)
        return float(N @ self.tree.mass_matrix(q) @ N), float(-N @ needed), N

    def solve(self, theta: float, rate: float, times: np.ndarray) -> np.ndarray:
        """The crank's angle at ``times``."""
        found, now = np.full(len(times), np.nan), 0.0

        def slope(_: float, x: np.ndarray, signs: np.ndarray) -> list[float]:
            inertia, force, N = self.forces(*x)
            return [x[1], (force - N @ (COULOMB * signs)) / inertia]

        def reversal(i: int, sign: float):
            def speed(_: float, x: np.ndarray, signs: np.ndarray) -> float:
                return float(self.motion(self.pose(x[0]), 1.0)[0][i] * x[1])

            speed.terminal, speed.direction = True, -sign
            return speed

        while now < times[-1]:
            inertia, force, N = self.forces(theta, rate)
            if rate == 0.0 and abs(force) <= COULOMB @ abs(N):
                found[times >= now] = theta
                break
            ahead = np.sign(rate) or np.sign(force)
            signs = np.sign(self.motion(self.pose(theta + 1e-9 * ahead), 1.0)[0]) * ahead
            run = solve_ivp(
                slope, (now, times[-1] + 1e-9), [theta, rate], method="DOP853", rtol=1e-13,
                atol=1e-13, args=(signs,), dense_output=True,
                events=[reversal(i, signs[i]) for i in range(3)],
            )  # fmt: skip
            within = (times >= now) & (times <= run.t[-1])
            found[within] = [run.sol(t)[0] for t in times[within]]
            now, (theta, rate) = float(run.t[-1]), run.y[:, -1]
            if len(run.t_events[0]):  # the crank, and so everything, stops
                rate = 0.0
        return found


@cache
def motion() -> Recording:
    data = {
        "robot": {"urdf": str(models.SCENES / "four_bar.urdf")},
        "constraints": [
            {
                "type": "point", "name": "loop", "frames": ["coupler", "rocker"],
                "points": [[COUPLER, 0, 0], [ROCKER, 0, 0]],
            }
        ],
        "initial": {"position": dict(zip(JOINTS, Reduced().pose(0.5).tolist(), strict=True))},
        "joints": {
            name: {"friction": {"coulomb": float(level)}}
            for name, level in zip(JOINTS, COULOMB, strict=True)
        },
    }  # fmt: skip
    sim = Simulator(data, integrator="dop853", dt=1e-3)
    q = Reduced().pose(0.5)
    sim.reset(q, Reduced().motion(q, 1.0)[0] * 25.0)
    return sim.run(DURATION)


def test_it_goes_round_swings_and_stops_as_one_coordinate_does() -> None:
    run = motion()
    every = slice(None, None, 50)
    expected = Reduced().solve(0.5, 25.0, run.time[every])
    assert run.v[0, 0] == 25.0 and np.ptp(run.q[:, 0]) > 2 * np.pi
    assert_close(run.q[every, 0], expected, 1e-8)


def test_where_it_stopped_it_stays_to_the_bit() -> None:
    run = motion()
    stopped = np.flatnonzero((run.v == 0.0).all(axis=1))[0]
    assert 1.0 < run.time[stopped] < 0.9 * DURATION
    assert (run.q[stopped:] == run.q[stopped]).all()
    assert (run.v[stopped:] == 0.0).all()


def test_its_account_closes() -> None:
    run = motion()
    assert abs(run.balance[-1]) < 1e-6 * run.lost[-1]
