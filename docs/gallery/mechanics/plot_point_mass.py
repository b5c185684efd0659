# SPDX-License-Identifier: Apache-2.0
r"""
Point mass
==========

A point mass :math:`m` is thrown. *Robot Dynamics* (EECS 106B) uses it to introduce Lagrange's
equations, with the coordinates :math:`q = (q_1, q_2, q_3)`, the third upwards:

.. math::

    T = \tfrac12 m \dot q^T \dot q, \qquad V = m g q_3, \qquad L = T - V,

.. math::

    \frac{d}{dt}\frac{\partial L}{\partial\dot q} - \frac{\partial L}{\partial q}
    = m \begin{bmatrix} \ddot q_1 \\ \ddot q_2 \\ \ddot q_3 \end{bmatrix}
    - \begin{bmatrix} 0 \\ 0 \\ m g \end{bmatrix} = 0 .

.. admonition:: Erratum

    The sign of gravity. Since :math:`\partial L/\partial q_3 = -mg` is subtracted, the weight is
    added: :math:`m \ddot q + (0, 0, mg)^T = 0`. As printed, the mass would fall upwards.

:Lectures: EECS 106B, point mass
:Equations: 1; 10
:Shows: a throw, and where the sign of gravity belongs
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
# A robot description knows joints, so the mass moves along three sliders without mass.

print((files("arm_sim") / "scenes/lectures/point_mass.yaml").read_text())

# %%
# The run and the closed form
# ---------------------------
# The solution is the parabola :math:`q = \dot q_0 t + \tfrac12 \ddot q\, t^2`. A Runge–Kutta
# method of order four integrates it exactly, up to rounding.

sim = Simulator("point_mass", integrator="rk4", dt=0.01)
run = sim.run(1.2)


def parabola(acceleration: float) -> np.ndarray:
    """Positions at all times for a vertical acceleration in [m/s²]."""
    push = 0.5 * np.array([0.0, 0.0, acceleration])
    return np.outer(run.time, run.v[0]) + np.outer(run.time**2, push)


error = np.abs(run.q - parabola(-9.81)).max()
print(f"largest difference: {error:.1e} m")
print(f"height at the end: {run.q[-1, 2]:.2f} m; as printed {parabola(+9.81)[-1, 2]:.2f} m")
assert error <= 1e-12
assert np.abs(run.q - parabola(+9.81)).max() > 10.0

# %%
# In a figure
# -----------

figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 2.9))
for name, values in zip(sim.joint_names, run.q.T, strict=True):
    left.plot(run.time, values, label=name)
left.set(xlabel="time [s]", ylabel="position [m]", title="Coordinates")
left.legend(loc="upper left")
right.plot(run.time, run.kinetic, label="kinetic")
right.plot(run.time, run.potential, label="potential")
right.plot(run.time, run.energy, "--", label="sum")
right.set(xlabel="time [s]", ylabel="energy [J]", title="Energy")
right.legend()

# %%
# In motion
# ---------

path = run.q[:, [0, 2]]
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    run.time,
    [
        (path[:, None], {"label": "mass"}),
        (np.array([[0.0, 0.0], [3.6, 0.0]]), {"label": "ground"}),
    ],
    trail=(path, {"label": "path"}),
)
plt.show()

# %%
# Questions
# ---------
# 1. The equation of motion does not contain the mass. Which forces would bring it back? *Hint:*
#    give the sliders viscous friction in the scene and run it with two masses.
# 2. In which direction does a throw of given speed reach farthest if it starts 1 m above the
#    ground? *Hint:* it is less than 45 degrees; try it with ``sim.reset(q=[0, 0, 1], v=…)``.
