# SPDX-License-Identifier: Apache-2.0
"""A gear with backlash inside a position loop hunts: its limit cycle against SciPy with the
contacts of the teeth located.

The motor's torque is -P q of the link's position q, its shaft is damped by c, and the link by b:

    J_m θ'' + c θ' + T = -P q,   J_l q'' + b q' = T,   T = k D(θ - q), D a dead zone of width 2 δ.
"""

from functools import cache
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from arm_sim import Recording, Simulator
from models.driven import wheel
from tolerances import assert_close

J_M, J_L, C, B = 0.05, 0.1, 3.0, 0.3  # [kg m²], [N m s/rad], all as seen at the joint
K, DELTA, P = 500.0, 0.01, 300.0  # [N m/rad], [rad], [N m/rad]
N = 50.0  # the gear
DT = 1e-3


@cache
def hunting() -> Recording:
    """Three seconds from a displacement larger than the play, the last of them on the cycle."""
    spring = {"stiffness": K, "backlash": 2.0 * DELTA}
    motor = {"gear_ratio": N, "rotor_inertia": J_M / N**2, "rotor_damping": C / N**2}
    scene = wheel(J_L, spring, **motor)
    scene["joints"]["axle"]["friction"] = {"viscous": B}
    sim = Simulator(scene, dt=DT)
    sim.reset(q=[0.04])
    return sim.run(3.0, lambda state: -P * state.q)


def test_every_instant_of_it_against_scipy() -> None:
    """Four periods, the same law of the torque, held over every tick; SciPy stops where teeth meet
    or part.
    """
    run = hunting()
    first = int(2.0 / DT)

    def slope(_: float, x: np.ndarray, u: float, side: int) -> list[float]:
        q, v, theta, omega = x
        T = K * (theta - q - side * DELTA) if side else 0.0
        return [v, (T - B * v) / J_L, omega, (u - C * omega - T) / J_M]

    def edge(flank: int, sign: int) -> Any:
        def reached(_: float, x: np.ndarray, *args: float) -> float:
            return float(x[2] - x[0] - flank * DELTA)

        reached.terminal, reached.direction = True, sign  # type: ignore[attr-defined]
        return reached

    x = np.concatenate([run.q[first], run.v[first], run.z[first]])
    twist = x[2] - x[0]
    side = int(np.sign(twist)) if abs(twist) > DELTA else 0
    seen = {side}
    for _ in range(500):
        t, u = 0.0, -P * float(x[0])
        while t < DT:
            stops = [edge(side, -side)] if side else [edge(1, 1), edge(-1, -1)]
            part = solve_ivp(
                slope, (t, DT), x, "DOP853", events=stops, rtol=1e-10, atol=1e-13, args=(u, side)
            )
            x, t = part.y[:, -1], float(part.t[-1])
            if part.status == 1:
                side = 0 if side else (1 if len(part.t_events[0]) else -1)
                seen.add(side)
    assert seen == {-1, 0, 1}
    end = first + 500
    assert_close(np.concatenate([run.q[end], run.z[end][:1]]) / DELTA, x[[0, 2]] / DELTA, 1e-6)
