# SPDX-License-Identifier: Apache-2.0
"""A Panda writes: its pen stays on the sheet and is pressed on with 5 N, then it is lifted.

The pen on the sheet is a constraint, the pressure its multiplier.
"""

from importlib.resources import files

import numpy as np

from arm_dynamics.task_space import TaskSpace
from arm_sim import Simulator, State
from arm_sim.figures import figure

PRESSURE = 5.0  # [N]
LIFT = 0.05  # [m]
sim = Simulator(files("arm_sim") / "scenes/panda_pen.yaml", dt=1e-3)
dyn = sim.dynamics
hand = TaskSpace(dyn, "panda_hand", selection="position")
PEN = np.array([0.0, 0.0, 0.22])  # [m], in the hand


def tip(q: np.ndarray) -> np.ndarray:
    """Where the pen's tip is, in [m]."""
    pose = hand.pose(q)
    return np.asarray(pose.position + pose.rotation @ PEN)


start = tip(sim.state.q)


def write(state: State) -> np.ndarray:
    """Draw a circle: weight, a spring to the moving point, damping, pressure."""
    angle = 2.0 * np.pi * state.time / 4.0
    goal = start + 0.05 * np.array([np.cos(angle) - 1.0, np.sin(angle), 0.0])
    pull = 400.0 * (goal - tip(state.q))
    pull[2] = -PRESSURE if "sheet" in sim.held_constraints else pull[2] + 400.0 * LIFT
    return dyn.gravity(state.q) + dyn.contact_torque(state.q, pull) - 4.0 * state.v


motion = sim.run(4.0, write)
path = np.array([tip(q) for q in motion.q[::10]])
pressure = -motion.multipliers[:, 0]
print(f"tip leaves the sheet by {np.abs(path[:, 2] - 0.3).max():.1e} m")
print(f"circle of {np.ptp(path[:, 0]) * 1e3:.0f} by {np.ptp(path[:, 1]) * 1e3:.0f} mm")
print(f"pressure {pressure[200:].min():.2f} to {pressure[200:].max():.2f} N")

sim.set_constraint("sheet", False)
lifted = sim.run(0.5, write)
print(f"lifted: {1e3 * (tip(lifted.q[-1])[2] - 0.3):.0f} mm above the sheet")

with figure("pen", columns=2, size=(9, 4)) as (left, right):
    left.plot(path[:, 0], path[:, 1])
    left.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title="on the sheet")
    right.plot(motion.time, pressure)
    right.set(xlabel="time [s]", ylabel="pressure [N]")

assert np.abs(path[:, 2] - 0.3).max() < 1e-12
assert tip(lifted.q[-1])[2] > 0.301
