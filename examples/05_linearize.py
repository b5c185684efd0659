# SPDX-License-Identifier: Apache-2.0
"""Exact derivatives of a tick, and a regulator based on them that balances the arm upright."""

from importlib.resources import files

import numpy as np

from arm_sim import Simulator, State
from arm_sim.figures import figure

sim = Simulator(files("arm_sim") / "scenes/double_pendulum.yaml")
upright = np.array([np.pi, 0.0])  # [rad]; both links point up
rest = sim.reset(q=upright, v=np.zeros(sim.n))
hold = sim.dynamics.gravity(upright)  # [N m]; none is needed here

A, B = sim.linearize(rest, hold)  # x⁺ = A x + B τ near this state, x = (q, v)
print("without control, errors grow by these factors in a second:")
print("  ", np.round(np.abs(np.linalg.eigvals(A)) ** round(1 / sim.dt), 3))

# Linear-quadratic regulator: iterate the Riccati equation until it converges.
Q, R = np.diag([10.0, 10.0, 1.0, 1.0]), np.eye(sim.n)
P = Q
for _ in range(20_000):
    K = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
    before, P = P, Q + A.T @ P @ (A - B @ K)
    if np.abs(P - before).max() < 1e-10 * np.abs(P).max():
        break
closed = np.abs(np.linalg.eigvals(A - B @ K))
print("with feedback they shrink by:\n  ", np.round(closed ** round(1 / sim.dt), 4))


def balance(state: State) -> np.ndarray:
    """State feedback."""
    return hold - K @ np.concatenate([state.q - upright, state.v])


sim.reset(q=upright + [0.2, -0.1], v=[0.0, 0.0])
motion = sim.run(5.0, control=balance)
print(f"started 0.2 rad from upright, after 5 s: {np.abs(motion.q[-1] - upright).max():.1e} rad")

with figure("balance", columns=2) as (left, right):
    names = ["lower link", "upper link"]
    left.plot(motion.time, motion.q - upright, label=names)
    left.set(xlabel="time [s]", ylabel="angle from upright [rad]", title="Balanced")
    right.plot(motion.time, motion.tau, label=names)
    right.set(xlabel="time [s]", ylabel="torque [N m]", title="Torques")
    for axis in (left, right):
        axis.legend()

assert np.abs(motion.q[-1] - upright).max() < 1e-3
