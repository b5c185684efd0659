# SPDX-License-Identifier: Apache-2.0
r"""
Four-bar linkage
================

A crank :math:`a`, a coupler :math:`b` and a rocker :math:`c` on a ground :math:`d` close a loop.
With the angles :math:`\varphi` of the crank and :math:`\psi` of the rocker to the ground, the
coupler's length gives Freudenstein's equation

.. math::

    (d + c \cos\psi - a \cos\varphi)^2 + (c \sin\psi - a \sin\varphi)^2 = b^2,

which is solved for :math:`\psi` in closed form: :math:`A \cos\psi + B \sin\psi = C` with
:math:`A = 2c(d - a\cos\varphi)`, :math:`B = -2ac\sin\varphi` and
:math:`C = b^2 - a^2 - c^2 - d^2 + 2ad\cos\varphi`.

:Lectures: textbooks, Freudenstein's equation
:Equations: 1; 4
:Shows: a closed loop against its closed form
"""

import numpy as np
from matplotlib import pyplot as plt

from arm_sim import Simulator
from arm_sim.figures import use_style

use_style()
a, b, c, d = 0.1, 0.3, 0.25, 0.35  # [m]
run = Simulator("four_bar", dt=1e-3, tolerance=1e-12).run(2.0)
crank, rocker = run.q[:, 0], run.q[:, 2]
A, B = 2 * c * (d - a * np.cos(crank)), -2 * a * c * np.sin(crank)
C = b**2 - a**2 - c**2 - d**2 + 2 * a * d * np.cos(crank)
psi = np.arctan2(B, A) + np.arccos(C / np.hypot(A, B))
error = np.abs(np.angle(np.exp(1j * (rocker - psi)))).max()
print(f"the rocker is off by {error:.1e} rad, the energy by {np.ptp(run.energy):.1e} J")
assert error <= 1e-8 and np.ptp(run.energy) <= 1e-8

figure, plane = plt.subplots(figsize=(4.6, 3.2))
turn = crank < crank[0] + 2 * np.pi
plane.plot(crank[turn], rocker[turn], label="simulated")
plane.plot(crank[turn][::60], psi[turn][::60], "o", label="Freudenstein")
plane.set(xlabel="angle of the crank [rad]", ylabel="angle of the rocker [rad]")
plane.legend(loc="lower center")

# %%
# In motion
# ---------
# A quarter as fast.

# sphinx_gallery_thumbnail_number = 2
motion = run.animate(speed=0.25, rate=15.0)
plt.show()

# %%
# Questions
# ---------
# 1. Why does the crank go round, and the rocker not? *Hint:* Grashof's condition: compare the
#    sum of the shortest and the longest bar with that of the others.
