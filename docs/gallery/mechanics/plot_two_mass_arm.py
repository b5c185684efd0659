# SPDX-License-Identifier: Apache-2.0
r"""
Ideal 2R arm
============

Two weightless links with a point mass at the end of each: the second motor :math:`m_1`, and the
load :math:`m_2`. Three of the courses derive this arm: *Applied Dynamics* (HCMUTE, chapter 8,
example 3), *Dynamics of open chain* (CTU) and *Introduction to Robotics* (session 17). With the
angle :math:`\theta_1` of the first link from the horizontal and :math:`\theta_2` of the second
link from the first,

.. math::

    Q_1 &= \left((m_1 + m_2)\, l_1^2 + m_2 l_2 (l_2 + 2 l_1 \cos\theta_2)\right) \ddot\theta_1
        + m_2 l_2 (l_2 + l_1 \cos\theta_2)\, \ddot\theta_2 \\
        &- 2 m_2 l_1 l_2 \sin\theta_2\, \dot\theta_1 \dot\theta_2
        - m_2 l_1 l_2 \sin\theta_2\, \dot\theta_2^2
        + (m_1 + m_2)\, g l_1 \cos\theta_1 + m_2 g l_2 \cos(\theta_1 + \theta_2), \\
    Q_2 &= m_2 l_2 (l_2 + l_1 \cos\theta_2)\, \ddot\theta_1 + m_2 l_2^2\, \ddot\theta_2
        + m_2 l_1 l_2 \sin\theta_2\, \dot\theta_1^2 + m_2 g l_2 \cos(\theta_1 + \theta_2) .

All three sets of notes have these equations right.

.. admonition:: Erratum

    Applied Dynamics calls the position of the first mass :math:`(X_1, Y_2)`; it is
    :math:`(X_1, Y_1)`.

:Lectures: HCMUTE, example 3; CTU, the RR arm; session 17, the two-link arm
:Equations: 1; 4; 5
:Shows: the arm of three courses, and how far starts that are close move apart
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

print((files("arm_sim") / "scenes/lectures/two_mass_arm.yaml").read_text())

# %%
# The run and an independent solution
# -----------------------------------
# The arm is released, without torques and friction.

m1, m2, l1, l2, g = 1.3, 0.7, 0.6, 0.4, 9.81
sim = Simulator("two_mass_arm", dt=0.01, tolerance=1e-13)
run = sim.run(3.0)


def terms(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mass matrix, velocity terms and weight, from the equations above."""
    c1, c12, c2, s2 = np.cos(q[0]), np.cos(q[0] + q[1]), np.cos(q[1]), np.sin(q[1])
    both = m2 * l2 * (l2 + l1 * c2)
    M = np.array([[(m1 + m2) * l1**2 + m2 * l2 * (l2 + 2 * l1 * c2), both], [both, m2 * l2**2]])
    V = m2 * l1 * l2 * s2 * np.array([-2 * v[0] * v[1] - v[1] ** 2, v[0] ** 2])
    G = g * np.array([(m1 + m2) * l1 * c1 + m2 * l2 * c12, m2 * l2 * c12])
    return M, V, G


def rates(time: float, x: np.ndarray) -> np.ndarray:
    """Rates of angles and speeds."""
    M, V, G = terms(x[:2], x[2:])
    return np.concatenate([x[2:], np.linalg.solve(M, -V - G)])


reference = solve_ivp(
    rates, (0.0, 3.0), np.hstack([run.q[0], run.v[0]]),
    method="DOP853", rtol=1e-13, atol=1e-14, t_eval=run.time,
)  # fmt: skip
error = np.abs(run.q.T - reference.y[:2]).max()
print(f"largest difference: {error:.1e} rad")
assert error <= 1e-8

# %%
# The terms of the equation one by one, in a moving state:

q, v = np.array([0.4, 1.1]), np.array([-1.5, 2.0])
for name, ours, theirs in zip(
    ("mass matrix", "velocity terms", "weight"),
    (sim.dynamics.mass_matrix(q), sim.dynamics.coriolis_matrix(q, v) @ v, sim.dynamics.gravity(q)),
    terms(q, v),
    strict=True,
):
    print(f"{name}: difference {np.abs(ours - theirs).max():.1e}")
    assert np.abs(ours - theirs).max() <= 1e-12

# %%
# In a figure
# -----------
# An arm like this is chaotic. A second run, which starts a millionth of a radian beside the first,
# soon goes its own way, while the energy of both stays what it was.

sim.reset(q=run.q[0] + [1e-6, 0.0])
long = sim.run(12.0)
sim.reset()
same = sim.run(12.0)
apart = np.abs(long.q - same.q).max(axis=1)

figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 2.9))
left.plot(run.time, run.q, label=[r"$\theta_1$", r"$\theta_2$"])
left.set(xlabel="time [s]", ylabel="angle [rad]", title="Released")
left.legend()
right.semilogy(long.time, apart, label="of the angles")
right.semilogy(long.time[1:], np.abs(same.energy - same.energy[0])[1:], label="of the energy")
right.set(xlabel="time [s]", title="A start 1e-6 rad away", ylim=(1e-16, 100))
right.set_ylabel("difference [rad] or [J]")
right.legend(loc="center right")

# %%
# In motion
# ---------

elbow = l1 * np.stack([np.cos(run.q[:, 0]), np.sin(run.q[:, 0])], axis=1)
both = run.q.sum(axis=1)
tip = elbow + l2 * np.stack([np.cos(both), np.sin(both)], axis=1)
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    run.time,
    [(np.stack([0.0 * elbow, elbow, tip], axis=1), {"label": "arm"})],
    trail=(tip, {"label": "path of the end effector"}),
)
plt.show()

# %%
# Questions
# ---------
# 1. In which posture does the first motor have to be strongest to hold the arm? *Hint:* where
#    is the first row of the weight largest?
# 2. The mass matrix depends on :math:`\theta_2` only. Why not on :math:`\theta_1`? *Hint:* turn
#    the whole arm about the shoulder: which energy changes?
