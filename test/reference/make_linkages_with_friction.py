# SPDX-License-Identifier: Apache-2.0
"""Write linkages_with_friction.json: closed chains with dry friction in their one coordinate.

A four-bar with Coulomb friction in every hinge, thrown, until it rests; a slider-crank whose
slider rubs on its rail, turned by a motor with a current. The equation is that of
make_linkages.py, in double precision; DOP853 runs from one instant at which a joint reverses to
the next. Nothing is shared with the suite. Run: PYTHONPATH=.. ../../arm python
make_linkages_with_friction.py
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from make_linkages import FourBar, SliderCrank
from mpmath import fp
from scipy.integrate import solve_ivp

import models

Array = np.ndarray
TIMES = np.arange(0.0, 10.01, 0.5)
HINGES = [0.02, 0.03, 0.04]  # [N m]
VOLTAGE = 12.0


@dataclass
class Rubbing:
    """A linkage with friction in its joints, and perhaps a motor at the first one."""

    linkage: FourBar | SliderCrank
    coulomb: Array  # dry friction of each joint, shape (n,)
    viscous: float = 0.0  # of the first joint
    armature: float = 0.0  # inertia of the motor as the joint sees it
    # Resistance, inductance and torque per current at the joint
    motor: tuple[float, float, float] | None = None

    def speeds(self, theta: float) -> Array:
        """Of all joints per speed of the first."""
        return np.array(self.linkage.joints(self.linkage.links(theta), 1.0)[1])

    def smooth(self, x: Array) -> tuple[float, float]:
        """Inertia, and force without dry friction, of angle, speed and current."""
        J, force = self.linkage.reduced(x[0], x[1])
        push = self.motor[2] * x[2] if self.motor else 0.0
        return J + self.armature, force + push - self.viscous * x[1]

    def slope(self, x: Array, signs: Array) -> Array:
        """Rate of change of angle, speed and current, joints sliding as ``signs`` say."""
        inertia, force = self.smooth(x)
        current = 0.0
        if self.motor:
            resistance, inductance, constant = self.motor
            current = (VOLTAGE - resistance * x[2] - constant * x[1]) / inductance
        rubbing = self.speeds(x[0]) @ (self.coulomb * signs)
        return np.array([x[1], (force - rubbing) / inertia, current])

    def solve(self, theta: float, rate: float) -> Array:
        """Angle, speed and current at ``TIMES``, shape (3, k)."""
        motion, now, x = np.full((3, len(TIMES)), np.nan), 0.0, np.array([theta, rate, 0.0])
        while now < TIMES[-1]:
            force, level = self.smooth(x)[1], self.coulomb @ abs(self.speeds(x[0]))
            if x[1] == 0.0 and abs(force) <= level and not self.motor:
                motion[:, TIMES >= now] = x[:, None]
                break
            ahead = np.sign(x[1]) or np.sign(force)
            signs = np.sign(self.speeds(x[0] + 1e-9 * ahead)) * ahead
            run = solve_ivp(
                lambda _, y, signs=signs: self.slope(y, signs), (now, TIMES[-1] + 1e-9), x,
                method="DOP853", rtol=1e-13, atol=1e-13, dense_output=True,
                events=[self._reversal(i, sign) for i, sign in enumerate(signs)],
            )  # fmt: skip
            within = (TIMES >= now) & (TIMES <= run.t[-1])
            motion[:, within] = np.array([run.sol(t) for t in TIMES[within]]).reshape(-1, 3).T
            now, x = float(run.t[-1]), run.y[:, -1].copy()
            if len(run.t_events[0]):  # the first joint, and so everything, stops
                x[1] = 0.0
        return motion

    def _reversal(self, i: int, sign: float) -> Callable[[float, Array], float]:
        def speed(_: float, x: Array) -> float:
            return float(self.speeds(x[0])[i] * x[1])

        speed.terminal, speed.direction = True, -sign
        return speed

    def case(self, theta: float, rate: float) -> tuple[dict[str, object], Array]:
        """The start of all joints and the first joint's angle at all times; its whole motion."""
        q, v = self.linkage.joints(self.linkage.links(theta), rate)
        motion = self.solve(theta, rate)
        return {"q": q, "v": v, "time": TIMES.tolist(), "theta": motion[0].tolist()}, motion


def driven() -> Rubbing:
    """The slider-crank with the motor and the friction of its scene."""
    scene = models.scene("slider_crank_motor")
    pivot, rail, motor = scene.joint("pivot"), scene.joint("rail"), scene.joint("pivot").actuator
    return Rubbing(
        SliderCrank(fp), np.array([0.0, 0.0, rail.friction.coulomb]), pivot.friction.viscous,
        motor.rotor_inertia * motor.gear_ratio**2,
        (motor.resistance, motor.inductance, motor.torque_constant * motor.gear_ratio),
    )  # fmt: skip


def pin(crank: Rubbing, x: Array) -> float:
    """What the rod does to the slider along the rail: m a and the friction."""
    signs = np.sign(crank.speeds(x[0]) * x[1])
    links, acc = crank.linkage.links(x[0]), crank.slope(x, signs)[1]
    return float(crank.linkage.force(links, x[1], acc).real + crank.coulomb[2] * signs[2])


def main() -> None:
    """Solve both and write them."""
    thrown, _ = Rubbing(FourBar(fp), np.array(HINGES)).case(0.5, 25.0)
    crank = driven()
    turned, motion = crank.case(1.0, 8.0)
    turned |= {"pin": [pin(crank, x) for x in motion.T], "voltage": VOLTAGE}
    data = {"four_bar": thrown | {"coulomb": HINGES}, "slider_crank": turned}
    file = Path(__file__).with_name("linkages_with_friction.json")
    file.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
