# SPDX-License-Identifier: Apache-2.0
"""Derivatives of stiff linear arms near rest, where error control sees nothing to resolve.

The closed form is the exponential of the system's matrix, with the held command as another state.
"""

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from arm_sim import Simulator
from models.rotor import rotor
from tolerances import assert_close

J, ARMATURE, GEAR, KT = 0.02, 1e-5, 30.0, 0.05
SETTLED = 1e-8
DOP853: dict[str, Any] = {"integrator": "dop853", "tolerance": 1e-10}


def scene(**joint: Any) -> dict[str, Any]:
    made = rotor(J)
    return made | {"gravity": [0, 0, 0], "joints": {"axle": joint}}


def motor(rate: float) -> tuple[dict[str, Any], list[list[float]]]:
    """A voltage-driven motor with R/L = rate, and its matrix, of x = (q, v, i, voltage)."""
    drive = {"command": "voltage", "resistance": 1.0, "inductance": 1.0 / rate,
             "torque_constant": KT, "rotor_inertia": ARMATURE, "gear_ratio": GEAR}  # fmt: skip
    K, M = KT * GEAR, J + GEAR**2 * ARMATURE
    matrix = [[0, 1, 0, 0], [0, 0, K / M, 0], [0, -K * rate, -rate, rate]]
    return scene(actuator=drive), matrix


def flexible(k: float, d: float, **more: float) -> tuple[dict[str, Any], list[list[float]]]:
    """A rotor and a wheel with a spring between them, x = (q, v, θ, θ', torque)."""
    made = scene(actuator={"rotor_inertia": J}, transmission={"stiffness": k, "damping": d} | more)
    pull, push = np.array([-k, -d, k, d, 0]), np.array([k, d, -k, -d, 1.0])
    return made, [[0, 1, 0, 0, 0], (pull / J).tolist(), [0, 0, 0, 1, 0], (push / J).tolist()]


def viscous(rate: float) -> tuple[dict[str, Any], list[list[float]]]:
    return scene(friction={"viscous": rate * J}), [[0, 1, 0], [0, -rate, 1 / J]]


CASES = {
    "a winding in long ticks": (motor(2e3), {"dt": 0.02, **DOP853}),
    "viscous friction of 1e8/s": (viscous(1e8), {"tolerance": 1e-8}),
    "a stiff transmission": (flexible(1e6, 2.0), {}),
    "an undamped transmission": (flexible(1e5, 0.0), {"dt": 5e-3}),
}


@pytest.mark.parametrize(("case", "how"), CASES.values(), ids=CASES)
def test_derivatives_at_rest_are_those_of_the_motion(case: Any, how: dict[str, Any]) -> None:
    made, matrix = case
    sim = Simulator(made, **how)
    A, B = sim.linearize(sim.state, [0.0])
    system = np.vstack([matrix, np.zeros(len(matrix) + 1)])
    exact = expm(system * sim.dt)[:-1]
    for row, wanted in zip(np.hstack([A, B]), exact, strict=True):
        assert_close(row / max(abs(wanted)), wanted / max(abs(wanted)), SETTLED)


def test_a_gradient_over_ticks_at_rest_is_that_of_the_motion() -> None:
    sim, ticks = Simulator(motor(2e4)[0]), 20
    weights = np.zeros((1, ticks + 1, 2))
    weights[0, -1, 0] = 1.0
    found = sim.rollout_gradient([[0.0]], [[0.0]], np.zeros((1, ticks, 1)), ticks, weights)
    matrix = np.vstack([motor(2e4)[1], np.zeros(4)])
    step, after = expm(matrix * sim.dt), np.eye(3)
    for k in reversed(range(ticks)):
        assert found.tau[0, k, 0] == pytest.approx((after @ step[:3, 3])[0], rel=1e-7)
        after = after @ step[:3, :3]


@pytest.mark.parametrize("twist", [0.0, 0.2])
def test_fixed_steps_say_so_where_it_stiffens(twist: float, caplog: Any) -> None:
    made, _ = flexible(10.0, 0.01, stiffening=1e5)
    sim = Simulator(made, integrator="rk4", dt=1e-3)
    A, _ = sim.linearize(state := sim.reset(z=[twist, 0.0]), [0.0])
    finer, _ = Simulator(made, integrator="rk4", dt=1e-5).linearize(state, [0.0], 100)
    told = any("derivatives are those of" in r.getMessage() for r in caplog.records)
    assert (np.max(abs(A - finer)) > 1e-4) == told == (twist > 0.0)
