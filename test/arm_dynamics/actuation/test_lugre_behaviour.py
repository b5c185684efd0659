# SPDX-License-Identifier: Apache-2.0
"""What LuGre friction is known for: springs before it slips, breaks away by the rate of the force,
and its numbers where they can be had in closed form.

Canudas de Wit, Olsson, Åström, Lischinsky, IEEE Trans. Automatic Control 40(3), 1995, section III;
Åström, Canudas de Wit, IEEE Control Systems Magazine 28(6), 2008.
"""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from arm_sim import Simulator
from models.rotor import rotor
from tolerances import ALGEBRA, LUGRE, assert_close

# Of the paper, table I: a mass of 1 kg.
PAPER = {
    "coulomb": 1.0,
    "static": 1.5,
    "stribeck_velocity": 0.001,
    "viscous": 0.4,
    "lugre": {"sigma0": 1e5, "sigma1": np.sqrt(1e5), "sigma1_velocity": 0.02},
}


def wheel(J: float = 1.0, **changes: Any) -> Simulator:
    return Simulator(rotor(J, **(PAPER | changes)))


def test_hysteresis_before_it_slips() -> None:
    """A slow force, Fs = Fc: F = Fc (1 - e^(-σ0 x/Fc)) from rest, and from a turning point
    F = -Fc + (F0 + Fc) e^(σ0 (x - x0)/Fc): Dahl's loop.
    """
    sim = wheel(
        1e-3, static=1.0, stribeck_velocity=None, viscous=0.0, lugre={"sigma0": 1e3, "sigma1": 1.0}
    )
    peak, ramp = 0.8, np.linspace(0.0, 0.8, 4001)[1:]
    u = np.concatenate([ramp, ramp[-2::-1], [0.0], -ramp, -ramp[-2::-1]])
    run = sim.run(len(u) * 1e-3, u[:, None])
    x, F = run.q[1:, 0], u
    up = slice(0, 4000)
    assert_close(x[up], -1e-3 * np.log(1.0 - F[up]), 1e-5)
    down, x0 = slice(4000, 12000), x[3999]
    assert_close(x[down], x0 + 1e-3 * np.log((F[down] + 1.0) / (peak + 1.0)), 1e-5)


def test_breaks_away_at_a_lower_force_the_faster_it_grows() -> None:
    """Figure 3 of the paper: near Fs at slow rates, falling with the rate."""
    forces, sim = [], wheel()
    for rate in (1.0, 5.0, 50.0):
        sim.reset()
        ticks = int(2.0 / rate * 1e3) + 50
        run = sim.run(ticks * 1e-3, (rate * 1e-3 * (np.arange(ticks) + 1))[:, None])
        forces.append((1e5 * run.z[:, 0]).max())
    assert (np.diff(forces) < 0.0).all(), forces
    assert 1.4 < forces[0] < 1.5 and 1.0 < forces[-1] < 1.3


# --- by direction, position and load -------------------------------------------------------------

SIDES = {
    "viscous": {"positive": 0.6, "negative": 0.9}, "coulomb": {"positive": 1.2, "negative": 0.7},
    "static": {"positive": 1.5, "negative": 1.3}, "stribeck_velocity": 0.05,
}  # fmt: skip
WAVY = {"at": [-1.0, 0.0, 1.0], "factor": [0.5, 1.5, 1.0], "period": 3.0}
LOADED = {"at": [0.0, 4.0], "factor": [1.0, 1.4]}
BRISTLES = {"sigma0": 2e3, "sigma1": 8.0, "sigma1_velocity": 0.2}
EVERYTHING = SIDES | {"position": WAVY, "load": LOADED, "lugre": BRISTLES}


def wavy(q: float) -> float:
    """Fritsch and Butland's cubics through ``WAVY``, written out: level where the points turn, at
    0 and -1, and at 1 the slope of the fall -0.5 over 1 and -0.5 over 1, which is -0.5.
    """
    x = (q + 1.0) % 3.0
    if x < 1.0:
        return 0.5 + x * x * (3.0 - 2.0 * x)
    t, m = (x - 1.0, (0.0, -0.5)) if x < 2.0 else (x - 2.0, (-0.5, 0.0))
    start = 1.5 if x < 2.0 else 1.0
    bend = t * t * (3.0 * -0.5 - 2.0 * m[0] - m[1]) + t**3 * (m[0] + m[1] + 1.0)
    return start + m[0] * t + bend


def steady_level(q: float, v: float, u: float) -> float:
    """g of ``EVERYTHING``: the dry friction of a steady motion, of positive sign."""
    fc, fs = (1.2, 1.5) if v >= 0.0 else (0.7, 1.3)
    t = min(abs(u) / 4.0, 1.0)
    load = 1.0 + 0.4 * t * t * (3.0 - 2.0 * t)
    return wavy(q) * load * (fc + (fs - fc) * float(np.exp(-((v / 0.05) ** 2))))


@pytest.mark.parametrize(("q", "v"), [(-0.4, 0.02), (0.3, -0.3), (1.7, -0.02)])
def test_steady_sliding_by_direction_position_and_load(q: float, v: float) -> None:
    """Inverse dynamics takes it, tau = rigid + F(tau), and forward dynamics undoes it."""
    dyn, u, a = wheel(0.1, **EVERYTHING).dynamics, 2.5 * np.sign(v), 3.0
    F = np.sign(v) * steady_level(q, v, u) + (0.6 if v > 0.0 else 0.9) * v
    assert_close(dyn.friction([v], q=[q], load=[u]), [F], ALGEBRA)
    tau = dyn.inverse([q], [v], [a])
    assert_close(tau, 0.1 * a + dyn.friction([v], q=[q], load=tau), ALGEBRA)
    assert_close(dyn.forward([q], [v], tau), [a], 1e-9)


def test_by_direction_position_and_load_against_radau() -> None:
    """Sticking, sliding and reversing over most of a period of the table."""
    J, u = 0.05, np.repeat([0.5, 5.0, -6.0, 0.0, -4.0, 5.0], 150)
    run = wheel(J, **EVERYTHING).run(0.9, u[:, None])

    def slope(_: float, x: np.ndarray, torque: float) -> list[float]:
        q, v, z = x
        bend = v - 2e3 * abs(v) * z / steady_level(q, v, torque)
        viscous = (0.6 if v > 0.0 else 0.9) * v
        damping = 8.0 * np.exp(-((v / 0.2) ** 2))
        return [v, (torque - 2e3 * z - damping * bend - viscous) / J, bend]

    x = np.zeros(3)
    for torque in u[::150]:
        small = [1e-10, 1e-10, 1e-14]
        x = solve_ivp(slope, (0, 0.15), x, "Radau", rtol=1e-9, atol=small, args=(torque,)).y[:, -1]
    assert np.ptp(run.q[:, 0]) > 0.5 and run.v.min() < -1.0 < 1.0 < run.v.max()
    assert abs(run.q[-1, 0] - x[0]) < LUGRE
    assert np.abs(run.balance).max() < 1e-6 * run.supplied.max()


def test_bristles_by_load_feel_the_motors_torque() -> None:
    """Not the current that commands it: N K_t i."""
    scene = rotor(0.1, **(EVERYTHING | {"load": LOADED}))
    motor = {"command": "current", "torque_constant": 0.05, "gear_ratio": 40.0}
    scene["joints"]["axle"]["actuator"] = motor
    driven, plain = Simulator(scene), wheel(0.1, **EVERYTHING)
    motion = driven.run(0.1, [1.5]), plain.run(0.1, [1.5 * 0.05 * 40.0])
    assert motion[0].q[-1, 0] > 0.01
    assert_close(motion[0].q, motion[1].q, 1e-12)


def test_a_reversal_in_the_last_moment_of_a_step_is_seen() -> None:
    """Found by a random search: 25 rad/s of change in a tick of 5 ms on bristles of 2e6 N m/rad.

    Where the speed changes its sign after the last evaluation of a step, the bristles must turn.
    """
    law = {"sigma0": 1.87e6, "sigma1": 240.0}
    scene = rotor(3.64e-3, coulomb=8.64, viscous=0.0095, lugre=law)
    u = np.repeat([9.5, -9.5, -2.85, 9.5, -9.5, 9.5, 2.85, -9.5], 10)[:, None] * 2.0
    ends = []
    for tolerance in (None, 1e-7, 1e-10):
        sim = Simulator(scene, dt=5e-3, tolerance=tolerance)
        run = sim.run(len(u) * 5e-3, u)
        ends.append(run.q[-1, 0])
        assert np.abs(run.balance).max() < 1e-5 * np.abs(run.supplied).max()
    assert_close(ends, np.full(3, ends[-1]), LUGRE)
