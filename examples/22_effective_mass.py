# SPDX-License-Identifier: Apache-2.0
"""Feeling the effective mass: push a hand in several directions and see how heavy it is."""

from importlib.resources import files

import numpy as np

from arm_dynamics.task_space import TaskSpace
from arm_sim import Simulator
from arm_sim.figures import figure

sim = Simulator(files("arm_sim") / "scenes/two_link.yaml", dt=1e-3)
hand = TaskSpace(sim.dynamics, "tip", selection=("x", "z"))
force = 1.0  # [N]

for q in ([-0.5, 1.6], [-0.5, 0.8], [0.3, 0.1], [0.3, 0.0]):
    ellipsoid = hand.mass_ellipsoid(q)
    light, heavy = ellipsoid.masses
    note = ", singular: the heavy one is really infinite" if ellipsoid.damped else ""
    print(f"elbow at {q[1]:3.1f} rad: between {light:.2f} and {heavy:.2f} kg{note}")

print("\nfelt by pushing with 1 N for a millisecond, the drives carrying the weight:")
q = np.array([-0.5, 1.6])
curve = []
for angle in np.deg2rad([0, 30, 60, 90, 120, 150]):
    u = np.array([np.cos(angle), np.sin(angle)])
    sim.reset(q)
    J = hand.jacobian(q)
    sim.step(sim.dynamics.gravity(q) + J.T @ (force * u))
    rate = hand.jacobian(sim.state.q) @ sim.state.v @ u
    felt = force * sim.dt / rate
    said = hand.effective_mass(q, u).mass
    curve.append((angle, felt))
    print(f"  {np.rad2deg(angle):4.0f}°: felt {felt:.4f} kg, computed {said:.4f} kg")
    assert abs(felt / said - 1.0) < 0.02

with figure("effective_mass", size=(5.5, 5.5), subplot_kw={"projection": "polar"}) as axis:
    every = np.linspace(0.0, 2.0 * np.pi, 181)
    masses = [hand.effective_mass(q, np.array([np.cos(a), np.sin(a)])).mass for a in every]
    axis.plot(every, masses, label="computed")
    axis.plot(*np.transpose(curve), "o", label="felt")
    axis.set_title("mass of the hand [kg], by direction")
    axis.legend(loc="lower right")
