# SPDX-License-Identifier: Apache-2.0
"""A double pendulum swings freely: which integrators conserve its energy?"""

from importlib.resources import files

import numpy as np

from arm_sim import Simulator
from arm_sim.figures import figure

scene = files("arm_sim") / "scenes/double_pendulum.yaml"
with figure("energy", size=(7.2, 4.0)) as axis:
    drift = {}
    names = {"euler": "Euler", "semi_implicit_euler": "semi-implicit Euler"}
    for method in (*names, "midpoint", "rk4", "dopri5", "dop853"):
        motion = Simulator(scene, integrator=method, dt=1e-3).run(10.0)  # [s], no torque
        error = np.abs(motion.energy - motion.energy[0])
        drift[method] = error.max()
        name = names.get(method, method if method == "midpoint" else method.upper())
        label = f"{name}: {drift[method]:.0e} J"
        axis.semilogy(motion.time, np.fmax(error, 1e-16), label=label)
        print(f"{method:<20} energy error {drift[method]:.1e} J")

    axis.set(
        xlabel="time [s]", ylabel="energy error [J]", title="Free double pendulum, steps of 1 ms"
    )
    axis.legend(ncols=2)

assert drift["rk4"] < 1e-4 < 1e-1 < drift["euler"]
