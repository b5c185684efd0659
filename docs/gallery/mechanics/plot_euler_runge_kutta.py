# SPDX-License-Identifier: Apache-2.0
r"""
Euler against Runge–Kutta
=========================

To simulate an arm, forward dynamics is integrated step by step. *Dynamics of open chain* (CTU)
does it with the explicit Euler method,

.. math::

    \dot q_{t+1} = \dot q_t + \ddot q_t\, \Delta t, \qquad q_{t+1} = q_t + \dot q_t\, \Delta t,

and *Introduction to Robotics* (session 17) names "Runge–Kutta, Euler method, etc." The classical
Runge–Kutta method takes four slopes a step, of the state :math:`x = (q, \dot q)` with
:math:`\dot x = f(x)`:

.. math::

    k_1 = f(x), \quad k_2 = f(x + \tfrac{\Delta t}{2} k_1), \quad
    k_3 = f(x + \tfrac{\Delta t}{2} k_2), \quad k_4 = f(x + \Delta t\, k_3), \qquad
    x^+ = x + \tfrac{\Delta t}{6} (k_1 + 2 k_2 + 2 k_3 + k_4) .

Its error falls with :math:`\Delta t^4`, that of Euler's with :math:`\Delta t`.

.. admonition:: Erratum

    Explicit Euler is said to be "unstable for large time steps". Where nothing damps the motion,
    it is unstable for *every* step: a small swing of frequency :math:`\omega` is multiplied by
    :math:`|1 + i\omega\Delta t| = \sqrt{1 + \omega^2 \Delta t^2} > 1` in each.

:Lectures: CTU, explicit Euler; session 17, "Runge–Kutta, Euler method"
:Equations: 11
:Shows: the orders of two methods, and an energy that grows
"""

import numpy as np
from matplotlib import pyplot as plt
from scipy.special import ellipj  # pip install ".[gallery]"

from arm_sim import Simulator
from arm_sim.figures import animation, use_style

use_style()

# %%
# The scene
# ---------
# The :ref:`pendulum <sphx_glr_generated_gallery_mechanics_plot_pendulum.py>`, released from 90
# degrees, whose motion is known in closed form.

pace, start = np.sqrt(9.81), np.pi / 2.0
k = np.sin(start / 2.0)


def exact(time: np.ndarray) -> np.ndarray:
    """The angle by elliptic functions."""
    _, cn, dn, _ = ellipj(pace * time, k**2)
    return 2.0 * np.arcsin(k * cn / dn)


# %%
# The run and an independent solution
# -----------------------------------
# Both methods again, written out as above. They agree with the simulator's to rounding.


def f(x: np.ndarray) -> np.ndarray:
    """Rates of angle and speed."""
    return np.array([x[1], -(pace**2) * np.sin(x[0])])


def euler(x: np.ndarray, h: float) -> np.ndarray:
    """A step of the explicit Euler method."""
    return x + h * f(x)


def runge_kutta(x: np.ndarray, h: float) -> np.ndarray:
    """A step of the classical Runge–Kutta method."""
    k1 = f(x)
    k2 = f(x + h / 2 * k1)
    k3 = f(x + h / 2 * k2)
    k4 = f(x + h * k3)
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


steps = [0.02, 0.01, 0.005, 0.0025]
errors = {}
for name, method in (("euler", euler), ("rk4", runge_kutta)):
    errors[name] = []
    for h in steps:
        run = Simulator("pendulum", integrator=name, dt=h).run(2.0)
        x, by_hand = np.array([start, 0.0]), []
        for _ in run.time:
            by_hand.append(x)
            x = method(x, h)
        assert np.abs(np.hstack([run.q, run.v]) - by_hand).max() <= 1e-10
        errors[name].append(np.abs(run.q[:, 0] - exact(run.time)).max())
    order = np.log2(errors[name][-2] / errors[name][-1])
    print(f"{name}: errors", *(f"{e:.1e}" for e in errors[name]), f"rad; order {order:.2f}")
    assert abs(order - {"euler": 1, "rk4": 4}[name]) < 0.1

# %%
# With its error controlled, a method of higher order comes to rounding.

run = Simulator("pendulum", dt=0.01, tolerance=1e-12).run(2.0)
error = np.abs(run.q[:, 0] - exact(run.time)).max()
print(f"dop853 to a tolerance of 1e-12: {error:.1e} rad")
assert error <= 1e-8

# %%
# Small swings grow under the explicit Euler method, at any step, as its factor says.

for h in (0.01, 0.001):
    sim = Simulator("pendulum", integrator="euler", dt=h)
    sim.reset(q=[1e-4])
    swing = sim.run(5.0)
    size = np.hypot(swing.q[-1, 0], swing.v[-1, 0] / pace) / 1e-4
    factor = np.sqrt(1.0 + (pace * h) ** 2) ** (len(swing) - 1)
    print(f"step {1e3 * h:.0f} ms: grown by {size:.6f} in 5 s, expected {factor:.6f}")
    assert abs(size / factor - 1.0) < 1e-6 and size > 1.02

# %%
# In a figure
# -----------
# Euler's method feeds energy into the pendulum until it goes over the top. Semi-implicit Euler,
# which uses the new speed for the new position, has the same order and costs the same, but its
# energy only wavers.

figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 3.0))
names = {"euler": "Euler", "semi_implicit_euler": "semi-implicit Euler", "rk4": "Runge–Kutta"}
for name, mark in (("euler", "C0o-"), ("rk4", "C2s-")):
    left.loglog(steps, errors[name], mark, label=names[name])
left.axhline(1e-13, color="0.6", linestyle=":", label="rounding")
left.set(xlabel="step [s]", ylabel="largest error [rad]", title="Error in 2 s")
left.set_xticks(steps, [f"{h:g}" for h in steps], minor=False)
left.set_xticks([], minor=True)
left.legend(loc="center left")
runs = {}
for name, words in names.items():
    runs[name] = Simulator("pendulum", integrator=name, dt=0.02).run(9.0)
    right.plot(runs[name].time, runs[name].energy, label=None if name in errors else words)
right.axhline(9.81, color="0.5", linestyle=":", label="needed for the top")
right.set(xlabel="time [s]", ylabel="energy [J]", title="Energy, steps of 20 ms", ylim=(-1, 20))
right.legend(loc="upper left")

# %%
# In motion
# ---------
# Euler's method (blue) and Runge–Kutta (green), both with steps of 20 ms.


def rod(q: np.ndarray) -> np.ndarray:
    """Hinge and mass for angles of shape (k, 1)."""
    bob = np.hstack([np.sin(q), -np.cos(q)])
    return np.stack([0.0 * bob, bob], axis=1)


# sphinx_gallery_thumbnail_number = 2
motion = animation(
    runs["rk4"].time,
    [
        (rod(runs["rk4"].q), {"color": "C2", "label": "Runge–Kutta"}),
        (rod(runs["euler"].q), {"label": "Euler"}),
    ],
)
plt.show()

# %%
# Questions
# ---------
# 1. A step of Runge–Kutta costs four evaluations, one of Euler's a single one. Which is cheaper
#    for an error of 1e-3 rad? *Hint:* continue the lines of the figure to that error.
# 2. From how much viscous friction on is Euler's method stable for small swings at 10 ms? *Hint:*
#    the eigenvalues :math:`\lambda` of the linearized pendulum must satisfy
#    :math:`|1 + \lambda\Delta t| < 1`.
