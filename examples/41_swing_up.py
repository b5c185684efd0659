# SPDX-License-Identifier: Apache-2.0
"""Swing-up of a cart-pole by iLQR: motor, gear and friction are in the model that is optimized.

``arm_studies.optimization.ILQR`` improves a trajectory by the exact derivatives of the
simulation's own steps, within the motor's voltage limit. The plan is then executed on the arm at
1 kHz.
"""

import time

import numpy as np

from arm_dynamics import load_scene
from arm_sim import Simulator
from arm_sim.figures import figure
from arm_studies.optimization import ILQR, Phase, QuadraticCost

NODES, DT = 125, 0.02  # 2.5 s
SUPPLY = 24.0  # [V]

scene = load_scene("cart_pendulum").model_dump(exclude_unset=True)
motor = {"resistance": 0.6, "torque_constant": 0.05, "rotor_inertia": 2e-5, "gear_ratio": 100,
         "command": "voltage", "voltage_limit": SUPPLY}  # fmt: skip
scene["joints"] = {
    "slide": {"actuator": motor, "friction": {"viscous": 3.0}},
    "hinge": {"friction": {"viscous": 0.02}},
}
sim = Simulator(scene, dt=DT)
start = np.array([0.0, np.pi, 0.0, 0.0])  # x = (slide, hinge, their velocities): hanging
goal = np.zeros(4)  # upright, in the middle of the rail, at rest

# The cost: errors, mainly at the end, and the voltage.
x_weight = np.tile([0.02, 0.0, 0.002, 0.002], (NODES + 1, 1))
x_weight[-1] = [2e3, 2e3, 2e2, 2e2]
cost = QuadraticCost(
    np.tile(goal, (NODES + 1, 1)), x_weight, np.zeros((NODES, 2)), np.full((NODES, 2), 2e-4)
)
guess = np.zeros((NODES, 2))
guess[:, 0] = 6.0 * np.sin(2.0 * np.pi * np.arange(NODES) / 60)  # rock it

most = np.array([SUPPLY, 0.0])  # nothing drives the hinge
optimizer = ILQR([Phase(sim, NODES)], cost, low=-most, high=most, tolerance=1e-4)
optimizer.solve(start, guess, iterations=1)  # compiles
begin = time.perf_counter()
best = optimizer.solve(start, guess, iterations=200)
took, rounds = time.perf_counter() - begin, len(best.costs) - 1
print(f"{best.verdict} after {rounds} improvements of {1e3 * took / rounds:.2f} ms, "
      f"cost {best.costs[0]:.1f} -> {best.cost:.4f}")  # fmt: skip

# Execute the plan: apply the voltages alone, tick by tick, from rest.
arm = Simulator(scene)
arm.reset(start[:2], start[2:])
motion = arm.run(NODES * DT, np.repeat(best.u, round(DT / arm.dt), axis=0))
missed = abs(np.concatenate([motion.q[-1], motion.v[-1]]) - goal)
print(f"at the end {missed[0]:.1e} m and {missed[1]:.1e} rad off, {missed[2:].max():.1e} /s left")
print(f"rail used {abs(motion.q[:, 0]).max():.2f} m, voltage up to {abs(best.u).max():.1f} V")

with figure("swing_up", columns=3, size=(7.2, 2.6)) as (left, middle, right):
    left.plot(motion.time, motion.q[:, 1], label="pendulum")
    left.plot(motion.time, motion.q[:, 0], label="cart")
    left.set(xlabel="time [s]", ylabel="angle [rad], way [m]", title="Swing-up; upright is 0")
    left.legend(loc="center left")
    middle.step(np.arange(NODES) * DT, best.u[:, 0], where="post", color="C3")
    middle.set(xlabel="time [s]", ylabel="voltage [V]", title="Motor voltage")
    right.semilogy(best.costs, ".-")
    right.set(xlabel="improvement", ylabel="cost", title="iLQR")

assert missed.max() < 0.05 and abs(motion.q[:, 0]).max() < 2.0
