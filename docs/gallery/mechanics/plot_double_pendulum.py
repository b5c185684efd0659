# SPDX-License-Identifier: Apache-2.0
r"""
Double pendulum
===============

Two point masses :math:`m` on weightless rods of length :math:`l`, with absolute angles
:math:`\theta_1, \theta_2` from the hanging position and :math:`\delta = \theta_1 - \theta_2`:

.. math::

    2\ddot\theta_1 + \ddot\theta_2 \cos\delta + \dot\theta_2^2 \sin\delta
        + 2 (g/l) \sin\theta_1 &= 0, \\
    \ddot\theta_2 + \ddot\theta_1 \cos\delta - \dot\theta_1^2 \sin\delta
        + (g/l) \sin\theta_2 &= 0.

:Lectures: textbooks, chaotic motion
:Equations: 1; 10
:Shows: kinetic and potential energy of a chaotic motion, against SciPy
"""

import numpy as np
from matplotlib import pyplot as plt
from scipy.integrate import solve_ivp  # pip install ".[gallery]"

from arm_sim import Simulator
from arm_sim.figures import use_style

use_style()
sim = Simulator("double_pendulum", dt=0.01, tolerance=1e-12)
run = sim.run(5.0)


def rates(time: float, x: np.ndarray) -> np.ndarray:
    """Rates of the angles and of their speeds."""
    d = x[0] - x[1]
    M = [[2.0, np.cos(d)], [np.cos(d), 1.0]]
    h = [x[3] ** 2 * np.sin(d) + 2 * 9.81 * np.sin(x[0]), 9.81 * np.sin(x[1])]
    h[1] -= x[2] ** 2 * np.sin(d)
    return np.concatenate([x[2:], np.linalg.solve(M, -np.array(h))])


start = np.concatenate([np.cumsum(run.q[0]), [0.0, 0.0]])
how = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-13, "t_eval": run.time}
angles = solve_ivp(rates, (0.0, run.time[-1]), start, **how).y[:2].T
error = np.abs(np.cumsum(run.q, axis=1) - angles).max()
print(f"largest difference: {error:.1e} rad")
assert error <= 1e-8

figure = run.plot()

# %%
# In motion
# ---------

# sphinx_gallery_thumbnail_number = 2
motion = run.animate()
plt.show()

# %%
# Questions
# ---------
# 1. How long does it take until a change of the start by 1e-9 rad is a change by 0.1 rad?
#    *Hint:* ``sim.reset(q=…)``, and plot the difference on a logarithmic axis.
