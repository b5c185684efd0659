# SPDX-License-Identifier: Apache-2.0
r"""
Particle with viscous friction
==============================

A particle of mass :math:`m` moves vertically under a force :math:`f`. *Introduction to Robotics*,
session 17, derives Lagrange's equation from it,

.. math::

    m \ddot y = f - m g, \qquad T = \tfrac12 m \dot y^2, \qquad V = m g y, \qquad
    \frac{d}{dt}\frac{\partial L}{\partial\dot y} - \frac{\partial L}{\partial y} = f,

and gives viscous friction as :math:`\tau_f = v \dot\theta`; the particle "moving vertically in
gravitation field" is also the first example of *Dynamics of open chain* (CTU). With friction
:math:`b \dot y` and no other force,

.. math::

    m \ddot y + b \dot y + m g = 0 .

Friction is not conservative, so it stands on the right of Lagrange's equation, as
:math:`f = -b \dot y`. The solution from rest is

.. math::

    \dot y = -v_\infty \left(1 - e^{-t/t_c}\right), \qquad
    y = -v_\infty \left(t - t_c\,(1 - e^{-t/t_c})\right), \qquad
    v_\infty = \frac{m g}{b}, \quad t_c = \frac{m}{b} .

:Lectures: session 17, a particle that moves vertically; CTU, a particle "moving vertically in
    gravitation field"
:Equations: 1; 8
:Shows: viscous friction as a force that is not conservative
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

print((files("arm_sim") / "scenes/lectures/viscous_particle.yaml").read_text())

# %%
# The run and the closed form
# ---------------------------

sim = Simulator("viscous_particle", dt=0.01, tolerance=1e-12)
run = sim.run(2.0)

m, b, g = 0.2, 0.4905, 9.81
top, t_c = m * g / b, m / b  # [m/s], [s]
fall = 1.0 - np.exp(-run.time / t_c)
exact = -top * (run.time - t_c * fall)

error = np.abs(run.q[:, 0] - exact).max()
print(f"largest difference: {error:.1e} m, in speed {np.abs(run.v[:, 0] + top * fall).max():.1e}")
assert error <= 1e-8
assert np.abs(run.v[:, 0] + top * fall).max() <= 1e-8

# %%
# The simulator accounts for energy as well: what gravity gives is stored in the motion or lost in
# the friction.

heat = m * g * -run.q[:, 0] - run.kinetic  # [J]
print(f"heat: {heat[-1]:.9f} J, by the account {run.lost[-1]:.9f} J")
assert abs(heat[-1] - run.lost[-1]) <= 1e-8

# %%
# In a figure
# -----------

figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 2.9))
left.plot(run.time, run.v[:, 0], label="with friction")
left.plot(run.time[:60], -g * run.time[:60], "--", label="without")
left.axhline(-top, color="0.5", linestyle=":", label="final speed, $-mg/b$")
left.set(xlabel="time [s]", ylabel="speed [m/s]", title="Speed")
left.legend()
right.plot(run.time, m * g * -run.q[:, 0], label="work of gravity")
right.plot(run.time, run.lost, label="heat")
right.plot(run.time, run.kinetic, label="kinetic")
right.set(xlabel="time [s]", ylabel="energy [J]", title="Where the energy goes")
right.legend()

# %%
# In motion
# ---------
# Next to the particle one that falls without friction, and soon out of the picture.

free = -0.5 * g * run.time**2
free[free < run.q[-1, 0]] = np.nan
pair = [
    (
        np.stack([np.full_like(y, x), y], axis=1)[:, None],
        {"color": color, "markersize": 9, "label": label},
    )
    for x, y, color, label in (
        (0.0, run.q[:, 0], "C0", "with friction"),
        (1.0, free, "C1", "without"),
    )
]
# sphinx_gallery_thumbnail_number = 2
path = np.stack([0.0 * run.time, run.q[:, 0]], axis=1), {"color": "C0"}
motion = animation(run.time, pair, trail=path, size=(3.4, 4.6))
plt.show()

# %%
# Questions
# ---------
# 1. Throw the particle upwards with 10 m/s. Does it take longer to rise or to fall back? *Hint:*
#    use ``sim.reset(v=[10.0])``, and think of the energy at equal heights.
# 2. Air resists with :math:`c\,\dot y^2`. Which initial slope do the two curves of the speed
#    share, and how does the approach to the final speed differ? *Hint:* linearize about that
#    speed.
