# SPDX-License-Identifier: Apache-2.0
"""A DC motor drives a slider-crank with friction: its energy account, and stalling.

One scene combines a closed chain, a motor with inductance and dry friction that sticks.
"""

from importlib.resources import files

import numpy as np

from arm_sim import Simulator
from arm_sim.figures import figure

sim = Simulator(files("arm_sim") / "scenes/slider_crank_motor.yaml")
pivot, rail = (sim.joint_names.index(name) for name in ("pivot", "rail"))


def voltage(volts: float) -> np.ndarray:
    """Command of the one motor, in [V]."""
    return volts * np.eye(sim.n)[pivot]


run = sim.run(3.0, voltage(12.0))
late = run.time > 1.0  # in steady motion
speed, current = run.v[late, pivot], run.z[late, 0]
ticks = run.time[1:] - run.time[:-1]
winding = 0.8 * float(np.sum(0.5 * (run.z[1:, 0] ** 2 + run.z[:-1, 0] ** 2) * ticks))  # R i²
rubbing = 6.0 * float(np.abs(np.diff(run.q[:, rail])).sum())  # 6 N along the way
bearing = 0.02 * float(np.sum(0.5 * (run.v[1:, pivot] ** 2 + run.v[:-1, pivot] ** 2) * ticks))

print(f"at 12 V it turns at {speed.mean():.2f} rad/s, {speed.min():.2f} to {speed.max():.2f},")
print(f"and takes {current.min():.2f} to {current.max():.2f} A")
print(f"of {run.supplied[-1]:.2f} J the winding heats with {winding:.2f} J, the slider with")
print(
    f"{rubbing:.2f} J, the crank's bearing with {bearing:.2f} J; all heat is {run.lost[-1]:.2f} J"
)
print(f"energy balance: {np.abs(run.balance).max():.0e} J")


def held(volts: float) -> bool:
    """Whether it stays exactly where it starts."""
    sim.reset()
    return not np.ptp(sim.run(0.1, voltage(volts)).q, axis=0).any()


holding = [volts for volts in np.arange(-3.0, 3.0, 0.1) if held(volts)]
print(f"it stays at rest between {min(holding):.1f} and {max(holding):.1f} V, to the bit")

with figure("slider_crank", columns=2) as (left, right):
    left.plot(run.time, run.v[:, pivot])
    left.set(xlabel="time [s]", ylabel="speed of the crank [rad/s]", title="At 12 V")
    spent = {"winding": winding, "slider": rubbing, "bearing": bearing}
    right.bar(list(spent), list(spent.values()), color=["C1", "C0", "C2"])
    right.set(ylabel="heat in 3 s [J]", title="Where the energy goes")

assert abs(winding + rubbing + bearing - run.lost[-1]) < 1e-2 * run.lost[-1]
assert np.abs(run.balance).max() < 1e-6 and -2.9 < min(holding) < max(holding) < 2.8
