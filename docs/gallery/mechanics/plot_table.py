# SPDX-License-Identifier: Apache-2.0
r"""
Pushing a table with a given force
==================================

"How much pushing against the table with :math:`f_d`" is a task of inverse dynamics in *Dynamics of
open chain* (CTU): in the space of the end effector :math:`J^T f = A^T \lambda`, so an arm at rest
pushes with :math:`f_d` if its torques are

.. math::

    \tau = G(q) + J^T f_d .

A real table is not quite the constraint of the notes. It pushes back and never pulls, so the end
effector can leave it, and it holds the end effector sideways only as far as friction goes:

.. math::

    0 \le \text{gap} \perp N \ge 0, \qquad |F| \le \mu N, \quad
    F = -\mu N \operatorname{sgn} \dot x \text{ while the end effector slides.}

:Lectures: CTU, "How much pushing against the table"
:Equations: 19
:Shows: an end effector that pushes, slides and lifts off
"""

from importlib.resources import files

import numpy as np
from matplotlib import pyplot as plt
from scipy.integrate import solve_ivp  # pip install ".[gallery]"

from arm_sim import Simulator, contact_history
from arm_sim.figures import animation, use_style

use_style()

# %%
# The scene
# ---------
# The end effector of the :ref:`ideal 2R arm
# <sphx_glr_generated_gallery_mechanics_plot_two_mass_arm.py>` begins at rest on the table.

print((files("arm_sim") / "scenes/lectures/table_arm.yaml").read_text())
m1, m2, l1, l2, g, mu = 1.3, 0.7, 0.6, 0.4, 9.81, 0.4

# %%
# The run
# -------
# Three phases: the end effector pushes straight down with 20 N; then also sideways with 12 N,
# which is more than the friction of 8 N; then it is lifted with 5 N.

PHASES = ((0.2, (0.0, -20.0)), (0.6, (12.0, -20.0)), (0.8, (0.0, 5.0)))  # until [s], f_d [N]


def terms(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, ...]:
    """M, h, G, J and the acceleration of the tip that is there without joint acceleration."""
    s1, c1, s12, c12 = np.sin(q[0]), np.cos(q[0]), np.sin(q.sum()), np.cos(q.sum())
    s2, c2, w = np.sin(q[1]), np.cos(q[1]), v.sum()
    both = m2 * l2 * (l2 + l1 * c2)
    M = np.array([[(m1 + m2) * l1**2 + m2 * l2 * (l2 + 2 * l1 * c2), both], [both, m2 * l2**2]])
    G = g * np.array([(m1 + m2) * l1 * c1 + m2 * l2 * c12, m2 * l2 * c12])
    h = G + m2 * l1 * l2 * s2 * np.array([-2 * v[0] * v[1] - v[1] ** 2, v[0] ** 2])
    J = np.array([[-l1 * s1 - l2 * s12, -l2 * s12], [l1 * c1 + l2 * c12, l2 * c12]])
    rate = -np.array(
        [l1 * c1 * v[0] ** 2 + l2 * c12 * w**2, l1 * s1 * v[0] ** 2 + l2 * s12 * w**2]
    )
    return M, h, G, J, rate


def push(state) -> np.ndarray:
    """Torques that carry the arm and push with the force of the phase."""
    _, _, G, J, _ = terms(np.asarray(state.q), np.asarray(state.v))
    force = next(f for until, f in PHASES if state.time < until - 1e-9)
    return G + J.T @ force


sim = Simulator("table_arm", dt=2e-3, tolerance=1e-12)
run = sim.run(PHASES[-1][0], push)
history = contact_history(sim, run)
sideways, normal = history.force[:, 0, 0], history.force[:, 0, 2]
at_rest = run.time < 0.2 - 1e-9
print(f"at rest the table answers with {normal[at_rest].min():.12f} N")
assert np.abs(normal[at_rest] - 20.0).max() <= 1e-8
assert np.ptp(run.q[at_rest], axis=0).max() == 0.0  # to the bit

# %%
# The independent solution
# ------------------------
# At rest nothing moves. While the end effector slides the table exerts
# :math:`J^T (-\mu N, N)` with the :math:`N` for which the tip keeps its height, a linear equation;
# afterwards it exerts nothing. Each torque is that of the run, held for a time step.


def normal_force(q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> float:
    """N of an end effector that slides in the direction of x."""
    M, h, _, J, rate = terms(q, v)
    free = J[1] @ np.linalg.solve(M, tau - h) + rate[1]
    return float(-free / (J[1] @ np.linalg.solve(M, J.T @ [-mu, 1.0])))


def rates(time: float, x: np.ndarray, tau: np.ndarray, slides: bool) -> np.ndarray:
    """Rates of angles and speeds."""
    q, v = x[:2], x[2:]
    M, h, _, J, _ = terms(q, v)
    N = normal_force(q, v, tau) if slides else 0.0
    return np.concatenate([v, np.linalg.solve(M, tau - h + J.T @ np.array([-mu * N, N]))])


x, other, answers = np.hstack([run.q[0], run.v[0]]), [], []
for time, tau in zip(run.time, run.command, strict=True):
    other.append(x)
    rests, slides = time < 0.2 - 1e-9, 0.2 - 1e-9 < time < 0.6 - 1e-9
    answers.append(20.0 if rests else normal_force(x[:2], x[2:], tau) if slides else 0.0)
    if not rests:
        x = solve_ivp(
            rates, (0.0, sim.dt), x, "DOP853", args=(tau, slides), rtol=1e-13, atol=1e-14
        ).y[:, -1]
error = np.abs(np.hstack([run.q, run.v]) - other).max()
off = np.abs(normal - answers)[:-1].max()
print(f"largest difference: {error:.1e}, of the normal force {off:.1e} N")
assert error <= 1e-8 and off <= 1e-8
sliding = (run.time > 0.2) & (run.time < 0.6 - 1e-9)
assert np.abs(sideways + mu * normal)[sliding].max() <= 1e-8

# %%
# In a figure
# -----------
# At rest the end effector pushes with the commanded force. Once it slides it does not: the arm has
# a mass, and :math:`J^T f_d` does not know the acceleration.

elbow = l1 * np.stack([np.cos(run.q[:, 0]), np.sin(run.q[:, 0])], axis=1)
both = run.q.sum(axis=1)
tip = elbow + l2 * np.stack([np.cos(both), np.sin(both)], axis=1)
figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 2.9))
left.plot(run.time[:-1], normal[:-1], label="normal")
left.plot(run.time[:-1], -sideways[:-1], label="friction")
left.axhline(20.0, color="0.5", linestyle=":", label="commanded")
left.set(xlabel="time [s]", ylabel="force on the table [N]", title="Push, slide, lift")
left.legend()
right.plot(run.time, 1e3 * (tip - tip[0]), label=["along", "above"])
right.set(xlabel="time [s]", ylabel="end effector [mm]", title="Motion of the end effector")
right.legend()

# %%
# In motion
# ---------
# The pink line is the force of the table on the end effector, 100 N to the metre.

table = np.array([[0.2, 0.1], [1.1, 0.1]])
force = np.stack([tip, tip + 0.01 * np.stack([sideways, normal], axis=1)], axis=1)
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    run.time,
    [
        (table, {"label": "table"}),
        (np.stack([0.0 * elbow, elbow, tip], axis=1), {"label": "arm"}),
        (force, {"color": "C3", "marker": "", "linewidth": 2.0, "label": "force"}),
    ],
    speed=0.25,
)
plt.show()

# %%
# Questions
# ---------
# 1. With which torques would the end effector press with 20 N while it slides, too? *Hint:* see
#    how the :ref:`pen <sphx_glr_generated_gallery_mechanics_plot_pen.py>` does it, and add the
#    friction.
# 2. At rest the table may answer sideways with any force up to 8 N, so the equations do not say
#    with which. What decides? *Hint:* push sideways with 5 N in the first phase.
