# SPDX-License-Identifier: Apache-2.0
"""A pendulum on a harmonic drive with all that a drive can have, against SciPy's Radau method.

The equations are written out here once more, apart from the suite's laws.
"""

import numpy as np
from scipy.integrate import solve_ivp

import models
from arm_sim import Simulator

R, L, KT, KE, J, B, N = 0.8, 5e-4, 0.06, 0.06, 4e-5, 2e-5, -60.0
POLES, PER_TURN, PHASE = 4e-3, 6.0, 0.3
K, K3, D, VISCOUS = 900.0, 4e5, 3.0, 0.2
H, DEFLECTION, SHARP = 2.0, 2e-3, 1.6
ERROR, WAVES, SHIFT = 2e-3, 2.0, -0.4
SCENE = {
    "robot": {"urdf": models.scene("pendulum").robot.urdf},
    "joints": {
        "swing": {
            "friction": {"viscous": VISCOUS},
            "actuator": {
                "command": "voltage", "resistance": R, "inductance": L, "torque_constant": KT,
                "rotor_inertia": J, "rotor_damping": B, "gear_ratio": N,
                "cogging": {"amplitude": POLES, "order": PER_TURN, "phase": PHASE},
            },
            "transmission": {
                "stiffness": K, "stiffening": K3, "damping": D,
                "hysteresis": {"torque": H, "deflection": DEFLECTION, "sharpness": SHARP},
                "kinematic_error": {"amplitude": ERROR, "order": WAVES, "phase": SHIFT},
            },
        }
    },
}  # fmt: skip


def voltage(tick: int) -> float:
    return float(12.0 * np.sin(0.03 * tick))


def rate(_: float, x: np.ndarray, volts: float) -> np.ndarray:
    """Link q, v; current i; rotor angle m and speed w (at the motor); hysteresis h."""
    q, v, i, m, w, h = x
    twist = m / N + ERROR * np.sin(WAVES * m + SHIFT) - q
    bend = 1.0 / N + ERROR * WAVES * np.cos(WAVES * m + SHIFT)  # of the output per motor angle
    twisting = w * bend - v
    spring = K * twist + K3 * twist**3 + D * twisting + H * h
    at_motor = KT * i - POLES * np.sin(PER_TURN * m + PHASE) - B * w - spring * bend
    growing = 0.5 * (1.0 + np.sign(twisting * h)) * abs(h) ** SHARP
    return np.array([
        v,
        spring - VISCOUS * v - 9.81 * np.sin(q),  # 1 kg on 1 m
        (volts - R * i - KE * w) / L,
        w,
        at_motor / J,
        twisting * (1.0 - growing) / DEFLECTION,
    ])  # fmt: skip


def test_harmonic_drive_with_everything() -> None:
    sim = Simulator(SCENE)
    sim.reset([0.3], [0.5])
    i, position, velocity, h = sim.state.z
    x = np.array([0.3, 0.5, i, N * position, N * velocity, h])
    for tick in range(40):
        options = {"rtol": 1e-10, "atol": 1e-11, "args": (voltage(tick),)}
        x = solve_ivp(rate, (0.0, 1e-3), x, "Radau", **options).y[:, -1]
        sim.step([voltage(tick)])
    s = sim.state
    ours = np.array([s.q[0], s.v[0], s.z[0], N * s.z[1], N * s.z[2], s.z[3]])
    np.testing.assert_allclose(ours, x, rtol=1e-7, atol=1e-8)
    assert abs(x[5]) > 0.05  # the hysteresis has been through something
