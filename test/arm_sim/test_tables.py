# SPDX-License-Identifier: Apache-2.0
"""Arms with tabulated friction and springs that move, against independent integrations."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from arm_sim import Simulator
from models.rotor import rotor
from tolerances import assert_close

J = 0.1
DRAG = {"speed": [0.0, 1.0, 2.0], "torque": [0.0, 0.1, 0.4]}
HARDENING = {"deflection": [-1.0, 0.0, 1.0], "torque": [-6.0, 0.0, 3.0]}


def wheel(table: dict[str, Any], spring: dict[str, Any] | None = None, **how: Any) -> Simulator:
    scene = rotor(J, table=table)
    if spring:
        scene["joints"]["axle"]["spring"] = spring
    return Simulator(scene, **({"tolerance": 1e-12} | how))


def mean(a: float, b: float) -> float:
    """Harmonic mean, the slope at a point between two chords of one sign and length."""
    return 2.0 * a * b / (a + b)


@pytest.mark.parametrize(("place", "level"), [(-1.0, 0.5), (0.0, 0.75), (1.0, 1.0), (9.0, 1.0)])
def test_it_lets_go_where_the_row_of_the_position_says(place: float, level: float) -> None:
    rows = {"speed": [0.0, 1.0], "torque": [[0.5, 0.5], [1.0, 0.2]], "position": [-1.0, 1.0]}
    sim = wheel(rows, integrator="rk4", tolerance=None)
    sim.reset(q=[place])
    assert (sim.run(0.1, [level * (1.0 - 1e-12)]).q == place).all()
    assert sim.step([level * (1.0 + 1e-9)]).v[0] > 0.0


def test_a_wheel_on_a_hardening_spring_in_a_viscous_bath() -> None:
    """Against SciPy; beyond the tables both go on straight."""
    torque = CubicHermiteSpline([-1.0, 0.0, 1.0], [-6.0, 0.0, 3.0], [6.0, mean(6.0, 3.0), 3.0])
    drag = CubicHermiteSpline([0.0, 1.0, 2.0], [0.0, 0.1, 0.4], [0.1, mean(0.1, 0.3), 0.3])

    def rates(_: float, x: np.ndarray) -> list[float]:
        bent, speed = x[0], abs(x[1])
        inside = float(np.clip(bent, -1.0, 1.0))
        pull = torque(inside) + torque(inside, 1) * (bent - inside)
        slow = min(speed, 2.0)
        return [x[1], -(pull + np.sign(x[1]) * (drag(slow) + 0.3 * (speed - slow))) / J]

    sim = wheel(DRAG, {"table": HARDENING})
    sim.reset(q=[1.5])
    run = sim.run(0.7)
    exact = solve_ivp(rates, (0.0, 0.71), [1.5, 0.0], "DOP853", run.time, rtol=1e-12, atol=1e-13,
                      max_step=1e-3)  # fmt: skip
    assert abs(run.q[:, 0]).min() < 0.1
    assert_close(run.q[:, 0], exact.y[0], 1e-8)
    assert run.energy_error < 1e-9
