# SPDX-License-Identifier: Apache-2.0
"""A four-bar linkage turns freely: closure of its loop, and the force in its hinge."""

from importlib.resources import files

import numpy as np

from arm_sim import Simulator
from arm_sim.figures import figure

sim = Simulator(files("arm_sim") / "scenes/four_bar.yaml", dt=1e-3)
print(sim.plan)

motion = sim.run(10.0)  # [s], no torque
crank, coupler = motion.q[:, 0], motion.q[:, 0] + motion.q[:, 1]  # angles to the ground
rocker = motion.q[:, 2]
knee = 0.1 * np.exp(1j * crank)  # points of the plane as x + i z, [m]
gap = np.abs(knee + 0.3 * np.exp(1j * coupler) - (0.35 + 0.25 * np.exp(1j * rocker)))
force = np.linalg.norm(motion.multipliers, axis=1)  # of the coupler upon the rocker, [N]

print(f"turns of the crank   {(crank[-1] - crank[0]) / (2 * np.pi):.1f}")
print(f"rocker swings        {np.degrees(np.ptp(rocker)):.1f} degrees")
print(f"gap of the loop      {gap.max():.1e} m at most")
print(f"energy varies by    {np.ptp(motion.energy):.1e} J")
print(f"force in the hinge   {force.min():.2f} to {force.max():.2f} N")

with figure("four_bar", columns=2, size=(7.2, 3.2)) as (left, right):
    middle = knee + 0.15 * np.exp(1j * coupler)
    left.plot(middle.real, middle.imag)
    for k in range(0, 700, 100):
        chain = np.array([0, knee[k], 0.35 + 0.25 * np.exp(1j * rocker[k]), 0.35])
        left.plot(chain.real, chain.imag, "o-", color="0.8", zorder=0, markersize=3)
    left.set(xlabel="x [m]", ylabel="z [m]", aspect="equal", title="Path of the coupler's middle")
    right.plot(motion.time[:2000], force[:2000])
    right.set(xlabel="time [s]", ylabel="force [N]", title="Force in the hinge")

assert gap.max() < 1e-12
assert np.ptp(motion.energy) < 1e-6
