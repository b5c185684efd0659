# SPDX-License-Identifier: Apache-2.0
r"""
PP robot
========

Two sliding joints at right angles in a vertical plane, as in a plotter: the simplest robot, whose
joints do not feel each other's motion. *Dynamics of open chain* (CTU) simulates it and leaves the
equations to the reader. With the carriage :math:`m_1`, the end effector :math:`m_2`, and
:math:`q_2` upwards,

.. math::

    T = \tfrac12 (m_1 + m_2) \dot q_1^2 + \tfrac12 m_2 \dot q_2^2, \qquad
    V = m_2 g q_2,

.. math::

    \tau_1 = (m_1 + m_2)\, \ddot q_1, \qquad \tau_2 = m_2 \ddot q_2 + m_2 g .

The mass matrix is diagonal and constant, so there are no Coriolis terms.

:Lectures: CTU, simulation of the PP robot
:Equations: 1
:Shows: a mass matrix without coupling; a circle by two forces
"""

from importlib.resources import files

import numpy as np
from matplotlib import pyplot as plt

from arm_sim import Simulator
from arm_sim.figures import animation, use_style

use_style()

# %%
# The scene
# ---------

print((files("arm_sim") / "scenes/lectures/pp_robot.yaml").read_text())

# %%
# The matrices
# ------------

m1, m2, g = 3.0, 2.0, 9.81
sim = Simulator("pp_robot", integrator="rk4", dt=1e-3)
dyn = sim.dynamics
M, G = dyn.mass_matrix([0.2, 0.1]), dyn.gravity([0.2, 0.1])
print(M, G, sep="\n")
assert np.abs(M - np.diag([m1 + m2, m2])).max() <= 1e-12
assert np.abs(G - [0.0, m2 * g]).max() <= 1e-12
assert np.abs(dyn.coriolis_matrix([0.2, 0.1], [1.0, -2.0])).max() <= 1e-12

# %%
# The run and the closed form
# ---------------------------
# The end effector is to draw a circle of radius :math:`r`. Inverse dynamics of the circle gives
# the forces, which are sinusoids of time. A computer holds each of them for a time step :math:`h`,
# so in each step the acceleration is constant, and the exact solution is a sum over steps.

r, turn, h = 0.3, 2.0 * np.pi, sim.dt
ticks = h * np.arange(1000)
forces = np.stack(
    [
        -(m1 + m2) * r * turn**2 * np.cos(turn * ticks),
        m2 * (g - r * turn**2 * np.sin(turn * ticks)),
    ],
    axis=1,
)
sim.reset(q=[r, 0.0], v=[0.0, r * turn])
run = sim.run(1.0, forces)

a = (forces - [0.0, m2 * g]) / [m1 + m2, m2]
v = np.array([0.0, r * turn]) + h * np.vstack([np.zeros(2), np.cumsum(a, axis=0)])
steps = h * v[:-1] + 0.5 * h**2 * a
q = np.array([r, 0.0]) + np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])

error = np.abs(run.q - q).max()
print(f"largest difference: {error:.1e} m")
assert error <= 1e-8

# %%
# The drawn curve is not quite the circle: a force that is held for a step lags half a step behind
# on average.

off = np.abs(np.hypot(*run.q.T) - r).max()
print(f"off the circle by {1e3 * off:.2f} mm at most")

# %%
# In a figure
# -----------

figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 3.2))
left.plot(*run.q.T)
left.set(xlabel="x [m]", ylabel="z [m]", aspect="equal", title="Path of the end effector")
right.plot(ticks, forces[:, 0], label=r"$\tau_1$, across")
right.plot(ticks, forces[:, 1], label=r"$\tau_2$, up")
right.axhline(m2 * g, color="0.5", linestyle=":", label="weight of the end effector")
right.set(xlabel="time [s]", ylabel="force [N]", title="Forces of the drives")
right.legend()

# %%
# In motion
# ---------

x, z = run.q.T
across = np.stack([np.stack([x, np.full_like(x, -0.45)], axis=1), run.q], axis=1)
rail = np.array([[-0.45, -0.45], [0.45, -0.45]])
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    run.time,
    [(rail, {"label": "rail"}), (across, {"label": "carriage and end effector"})],
    trail=(run.q, {"label": "path of the end effector"}),
)
plt.show()

# %%
# Questions
# ---------
# 1. How fast may the end effector go round if each drive has 100 N? *Hint:* the amplitudes of the
#    forces grow with the square of the speed; only one of the drives carries a weight.
# 2. Advance the forces by half a step, ``ticks + h / 2``. How much closer to the circle does the
#    end effector stay, and why? *Hint:* print ``off`` for both.
