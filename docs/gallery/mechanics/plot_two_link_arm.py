# SPDX-License-Identifier: Apache-2.0
r"""
2R arm with distributed mass
============================

Two links with centres of mass at :math:`l_{c1}` and :math:`l_{c2}` and moments of inertia
:math:`I_1` and :math:`I_2` about them: the arm of *Design of Mechatronic Systems* (ME 6102), which
derives it from the Jacobians of the two centres,

.. math::

    d_{11} &= m_1 l_{c1}^2 + m_2 (l_1^2 + l_{c2}^2 + 2 l_1 l_{c2} \cos q_2) + I_1 + I_2, \\
    d_{12} = d_{21} &= m_2 (l_{c2}^2 + l_1 l_{c2} \cos q_2) + I_2, \qquad
    d_{22} = m_2 l_{c2}^2 + I_2, \qquad h = -m_2 l_1 l_{c2} \sin q_2,

.. math::

    d_{11} \ddot q_1 + d_{12} \ddot q_2 + 2 h\, \dot q_1 \dot q_2 + h\, \dot q_2^2
        + \frac{\partial V}{\partial q_1} &= \tau_1, \\
    d_{21} \ddot q_1 + d_{22} \ddot q_2 - h\, \dot q_1^2
        + \frac{\partial V}{\partial q_2} &= \tau_2,

.. math::

    V = (m_1 l_{c1} + m_2 l_1)\, g \sin q_1 + m_2 l_{c2}\, g \sin(q_1 + q_2) .

.. admonition:: Errata

    * :math:`\partial V/\partial q_2 = m_2 l_{c2} \cos(q_1 + q_2)` lacks the :math:`g`.
    * The translational kinetic energy is :math:`\tfrac12 \dot q^T \{\dots\}\, \dot q`; the first
      factor is printed without its transpose.

The arm reaches each point in two postures: with the elbow up, and with the elbow down.

:Lectures: ME 6102, two-link arm from the Jacobians of its centres
:Equations: 1; 4; 5
:Shows: elbow up and elbow down, and the torques that hold them
"""

from importlib.resources import files

import numpy as np
from matplotlib import pyplot as plt
from scipy.integrate import solve_ivp  # pip install ".[gallery]"

from arm_sim import Simulator
from arm_sim.figures import animation, use_style

use_style()

# %%
# The scene
# ---------
# The links are slender rods, 0.5 m and 0.4 m long, of 2 kg and 1.5 kg. The bearings have viscous
# friction, which stands on the left of the equations above.

print((files("arm_sim") / "scenes/two_link.yaml").read_text())
m1, m2, l1, l2, g = 2.0, 1.5, 0.5, 0.4, 9.81
lc1, lc2, I1, I2 = l1 / 2, l2 / 2, m1 * l1**2 / 12, m2 * l2**2 / 12
b = np.array([0.4, 0.2])  # [N m s/rad]

# %%
# Both postures
# -------------
# The law of cosines gives the angle of the elbow up to its sign, and with it the shoulder.


def angles(x: float, z: float, elbow: float) -> np.ndarray:
    """Joint angles for the end effector at (x, z); ``elbow`` is +1 for elbow down, else -1."""
    q2 = elbow * np.arccos((x**2 + z**2 - l1**2 - l2**2) / (2 * l1 * l2))
    return np.array([np.arctan2(z, x) - np.arctan2(l2 * np.sin(q2), l1 + l2 * np.cos(q2)), q2])


def points(q: np.ndarray) -> np.ndarray:
    """Shoulder, elbow and end effector for positions of shape (k, 2)."""
    elbow = l1 * np.stack([np.cos(q[:, 0]), np.sin(q[:, 0])], axis=1)
    both = q.sum(axis=1)
    tip = elbow + l2 * np.stack([np.cos(both), np.sin(both)], axis=1)
    return np.stack([0.0 * elbow, elbow, tip], axis=1)


down, up = angles(0.6, 0.2, +1.0), angles(0.6, 0.2, -1.0)
tips = points(np.array([down, up]))[:, 2]
print("elbow down:", down, " elbow up:", up, " end effector at", *tips)
assert np.abs(tips - [0.6, 0.2]).max() <= 1e-12

# %%
# The runs and an independent solution
# ------------------------------------
# Both arms are released from the same position of the end effector.


def weight(q: np.ndarray, g_2: float = g) -> np.ndarray:
    """Gradient of V; ``g_2`` is what stands for g in the second row."""
    c12 = m2 * lc2 * np.cos(q[0] + q[1])
    return np.array([(m1 * lc1 + m2 * l1) * g * np.cos(q[0]) + c12 * g, c12 * g_2])


def rates(time: float, x: np.ndarray, g_2: float = g) -> np.ndarray:
    """Rates of angles and speeds."""
    q, v, c2 = x[:2], x[2:], np.cos(x[1])
    h = -m2 * l1 * lc2 * np.sin(q[1])
    d12 = m2 * (lc2**2 + l1 * lc2 * c2) + I2
    d11 = m1 * lc1**2 + m2 * (l1**2 + lc2**2 + 2 * l1 * lc2 * c2) + I1 + I2
    D = np.array([[d11, d12], [d12, m2 * lc2**2 + I2]])
    speed = np.array([2 * h * v[0] * v[1] + h * v[1] ** 2, -h * v[0] ** 2])
    return np.concatenate([v, np.linalg.solve(D, -speed - weight(q, g_2) - b * v)])


sim = Simulator("two_link", dt=0.01, tolerance=1e-12)
exactly = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14}
runs = []
for name, q0 in (("elbow down", down), ("elbow up", up)):
    sim.reset(q=q0)
    run = sim.run(1.5)
    start = np.concatenate([q0, [0.0, 0.0]])
    reference = solve_ivp(rates, (0.0, 1.5), start, t_eval=run.time, **exactly)
    printed = solve_ivp(rates, (0.0, 1.5), start, t_eval=run.time, args=(1.0,), **exactly)
    error, off = (np.abs(run.q.T - other.y[:2]).max() for other in (reference, printed))
    print(f"{name}: largest difference {error:.1e} rad, without the g {off:.1f} rad")
    assert error <= 1e-8 and off > 0.1
    runs.append(run)

# %%
# In a figure
# -----------
# The end effector moves along a level line, slowly. With the elbow up or down the drives have to
# carry different moments, although the load is the same.

xs = np.linspace(0.25, 0.85, 121)
figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 3.0))
for name, sign, color in (("elbow down", 1.0, "C0"), ("elbow up", -1.0, "C1")):
    way = np.array([angles(x, 0.2, sign) for x in xs])
    left.plot(*points(way[70:71])[0].T, "o-", color=color, linewidth=2.5, label=name)
    torques = np.array([sim.dynamics.gravity(q) for q in way])
    assert np.abs(torques - [weight(q) for q in way]).max() <= 1e-12
    right.plot(xs, torques[:, 0], color=color)
    right.plot(xs, torques[:, 1], "--", color=color)
for line, name in (("-", "shoulder"), ("--", "elbow")):
    right.plot([], [], line, color="0.5", label=name)
left.axhline(0.2, color="0.6", linestyle=":", label="path of the end effector")
left.set(xlabel="x [m]", ylabel="z [m]", aspect="equal", title="Two postures", ylim=(-0.25, 0.85))
left.legend(loc="upper left")
right.set(
    xlabel="x of end effector [m]", ylabel="torque [N m]", title="To hold the arm", ylim=(-3, 20)
)
right.legend(loc="upper left")

# %%
# In motion
# ---------

# sphinx_gallery_thumbnail_number = 2
motion = animation(
    runs[0].time,
    [
        (points(runs[0].q), {"label": "elbow down"}),
        (points(runs[1].q), {"color": "C1", "label": "elbow up, and its path"}),
    ],
    trail=points(runs[1].q)[:, 2],
    speed=0.5,
)
plt.show()

# %%
# Questions
# ---------
# 1. Why does the shoulder carry so much less with the elbow up, when the end effector is near the
#    base? *Hint:* how far from the shoulder, along x, are the two centres of mass?
# 2. At :math:`x^2 + z^2 = (l_1 + l_2)^2` both postures meet. What happens to the speed of the
#    joints if the end effector moves through this point? *Hint:* the determinant of the Jacobian
#    is :math:`l_1 l_2 \sin q_2`.
