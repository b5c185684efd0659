# SPDX-License-Identifier: Apache-2.0
"""An arm moves down to a table, pushes on it, slides along it and lifts off.

Its torques are gravity compensation, some damping, and Jᵀf for the desired force f. The reaction
of the table follows from rigid contact: no springs, no penetration.
"""

from importlib.resources import files

import numpy as np

from arm_sim import Simulator, State, contact_history
from arm_sim.figures import figure

PHASES = (  # until when [s], and the force of the hand on the world [N]
    (0.7, (0.0, 0.0, -5.0)),  # down
    (1.4, (0.0, 0.0, -20.0)),  # push
    (2.1, (12.0, 0.0, -20.0)),  # push sideways, by more than friction can hold
    (2.5, (0.0, 0.0, 10.0)),  # up
)
sim = Simulator(files("arm_sim") / "scenes/panda_table.yaml", dt=1e-3)
dyn = sim.dynamics


def push(state: State) -> np.ndarray:
    """Torques of the phase: weight, force, damping."""
    force = next(f for until, f in PHASES if state.time < until)
    return dyn.gravity(state.q) + dyn.contact_torque(state.q, force) - 8.0 * state.v


motion = sim.run(PHASES[-1][0], push)
history = contact_history(sim, motion)
normal = history.force[:, 0, 2]
sideways = np.linalg.norm(history.force[:, 0, :2], axis=1)
gap = history.gap[:, 0]


def at(time: float) -> int:
    """Index of a time in the recording."""
    return int(round(time / sim.dt))


touch = motion.time[np.argmax(normal > 0.0)]
leave = motion.time[np.flatnonzero(normal > 0.0)[-1]]
print(f"touches at {touch:.3f} s, {gap.min():+.1e} m at the lowest")
print(f"pushes   {normal[at(1.399)]:8.3f} N down, {sideways[at(1.399)]:7.3f} N sideways: sticks")
print(
    f"slides   {normal[at(2.099)]:8.3f} N down, {sideways[at(2.099)]:7.3f} N sideways: 0.4 of it"
)
print(f"leaves after {leave:.3f} s; impacts took {1e3 * history.impact_loss[-1]:.3f} mJ,")
print(f"friction {1e3 * history.friction_loss[-1]:.3f} mJ")

with figure("table", rows=2, size=(7.2, 4.5), sharex=True) as (above, below):
    above.plot(motion.time, normal, label="normal")
    above.plot(motion.time, sideways, label="friction")
    above.set(ylabel="force of the table [N]", ylim=(-1, 30))
    above.legend()
    below.plot(motion.time, 1e3 * gap)
    below.set(xlabel="time [s]", ylabel="height above the table [mm]")

assert gap.min() > -1e-12 and normal.min() >= 0.0
assert abs(sideways[at(2.099)] - 0.4 * normal[at(2.099)]) < 1e-9
assert gap[-1] > 0.001
