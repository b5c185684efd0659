# SPDX-License-Identifier: Apache-2.0
r"""
Mass on a spring
================

The first use of Lagrange's equation in ME 6102 ("Spring Mass System"), and the model that the
notes suggest for the lens of a CD player (:doc:`plot_cd_rom`):

.. math::

   L = \tfrac12 m \dot x^2 - \tfrac12 k x^2, \qquad
   \frac{d}{dt}(m \dot x) + k x = F \quad\Rightarrow\quad m \ddot x + k x = F .

:Lectures: ME 6102, "Spring Mass System"
:Equations: 20
:Shows: a mass that a force moves for a while, and its energies
"""

from importlib.resources import files

import matplotlib.pyplot as plt
import numpy as np

from arm_sim import Simulator
from arm_sim.figures import animation, use_style

use_style()

# %%
# The scene
# ---------
# A sliding joint with a spring beside it, ``joints.slide.spring``.

print((files("arm_sim") / "scenes/lectures/spring_mass.yaml").read_text())

# %%
# The run and the closed form
# ---------------------------
# A force of 10 N for two seconds, then none. With :math:`\omega = \sqrt{k/m}` the mass swings
# about :math:`F/k`, and then about zero from where it is:
#
# .. math::
#
#    x = \frac{F}{k}(1 - \cos\omega t), \qquad
#    x = x_1 \cos\omega(t - t_1) + \frac{v_1}{\omega} \sin\omega(t - t_1).

m, k, F, t1, end = 2.0, 50.0, 10.0, 2.0, 5.0
omega = np.sqrt(k / m)

sim = Simulator("spring_mass", tolerance=1e-12)
ticks = np.arange(round(end / sim.dt)) * sim.dt
run = sim.run(end, np.where(ticks < t1, F, 0.0)[:, None])

t = run.time
x1, v1 = F / k * (1 - np.cos(omega * t1)), F / k * omega * np.sin(omega * t1)
exact = np.where(
    t <= t1,
    F / k * (1 - np.cos(omega * t)),
    x1 * np.cos(omega * (t - t1)) + v1 / omega * np.sin(omega * (t - t1)),
)
error = np.abs(run.q[:, 0] - exact).max()
print(f"largest difference: {error:.1e} m, of {exact.max():.1f} m")
assert error <= 1e-8

# %%
# The force's work is what the energies hold afterwards: :math:`F x_1`, and nothing is lost.

work = F * x1
print(f"energy at the end {run.energy[-1]:.12f} J, work of the force {work:.12f} J")
assert abs(run.energy[-1] - work) < 1e-9

# %%
# In a figure
# -----------

figure, axes = plt.subplots(1, 2, figsize=(7.2, 3.0))
axes[0].plot(t, run.q[:, 0], label="run")
axes[0].axvline(t1, color="0.7", lw=0.8)
axes[0].hlines(F / k, 0.0, t1, color="C1", ls="--", label="F / k")
axes[0].set(xlabel="time [s]", ylabel="position [m]", title="10 N for two seconds")
axes[0].legend(loc="lower left")
axes[1].stackplot(t, run.kinetic, run.potential, labels=["kinetic", "of the spring"])
axes[1].plot(t, F * np.where(t <= t1, run.q[:, 0], x1), "k--", label="work of the force")
axes[1].set(xlabel="time [s]", ylabel="energy [J]", ylim=(0, 6.2), title="Where the work goes")
axes[1].legend(loc="upper right")

# %%
# In motion
# ---------

wall, rest_length, turns = -0.6, 0.6, 12
along = np.linspace(0.0, 1.0, 2 * turns + 1)
aside = 0.04 * np.r_[0, np.tile([1.0, -1.0], turns)[:-1], 0]
coil = np.empty((len(t), len(along), 2))
coil[..., 0] = wall + (rest_length + run.q) * along
coil[..., 1] = aside
box = np.array([[0, -0.1], [0.2, -0.1], [0.2, 0.1], [0, 0.1], [0, -0.1]])
mass = box + np.stack([run.q, np.zeros_like(run.q)], axis=-1)
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    t,
    [np.array([[wall, -0.15], [wall, 0.15]]),
     (coil, {"marker": "", "linewidth": 1.2, "color": "C1", "label": "spring"}),
     (mass, {"marker": "", "label": "mass"})],
    size=(6.4, 2.6),
)  # fmt: skip
plt.show()

# %%
# Questions
# ---------
# 1. For how long must the force act so that the mass stands still afterwards? *Hint:* the mass is
#    at rest, without tension in the spring, whenever :math:`\cos\omega t_1 = 1`.
# 2. With ``integrator="euler"`` and ``dt=1e-3`` the swings grow. By which factor in a second?
#    *Hint:* a step multiplies the energy by :math:`1 + \omega^2 h^2` exactly.
