# SPDX-License-Identifier: Apache-2.0
"""Regulation: go to a point and stay there, with four controllers that know more and more."""

from importlib.resources import files

import numpy as np

from arm_dynamics.control import PD, PID, ComputedTorque, PDGravity, tuned
from arm_dynamics.task_space import InverseKinematics, Pose, TaskSpace
from arm_dynamics.trajectory import Reference
from arm_sim import Simulator
from arm_sim.figures import figure

sim = Simulator(files("arm_sim") / "scenes/two_link.yaml", dt=1e-3)
hand = TaskSpace(sim.dynamics, "tip", selection=("x", "z"))
point = Pose(np.array([0.45, 0.0, 0.45]), np.eye(3))
goal = InverseKinematics(hand).reach(point)
print(f"joint positions for the point {point.position} m: {np.round(goal, 4)} rad")

reference = Reference(goal, np.zeros(2), np.zeros(2))
kp, kd = tuned(sim.dynamics, 12.0)
controllers = {
    "PD": PD(2, kp, kd),
    "PID": PID(2, kp, 4.0 * kp, kd, sim.dt),
    "PD + gravity": PDGravity(sim.dynamics, kp, kd),
    "computed torque": ComputedTorque(sim.dynamics, 12.0),
}
left, curves = {}, {}
print("distance of the hand from the point in mm after 0.25, 0.5, 1, 2 and 4 s:")
for name, control in controllers.items():
    sim.reset()
    done = sim.run(4.0, lambda state, chosen=control: chosen.torque(state, reference))
    off = 1e3 * np.linalg.norm(hand.pose(done.q).position - point.position, axis=1)
    left[name], curves[name] = off[-1], off
    print(f"  {name:16s}", " ".join(f"{off[k]:10.4f}" for k in (250, 500, 1000, 2000, 4000)))

with figure("regulation", size=(7, 4)) as axis:
    for name, off in curves.items():
        axis.semilogy(done.time, np.fmax(off, 1e-6), label=name)
    axis.set(xlabel="time [s]", ylabel="distance from the point [mm]", title="Go there, and stay")
    axis.legend()

assert left["PD"] > 10.0
assert left["PD + gravity"] < 1e-3 and left["computed torque"] < 1e-6
