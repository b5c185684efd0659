# SPDX-License-Identifier: Apache-2.0
"""Linkages with dry friction reduced by hand to one coordinate, solved between located reversals.

Pinocchio gives the inertia of the open tree; the loop is closed by plane trigonometry, and DOP853
runs from one instant at which a joint reverses to the next. Nothing is shared with the suite.
"""

import numpy as np
from scipy.integrate import solve_ivp

from arm_dynamics import Scene
from models.oracle import Oracle

Array = np.ndarray


class OneCoordinate:
    """A linkage whose first joint determines the positions of all others.

    Attributes:
        coulomb: Dry friction of each joint, shape (n,).
        viscous: Viscous friction of each joint, shape (n,).
        armature: Inertia of the motor at the first joint, as the joint sees it.
        motor: None, or resistance, inductance and torque per current at the first joint.
        voltage: Of the motor.
    """

    def __init__(self, scene: Scene, coulomb: Array, viscous: Array | None = None) -> None:
        self.tree = Oracle(scene)
        self.coulomb = coulomb
        self.viscous = np.zeros_like(coulomb) if viscous is None else viscous
        self.armature, self.voltage = 0.0, 0.0
        self.motor: tuple[float, float, float] | None = None

    def pose(self, theta: float) -> Array:
        """All joint positions."""
        raise NotImplementedError

    def motion(self, q: Array, rate: float) -> tuple[Array, Array]:
        """Speeds per speed of the first joint, and accelerations if that one turns evenly."""
        raise NotImplementedError

    def slope(self, x: Array, signs: Array) -> Array:
        """Rate of change of angle, speed and current, joints sliding as ``signs`` say."""
        inertia, force, N = self._reduced(x)
        current = 0.0
        if self.motor:
            resistance, inductance, constant = self.motor
            current = (self.voltage - resistance * x[2] - constant * x[1]) / inductance
        return np.array([x[1], (force - N @ (self.coulomb * signs)) / inertia, current])

    def solve(self, theta: float, rate: float, times: Array) -> Array:
        """Angle, speed and current at ``times``, shape (3, k)."""
        found, now, x = np.full((3, len(times)), np.nan), 0.0, np.array([theta, rate, 0.0])
        while now < times[-1]:
            force, N = self._reduced(x)[1:]
            if x[1] == 0.0 and abs(force) <= self.coulomb @ abs(N) and not self.motor:
                found[:, times >= now] = x[:, None]
                break
            ahead = np.sign(x[1]) or np.sign(force)
            signs = np.sign(self._speeds(x[0] + 1e-9 * ahead)) * ahead
            run = solve_ivp(
                lambda _, y, signs=signs: self.slope(y, signs), (now, times[-1] + 1e-9), x,
                method="DOP853", rtol=1e-13, atol=1e-13, dense_output=True,
                events=[self._reversal(i, sign) for i, sign in enumerate(signs)],
            )  # fmt: skip
            within = (times >= now) & (times <= run.t[-1])
            found[:, within] = np.array([run.sol(t) for t in times[within]]).reshape(-1, 3).T
            now, x = float(run.t[-1]), run.y[:, -1].copy()
            if len(run.t_events[0]):  # the first joint, and so everything, stops
                x[1] = 0.0
        return found

    def _speeds(self, theta: float) -> Array:
        return self.motion(self.pose(theta), 1.0)[0]

    def _reduced(self, x: Array) -> tuple[float, float, Array]:
        """Inertia, force without dry friction, and speeds per speed of the first joint."""
        q = self.pose(x[0])
        N, bent = self.motion(q, x[1])
        needed = self.tree.rigid(q, N * x[1], bent) + self.viscous * N * x[1]
        push = self.motor[2] * x[2] if self.motor else 0.0
        inertia = float(N @ self.tree.mass_matrix(q) @ N) + self.armature
        return inertia, push - float(N @ needed), N

    def _reversal(self, i: int, sign: float):
        def speed(_: float, x: Array) -> float:
            return float(self._speeds(x[0])[i] * x[1])

        speed.terminal, speed.direction = True, -sign
        return speed


class FourBar(OneCoordinate):
    """Crank, coupler and rocker of the shipped four-bar."""

    CRANK, COUPLER, ROCKER, GROUND = 0.1, 0.3, 0.25, 0.35

    def pose(self, theta: float) -> Array:
        """The rocker's end is where two circles meet."""
        knee = self.CRANK * np.array([np.cos(theta), np.sin(theta)])
        across = np.array([self.GROUND, 0.0]) - knee
        distance = np.hypot(*across)
        turn = (self.COUPLER**2 + distance**2 - self.ROCKER**2) / (2 * self.COUPLER * distance)
        coupler = np.arctan2(across[1], across[0]) + np.arccos(turn)
        end = knee + self.COUPLER * np.array([np.cos(coupler), np.sin(coupler)])
        return np.array([theta, coupler - theta, np.arctan2(end[1], end[0] - self.GROUND)])

    def motion(self, q: Array, rate: float) -> tuple[Array, Array]:
        """From the two equations of the loop in absolute angles."""
        lengths = np.array([self.CRANK, self.COUPLER, -self.ROCKER])
        angles = np.array([q[0], q[0] + q[1], q[2]])
        along = lengths * np.array([-np.sin(angles), np.cos(angles)])
        inward = -lengths * np.array([np.cos(angles), np.sin(angles)])
        speeds = np.concatenate([[1.0], np.linalg.solve(along[:, 1:], -along[:, 0])])
        bends = np.linalg.solve(along[:, 1:], -inward @ speeds**2) * rate**2
        to_joints = np.array([[1.0, 0, 0], [-1, 1, 0], [0, 0, 1]])
        return to_joints @ speeds, to_joints @ np.array([0.0, *bends])


class SliderCrank(OneCoordinate):
    """Crank, rod and slider of the shipped slider-crank; the rail is horizontal."""

    CRANK, ROD = 0.15, 0.4

    def pose(self, theta: float) -> Array:
        """The rod's angle follows from its end's height, zero."""
        rod = -np.arcsin(self.CRANK / self.ROD * np.sin(theta))
        place = self.CRANK * np.cos(theta) + self.ROD * np.cos(rod)
        return np.array([theta, rod - theta, place])

    def motion(self, q: Array, rate: float) -> tuple[Array, Array]:
        """From the height of the rod's end, and then its place."""
        crank, length = self.CRANK, self.ROD
        theta, rod = q[0], q[0] + q[1]
        turn = -crank * np.cos(theta) / (length * np.cos(rod))
        bend = (
            (crank * np.sin(theta) + length * np.sin(rod) * turn**2)
            / (length * np.cos(rod))
            * rate**2
        )
        slide = -crank * np.sin(theta) - length * np.sin(rod) * turn
        inward = -(crank * np.cos(theta) + length * np.cos(rod) * turn**2) * rate**2
        return (
            np.array([1.0, turn - 1.0, slide]),
            np.array([0.0, bend, inward - length * np.sin(rod) * bend]),
        )
