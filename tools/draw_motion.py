# SPDX-License-Identifier: Apache-2.0
"""Draws the film of the README: a Panda, held by friction, is dragged along a table and let go."""

from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

from arm_dynamics import load_scene
from arm_sim import Simulator, contact_history
from arm_sim.figures import joint_words, legend_outside, use_style
from arm_sim.view import pictures, show

FILM, RATE = Path(__file__).parents[1] / "docs/figures/arm.gif", 1 / 0.03  # frames per second
FORCES = [[0, 0, 0], [15, 35, -60], [-10, -45, -60], [0, 0, 0]]  # [N] on the hand
UNTIL, END = [0.8, 2.2, 3.6], 4.6  # [s]
FRICTION = {"*": {"friction": {"coulomb": 3.0, "static": 4.0, "viscous": 4.0}}}
sim = Simulator(load_scene("panda_table").model_dump(exclude_unset=True) | {"joints": FRICTION})
ORANGE, ARROW = (213, 94, 0), {"shaft_radius": 0.008, "head_radius": 0.022, "head_length": 0.05}
drag = lambda t, q: sim.dynamics.jacobian(q, "panda_hand")[:3].T @ FORCES[np.digitize(t, UNTIL)]  # noqa: E731
run = sim.run(END, lambda now: sim.dynamics.gravity(now.q) + drag(now.time, now.q))
use_style()
plt.rcParams |= {"xtick.labelsize": 9.0, "ytick.labelsize": 9.0, "legend.fontsize": 9.0}
figure, axes = plt.subplots(3, 1, sharex=True, figsize=(4.0, 4.0), dpi=100)
axes[0].plot(run.time, [drag(t, q) for t, q in zip(run.time, run.q, strict=True)])
axes[1].plot(run.time, np.linalg.norm(contact_history(sim, run).force[:, 0], axis=1), "0.5")
axes[2].plot(run.time, run.v, label=joint_words(sim.joint_names))
legend_outside(figure, below=True)
axes[0].set_title("Torque of the drag (arrow) on the joints [N m]")
axes[1].set_title("Force of the table [N]")
lines = [axis.axvline(0.0, color="0.4", lw=1.0, zorder=9) for axis in axes]
axes[2].set(title="Velocity of the joints [rad/s]", xlabel="time [s]", xlim=(0.0, END))
with show(run, port=0) as page, page._camera((400, 400)) as shoot:
    pull = page._server.scene.add_arrows("/drag", np.zeros((1, 2, 3)), ORANGE, **ARROW)
    films = []
    for time in np.arange(0.0, END, 1.0 / RATE):
        page._seek(time)
        q = run.q[np.searchsorted(run.time, time - 1e-9)]
        force, hand = FORCES[np.digitize(time, UNTIL)], sim.dynamics.pose(q, "panda_hand")[:3, 3]
        pull.visible = any(force)
        pull.points = np.array([[hand, hand + 4e-3 * np.array(force)]])
        plt.setp(lines, xdata=[time, time])
        figure.canvas.draw()
        films.append(np.hstack([shoot(), np.asarray(figure.canvas.buffer_rgba())[..., :3]]))
pictures.write_film(FILM, films, RATE)
