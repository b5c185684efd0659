# SPDX-License-Identifier: Apache-2.0
r"""
An arm held by friction
=======================

At rest, the friction of a joint is a reaction: it balances gravity and the command,
:math:`F = \tau - g(q)`, as long as :math:`|F| \le F_s`. A UR5e with :math:`F_s` = 45 N m in
shoulder and elbow holds itself without a command. A torque of the elbow that falls at
:math:`r` = 60 N m/s makes it break away at :math:`t = (F_s - g_3) / r`, and not before.

:Lectures: textbooks, static friction
:Equations: 1; 8
:Shows: an arm that does not move by one bit, and when it breaks away
"""

import numpy as np
from matplotlib import pyplot as plt

from arm_dynamics import load_scene
from arm_sim import Simulator
from arm_sim.figures import use_style

use_style()
static, rate, elbow = 45.0, 60.0, 2  # [N m], [N m/s]
strong, weak = {"coulomb": 40.0, "static": static}, {"coulomb": 4.0, "static": 5.0}
friction = {"*": {"friction": weak}} | {
    name: {"friction": strong} for name in ("shoulder_lift_joint", "elbow_joint")
}
sim = Simulator(load_scene("ur5e").model_dump(exclude_unset=True) | {"joints": friction})
weight = sim.dynamics.gravity(sim.state.q)  # [N m]
print("gravity:", weight.round(1), "N m")
leaves = (static - weight[elbow]) / rate  # [s]
run = sim.run(1.5, lambda state: [0, 0, -rate * state.time, 0, 0, 0])
first = int(np.argmax(run.v[:, elbow] != 0.0))
print(f"it breaks away at {run.time[first]:.3f} s, by the formula at {leaves:.4f} s")
assert not run.v[:first].any() and abs(run.time[first] - leaves) <= 2 * sim.dt

near = abs(run.time - leaves) < 0.02
time, load = 1e3 * (run.time[near] - leaves), run.tau[near] - sim.dynamics.gravity(run.q[near])
figure, (load_axis, speed_axis) = plt.subplots(2, 1, sharex=True, figsize=(6.4, 4.4))
held = time <= 0.0  # afterwards friction no longer balances the load
load_axis.plot(time[held], -load[held, elbow], label="load, balanced by friction")
load_axis.axhline(static, color="C1", label="static friction $F_s$")
load_axis.set(title="Elbow", ylabel="torque [N m]")
load_axis.legend()
speed_axis.plot(time, -1e3 * run.v[near, elbow])
speed_axis.set(xlabel="time after the break-away of the formula [ms]", ylabel="speed [mrad/s]")
for axis in (load_axis, speed_axis):
    axis.axvline(0.0, color="0.4", linestyle="--")

# %%
# In motion
# ---------

# sphinx_gallery_thumbnail_number = 2
motion = run.animate()
plt.show()

# %%
# Questions
# ---------
# 1. Which static friction is just enough to hold the arm? *Hint:* the largest torque of gravity.
