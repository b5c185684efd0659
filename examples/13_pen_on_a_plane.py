# SPDX-License-Identifier: Apache-2.0
"""A Panda draws a circle, pressing the pen on the sheet with 5 N, then lifts it.

The pen on the sheet is a constraint, and the pressing force its multiplier.
"""

from importlib.resources import files

import numpy as np

from arm_dynamics.task_space import TaskSpace
from arm_sim import Simulator, State
from arm_sim.figures import figure

PRESSURE = 5.0  # [N]
LIFT = 0.02  # [m]
RADIUS = 0.05  # [m]
STRONGEST = 20.0  # [N] upwards
sim = Simulator(files("arm_sim") / "scenes/panda_pen.yaml", dt=1e-3)
dyn = sim.dynamics
hand = TaskSpace(dyn, "panda_hand")
PEN = np.array([0.0, 0.0, 0.22])  # [m], in the hand


def tip(q: np.ndarray) -> np.ndarray:
    """Where the pen's tip is, in [m]."""
    pose = hand.pose(q)
    return np.asarray(pose.position + pose.rotation @ PEN)


def tip_speed(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Velocity of the pen's tip, in [m/s]."""
    linear, angular = np.split(hand.jacobian(q) @ v, 2)
    return np.asarray(linear + np.cross(angular, hand.pose(q).rotation @ PEN))


start = tip(sim.state.q)


def write(state: State) -> np.ndarray:
    """Draw a circle: gravity compensation, a spring and damper to the moving point, pressure."""
    turn = 2.0 * np.pi / 4.0  # [rad/s]
    s, c = np.sin(turn * state.time), np.cos(turn * state.time)
    goal = start + RADIUS * np.array([c - 1.0, s, 0.0])
    speed = RADIUS * turn * np.array([-s, c, 0.0])
    writes = "sheet" in sim.held_constraints
    goal[2] += 0.0 if writes else LIFT
    pull = 3000.0 * (goal - tip(state.q)) + 150.0 * (speed - tip_speed(state.q, state.v))
    pull[2] = -PRESSURE if writes else min(pull[2], STRONGEST)
    return dyn.gravity(state.q) + dyn.contact_torque(state.q, pull) - 0.5 * state.v


motion = sim.run(4.0, write)
path = np.array([tip(q) for q in motion.q[::10]])
pressure = -motion.multipliers[:, 0]
print(f"tip leaves the sheet by {np.abs(path[:, 2] - 0.3).max():.1e} m")
middle = start[:2] - [RADIUS, 0.0]
off = np.abs(np.hypot(*(path[:, :2] - middle).T) - RADIUS)
print(f"off the circle of {1e3 * RADIUS:.0f} mm by {1e3 * off.max():.2f} mm at most")
print(f"pressure {pressure[200:].min():.2f} to {pressure[200:].max():.2f} N")

sim.set_constraint("sheet", False)
lifted = sim.run(0.5, write)
print(f"lifted: {1e3 * (tip(lifted.q[-1])[2] - 0.3):.0f} mm above the sheet")

with figure("pen", columns=2, size=(7.2, 3.2)) as (left, right):
    left.plot(path[:, 0], path[:, 1])
    left.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title="On the sheet")
    right.plot(motion.time, pressure)
    right.set(xlabel="time [s]", ylabel="force [N]", title="Pressure on the sheet")

assert np.abs(path[:, 2] - 0.3).max() < 1e-12
assert off.max() < 1e-3
assert tip(lifted.q[-1])[2] > 0.301
