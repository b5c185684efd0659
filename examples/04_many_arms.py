# SPDX-License-Identifier: Apache-2.0
"""A thousand arms at once, each with its own torques, for learning or sampling-based planning."""

import time
from importlib.resources import files

import numpy as np

from arm_sim import Simulator
from arm_sim.figures import figure

ARMS, TICKS = 1000, 200

sim = Simulator(files("arm_sim") / "scenes/panda.yaml")
rng = np.random.default_rng(0)
q0 = sim.state.q + rng.normal(0.0, 0.05, (ARMS, sim.n))  # [rad]
v0 = np.zeros((ARMS, sim.n))
tau = sim.dynamics.gravity(q0)[:, None, :] + rng.normal(0.0, 1.0, (ARMS, TICKS, sim.n))  # [N m]

sim.rollout(q0, v0, tau, TICKS)  # the first call compiles
start = time.perf_counter()
paths = sim.rollout(q0, v0, tau, TICKS)  # (arms, ticks + 1, 2n)
took = time.perf_counter() - start
per_tick = 1e6 * took / ARMS / TICKS
print(f"{ARMS} arms, {TICKS} ticks of RK4: {1e3 * took:.1f} ms, {per_tick:.2f} µs a tick")

# Every arm moves as it would alone.
sim.reset(q0[7], v0[7])
alone = sim.run(TICKS * sim.dt, control=tau[7])
np.testing.assert_allclose(paths[7, :, : sim.n], alone.q, atol=1e-12)

nearest = np.argmin(np.linalg.norm(paths[:, -1, : sim.n] - sim.model.q0, axis=1))
print(f"arm {nearest} ends nearest to the initial posture")

with figure("many_arms", size=(7, 4)) as axis:
    time_axis = sim.dt * np.arange(TICKS + 1)
    axis.plot(time_axis, paths[::10, :, 1].T, color="C0", alpha=0.25, linewidth=0.7)
    axis.plot(time_axis, paths[nearest, :, 1], color="C1", label="nearest at the end")
    axis.set(xlabel="time [s]", ylabel="joint 2 [rad]", title="A hundred of a thousand arms")
    axis.legend()
