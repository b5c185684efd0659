# SPDX-License-Identifier: Apache-2.0
"""A gripper closes on a box until its motors reach their current limit, lifts it and drops it.

The fingertips are balls, the faces of the box planes on a moving link. The current determines the
weight that the fingers can lift: two contacts with friction carry 2 µ (N K_t I - F_c).
"""

from importlib.resources import files

import numpy as np

from arm_sim import Simulator, State, contact_history
from arm_sim.figures import figure

FORCE_PER_CURRENT, LIMIT, RUB, MU = 1000 * 0.02, 0.5, 0.5, 0.5  # N K_t [N/A], [A], [N], µ
PALM = 0.5 + 2 * 0.08  # [kg], with the fingers
CLOSED, UP, OPEN = 0.4, 1.4, 1.8  # [s]
sim = Simulator(files("arm_sim") / "scenes/lifting_gripper.yaml")
height, lift, left, right = map(sim.joint_names.index, ("box_height", "lift", "left", "right"))


curves = {}


def grasp(current: float) -> tuple[float, float]:
    """Close with a current in [A], lift by 0.1 m, open; forces in the air and the box's height."""

    def command(state: State) -> np.ndarray:
        u = np.zeros(sim.n)
        u[[left, right]] = -current if state.time < UP else 0.2
        goal = 0.1 * np.clip((state.time - CLOSED) / 0.6, 0.0, 1.0)
        u[lift] = 9.81 * PALM + 2000.0 * (goal - state.q[lift]) - 60.0 * state.v[lift]
        return u

    sim.reset()
    run = sim.run(OPEN, command)
    force = contact_history(sim, run).force
    curves[current] = run.time, 1e3 * run.q[:, height]
    carried = round(UP / sim.dt) - 1
    print(
        f"{current:.2f} A: squeezed with {abs(force[carried, 0, 1]):.3f} N, carried by "
        f"{-force[carried, :, 2].sum():.3f} N; the box is {1e3 * run.q[carried, height]:.1f} mm up"
        f", after opening {1e3 * run.q[-1, height]:.1f} mm, fingers at {run.q[-1, left]:.3f} m"
    )
    return abs(force[carried, 0, 1]), run.q[carried, height]


print(f"the limit of {LIMIT} A allows {MU * 2 * (FORCE_PER_CURRENT * LIMIT - RUB) / 9.81:.2f} kg")
squeezed, up = grasp(2.0 * LIMIT)  # clipped at the limit
_, slipped = grasp(0.15)  # too little for 0.3 kg

with figure("grasp_and_lift", size=(7, 4)) as axis:
    for current, (time, up_by) in curves.items():
        axis.plot(time, up_by, label=f"{min(current, LIMIT):.2f} A")
    for moment, what in ((CLOSED, "lifts"), (UP, "opens")):
        axis.axvline(moment, color="0.6", linestyle=":")
        axis.text(moment, 106, f" {what}", color="0.4")
    axis.set(
        xlabel="time [s]",
        ylabel="height of the box [mm]",
        title="Enough current, too little",
        ylim=(-5.0, 115.0),
    )
    axis.legend()

assert abs(squeezed - (FORCE_PER_CURRENT * LIMIT - RUB)) < 1e-6 and up > 0.09 > slipped
