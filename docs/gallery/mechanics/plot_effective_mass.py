# SPDX-License-Identifier: Apache-2.0
r"""
Effective mass of the end effector
==================================

"How massy would end-effector feel if we move it by hand? Depends on the direction of force", says
*Dynamics of open chain* (CTU). The kinetic energy is the same in both coordinates, and with
:math:`V = J(q)\, \dot q`

.. math::

    \tfrac12 V^T \Lambda(q)\, V = \tfrac12 \dot q^T M(q)\, \dot q, \qquad
    \Lambda(q) = J^{-T}(q)\, M(q)\, J^{-1}(q) .

For the :ref:`ideal 2R arm <sphx_glr_generated_gallery_mechanics_plot_two_mass_arm.py>`
:math:`\Lambda = \operatorname{diag}(m_2 + m_1/\sin^2\theta_2,\; m_2)` along and across the second
link. A force along the unit vector :math:`u` accelerates the end effector in this direction as if
it had the mass

.. math::

    m_u = \frac{1}{u^T \Lambda^{-1} u} .

.. admonition:: Errata

    * :math:`V^T \Lambda V = (J^{-1}V)^T M\, (J^{-1}V)^T` has one transpose too many; the last
      factor is :math:`J^{-1} V`.
    * "Kinetic energy must be constant" means: the same in both coordinates.

:Lectures: CTU, "How massy would end-effector feel"
:Equations: 15
:Shows: the mass of the end effector by direction, felt and computed
"""

from importlib.resources import files

import numpy as np
from matplotlib import pyplot as plt

from arm_dynamics.task_space import TaskSpace
from arm_sim import Simulator
from arm_sim.figures import animation, use_style

use_style()

# %%
# The scene
# ---------

print((files("arm_sim") / "scenes/lectures/two_mass_arm.yaml").read_text())
m1, m2, l1, l2 = 1.3, 0.7, 0.6, 0.4

# %%
# The mass matrix of the end effector
# -----------------------------------
# In axes of the world, by ``TaskSpace`` and by the formulas above. ``TaskSpace`` computes
# :math:`(J M^{-1} J^T)^{-1}`. This is the same if J is square and regular, and is defined for arms
# with more joints, too, whose J has no inverse.


def mobility(q: np.ndarray) -> np.ndarray:
    """The inverse of Λ in axes of the world, from the closed form."""
    both, s2 = q.sum(), np.sin(q[1])
    R = np.array([[np.cos(both), -np.sin(both)], [np.sin(both), np.cos(both)]])
    return R @ np.diag([s2**2 / (m2 * s2**2 + m1), 1.0 / m2]) @ R.T


sim = Simulator("two_mass_arm", integrator="rk4", dt=1e-6)
space = TaskSpace(sim.dynamics, "tip", selection=("x", "z"))
q = np.array([-0.5, 1.2])
error = np.abs(space.terms(q).inertia - np.linalg.inv(mobility(q))).max()
print(f"largest difference: {error:.1e} kg")
assert error <= 1e-8

# %%
# The printed formula cannot even be evaluated: a row does not multiply a row.

V = np.array([[0.3], [0.1]])
J, M = space.jacobian(q), sim.dynamics.mass_matrix(q)
qd = np.linalg.solve(J, V)
print("corrected:", (qd.T @ M @ qd).item(), "=", (V.T @ np.linalg.inv(mobility(q)) @ V).item())
assert abs((qd.T @ M @ qd - V.T @ np.linalg.inv(mobility(q)) @ V).item()) <= 1e-12
try:
    qd.T @ M @ qd.T
except ValueError as wrong:
    print("printed:", str(wrong)[:45], "…")
else:
    raise AssertionError("a row was multiplied by a row")

# %%
# Feeling the mass
# ----------------
# The drives carry the weight, and the end effector is pushed with 1 N for a microsecond. Force and
# time over the speed that it has then is what a finger feels.

felt, directions = [], np.deg2rad(np.arange(0.0, 360.0, 30.0))
for angle in directions:
    u = np.array([np.cos(angle), np.sin(angle)])
    sim.reset(q)
    sim.step(sim.dynamics.gravity(q) + space.jacobian(q).T @ u)
    felt.append(sim.dt / (space.jacobian(sim.state.q) @ sim.state.v @ u))
said = [1.0 / (u @ mobility(q) @ u) for u in np.stack([np.cos(directions), np.sin(directions)]).T]
print("simulated", *(f"{m:.3f}" for m in felt[:6]), "kg")
assert np.abs(np.divide(felt, said) - 1.0).max() <= 1e-6

# %%
# In a figure
# -----------
# The mass by direction, and how it grows without bound along the link as the arm straightens.

figure = plt.figure(figsize=(7.2, 3.4))
left = figure.add_subplot(1, 2, 1, projection="polar")
right = figure.add_subplot(1, 2, 2)
every = np.linspace(0.0, 2.0 * np.pi, 361)
way = np.stack([np.cos(every), np.sin(every)], axis=1)
left.plot(every, [1.0 / (u @ mobility(q) @ u) for u in way], label="closed form")
left.plot(directions, felt, "o", label="simulated")
left.set_title("Mass of the end effector [kg], by direction")
left.set_rlabel_position(120.0)
left.legend(loc="upper left", bbox_to_anchor=(-0.42, 0.06))
bends = np.deg2rad(np.linspace(4.0, 176.0, 87))
masses = np.array([space.mass_ellipsoid([0.0, bend]).masses for bend in bends])
right.semilogy(np.degrees(bends), masses[:, 1], label="heaviest direction")
right.semilogy(np.degrees(bends), masses[:, 0], label="lightest direction")
right.set(xlabel="elbow [°]", ylabel="mass [kg]", title="By posture")
right.legend(loc="upper center")

# %%
# In motion
# ---------
# As the elbow bends, the ellipse of :math:`\Lambda^{-1}`, how far a unit force moves the end
# effector, turns with the second link. It is a needle where the arm is straight.

bend = np.deg2rad(np.linspace(2.0, 178.0, 60))
postures = np.stack([-0.25 * bend, bend], axis=1)
elbow = l1 * np.stack([np.cos(postures[:, 0]), np.sin(postures[:, 0])], axis=1)
both = postures.sum(axis=1)
tip = elbow + l2 * np.stack([np.cos(both), np.sin(both)], axis=1)
ellipses = np.array([0.15 * way @ mobility(p) for p in postures]) + tip[:, None]
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    np.linspace(0.0, 3.0, 60),
    [
        (np.stack([0.0 * elbow, elbow, tip], axis=1), {"label": "arm"}),
        (ellipses, {"color": "C1", "marker": "", "linewidth": 1.5, "label": "mobility"}),
    ],
)
plt.show()

# %%
# Questions
# ---------
# 1. Push in a direction in which the end effector is neither lightest nor heaviest. Why does it
#    not move in the direction of the push? *Hint:* :math:`\Lambda^{-1} u` is parallel to u along
#    the axes of the ellipse only.
# 2. An end effector that must also not give way sideways feels heavier: :math:`u^T \Lambda u \ge
#    m_u`. Why? *Hint:* what does the force that keeps it on its line do to the joints?
