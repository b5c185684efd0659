# SPDX-License-Identifier: Apache-2.0
"""Switching controllers during a motion: abruptly, and without a jump of the torque."""

from importlib.resources import files

import numpy as np

from arm_dynamics.control import Settings, Switch, make_controller
from arm_dynamics.trajectory import Waypoint, quintic
from arm_sim import Simulator
from arm_sim.figures import figure

sim = Simulator(files("arm_sim") / "scenes/panda.yaml", dt=1e-3)
goal = sim.state.q + [0.4, 0.3, -0.2, 0.3, 0.2, 0.3, -0.4]
motion = quintic([Waypoint(0.0, sim.state.q), Waypoint(1.6, goal)])
settings = Settings(dt=sim.dt, bandwidth=10.0, frame="panda_hand_tcp")
order = ("pd_gravity", "cartesian_impedance", "computed_torque", "operational_space")
controllers = [make_controller(name, sim.dynamics, settings) for name in order]

jumps, curves = {}, {}
for fade in (0.0, 0.2):
    sim.reset()
    control, torques = Switch(controllers[0], sim.dt, fade), []
    for tick in range(2400):
        if tick and tick % 500 == 0 and tick // 500 < len(controllers):
            control.to(controllers[tick // 500])
        torques.append(control.torque(sim.state, motion.sample(sim.state.time)))
        sim.step(torques[-1])
    steps = abs(np.diff(torques, axis=0)).max(axis=1)
    jumps[fade], curves[fade] = steps.max(), np.array(torques)
    print(f"fade {fade:.1f} s: largest step of a torque from tick to tick {steps.max():.3f} N m, "
          f"error at the end {abs(sim.state.q - goal).max():.1e} rad")  # fmt: skip

with figure("hand_over", size=(7.2, 3.6)) as axis:
    for fade, torques in curves.items():
        axis.plot(sim.dt * np.arange(len(torques)), torques[:, 1], label=f"fade {fade:.1f} s")
    for k, name in enumerate(order):
        axis.axvline(0.5 * k, color="0.7", linestyle=":")
        axis.text(
            0.5 * k,
            axis.get_ylim()[1],
            f" {name.replace('pd_', 'PD + ').replace('_', ' ')}",
            color="0.4",
            size=8,
        )
    axis.set(xlabel="time [s]", ylabel="torque of joint 2 [N m]", xlim=(-0.05, 2.05))
    axis.legend()

assert jumps[0.2] < 0.2 * jumps[0.0]
