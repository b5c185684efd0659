# SPDX-License-Identifier: Apache-2.0
"""Gravity compensation: the arm stays where it is, and moves freely when it is pushed."""

from importlib.resources import files

import numpy as np

from arm_sim import Simulator, State
from arm_sim.figures import figure, legend_outside

sim = Simulator(files("arm_sim") / "scenes/panda.yaml")
push = np.array([0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0])  # [N m], for a tenth of a second


def floating(state: State) -> np.ndarray:
    """Compensate gravity, with a short push at the beginning."""
    weight = sim.dynamics.gravity(state.q)
    return weight + push if state.time < 0.1 else weight


released = sim.run(0.5)
fallen = np.abs(released.q[-1] - released.q[0]).max()
print(f"without torque the arm falls: {fallen:.2f} rad in 0.5 s")

sim.reset()
still = sim.run(1.0, control=lambda state: sim.dynamics.gravity(state.q))
moved = np.abs(still.q[-1] - still.q[0]).max()
print(f"with gravity compensation it stays: {moved:.1e} rad in 1 s")

sim.reset()
pushed = sim.run(2.0, control=floating)
print("after a push it moves on; joint speeds after 0.1, 1 and 2 s in rad/s:")
for tick in (100, 1000, 2000):
    print("  ", np.round(pushed.v[tick], 4))
print(f"energy balance: {np.abs(pushed.balance).max():.1e} J")

with figure("gravity_compensation", columns=2) as (left, right):
    for name, run in {"no torque": released, "weight carried": still}.items():
        left.plot(run.time, np.abs(run.q - run.q[0]).max(axis=1), label=name)
    left.set(xlabel="time [s]", ylabel="farthest joint [rad]", title="Released", xlim=(0.0, 0.5))
    left.legend()
    right.plot(pushed.time, pushed.v, label=[f"joint {i + 1}" for i in range(sim.n)])
    right.set(xlabel="time [s]", ylabel="speed [rad/s]", title="After a push")
    legend_outside(right.figure)

assert moved < 1e-9
