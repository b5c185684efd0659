# SPDX-License-Identifier: Apache-2.0
"""Swing-up of a cart-pole by iLQR: motor, gear and friction are in the model that is optimised.

The iterative linear-quadratic regulator (Li and Todorov, "Iterative linear quadratic regulator
design for nonlinear biological movement systems", ICINCO 2004; line search and regularisation as
in Tassa, Erez and Todorov, IROS 2012) needs the derivatives of the simulation's steps along a
trajectory. ``linearize_many`` gives all of them in one call, exact and in compiled code.
"""

import time

import numpy as np

from arm_dynamics import load_scene
from arm_sim import Simulator
from arm_sim.figures import figure

NODES, TICKS = 125, 20  # 2.5 s; a voltage is held for 20 ticks of 1 ms
SUPPLY = 24.0  # [V]

scene = load_scene("cart_pendulum").model_dump(exclude_unset=True)
motor = {"resistance": 0.6, "torque_constant": 0.05, "rotor_inertia": 2e-5, "gear_ratio": 100,
         "command": "voltage"}  # fmt: skip
scene["joints"] = {
    "slide": {"actuator": motor, "friction": {"viscous": 3.0}, "limits": {"effort": SUPPLY}},
    "hinge": {"friction": {"viscous": 0.02}},
}
sim = Simulator(scene)
start = np.array([0.0, np.pi, 0.0, 0.0])  # x = (slide, hinge, their velocities): hanging
goal = np.zeros(4)  # upright, in the middle of the rail, at rest

# Cost: ½ Σ uᵀ R u + ½ (x - goal)ᵀ Q (x - goal), the last node weighted by F; u in [V].
R, Q, F = 2e-4, np.diag([0.02, 0.0, 0.002, 0.002]), np.diag([2e3, 2e3, 2e2, 2e2])


def cost(x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Of trajectories: x of shape (b, nodes + 1, 4), u of shape (b, nodes)."""
    e = x - goal
    last = np.einsum("bi,ij,bj->b", e[:, -1], F, e[:, -1])
    way = np.einsum("bki,ij,bkj->b", e[:, :-1], Q, e[:, :-1])
    return 0.5 * (last + way + R * (u**2).sum(axis=1))


def forward(x_old: np.ndarray, u_old: np.ndarray, k: np.ndarray, K: np.ndarray,
            sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Follow the improved policy with several sizes of the step at once, an arm for each."""
    x, u = np.tile(start, (len(sizes), NODES + 1, 1)), np.zeros((len(sizes), NODES))
    for i in range(NODES):
        u[:, i] = u_old[i] + sizes * k[i] + (x[:, i] - x_old[i]) @ K[i]
        u[:, i] = np.clip(u[:, i], -SUPPLY, SUPPLY)
        command = np.stack([u[:, i], np.zeros(len(sizes))], axis=1)
        x[:, i + 1] = sim.rollout(x[:, i, :2], x[:, i, 2:], command, TICKS, last_only=True)
    return x, u


def backward(x: np.ndarray, u: np.ndarray, much: float) -> tuple[np.ndarray, np.ndarray]:
    """Feed-forward and feedback of the quadratic model, regularised by ``much``."""
    command = np.stack([u, np.zeros(NODES)], axis=1)
    A, B = sim.linearize_many(x[:-1, :2], x[:-1, 2:], command, TICKS)
    b = B[:, :, 0]  # of the voltage
    V, v = F, F @ (x[-1] - goal)
    k, K = np.zeros(NODES), np.zeros((NODES, 4))
    for i in reversed(range(NODES)):
        more = V + much * np.eye(4)
        huu, hux = R + b[i] @ more @ b[i], b[i] @ more @ A[i]
        hu = R * u[i] + b[i] @ v
        K[i], k[i] = -hux / huu, -hu / huu
        if abs(u[i] + k[i]) >= SUPPLY:  # at its limit a voltage follows no feedback
            k[i], K[i] = np.clip(u[i] + k[i], -SUPPLY, SUPPLY) - u[i], 0.0
        hux, huu = b[i] @ V @ A[i], R + b[i] @ V @ b[i]
        v = Q @ (x[i] - goal) + A[i].T @ v + K[i] * (huu * k[i] + hu) + hux * k[i]
        V = Q + A[i].T @ V @ A[i] + huu * np.outer(K[i], K[i])
        V = V + np.outer(K[i], hux) + np.outer(hux, K[i])
        V = 0.5 * (V + V.T)
    return k, K


sizes = 0.5 ** np.arange(8)
u = 6.0 * np.sin(2.0 * np.pi * np.arange(NODES) / 60)  # a guess: rock it
none = np.zeros(NODES), np.zeros((NODES, 4))
x = forward(np.tile(start, (NODES + 1, 1)), u, *none, np.ones(1))[0][0]
costs, much, derivatives = [float(cost(x[None], u[None])[0])], 1e-2, 0.0
for _ in range(150):
    begin = time.perf_counter()
    k, K = backward(x, u, much)
    derivatives += time.perf_counter() - begin
    tried_x, tried_u = forward(x, u, k, K, sizes)
    values = np.nan_to_num(cost(tried_x, tried_u), nan=np.inf)
    best = int(np.argmin(values))
    if values[best] < costs[-1]:
        x, u, much = tried_x[best], tried_u[best], max(1e-8, 0.3 * much)
        costs.append(float(values[best]))
        if costs[-2] - costs[-1] < 1e-4 * costs[-1]:
            break
    else:
        much *= 10.0
        if much > 1e8:
            break
rounds = len(costs) - 1
print(f"{rounds} improvements, cost {costs[0]:.1f} -> {costs[-1]:.4f}")
print(
    f"derivatives and backward pass of {NODES} nodes: {1e3 * derivatives / max(1, rounds):.1f} ms"
)

# What was planned is what happens: the voltages alone, tick by tick, from rest.
sim.reset(start[:2], start[2:])
motion = sim.run(NODES * TICKS * sim.dt, np.repeat(np.stack([u, 0 * u], axis=1), TICKS, axis=0))
missed = abs(np.concatenate([motion.q[-1], motion.v[-1]]) - goal)
print(f"at the end {missed[0]:.1e} m and {missed[1]:.1e} rad off, {missed[2:].max():.1e} /s left")
print(f"rail used {abs(motion.q[:, 0]).max():.2f} m, voltage up to {abs(u).max():.1f} V")

with figure("swing_up", columns=3, size=(12, 3.4)) as (left, middle, right):
    left.plot(motion.time, motion.q[:, 1], label="pendulum [rad]")
    left.plot(motion.time, motion.q[:, 0], label="cart [m]")
    left.set(xlabel="time [s]", title="Swing-up; upright is 0")
    left.legend()
    middle.step(np.arange(NODES) * TICKS * sim.dt, u, where="post", color="tab:red")
    middle.set(xlabel="time [s]", ylabel="voltage [V]", title="What the motor gets")
    right.semilogy(costs, ".-")
    right.set(xlabel="improvement", ylabel="cost", title="iLQR")

assert missed.max() < 0.05 and abs(motion.q[:, 0]).max() < 2.0
