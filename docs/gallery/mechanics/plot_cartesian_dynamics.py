# SPDX-License-Identifier: Apache-2.0
r"""
Dynamics in Cartesian space
===========================

*Introduction to Robotics* (session 17) writes the equation of motion for the end effector instead
of the joints. With :math:`\tau = J^T f` and :math:`\dot X = J \dot\theta`,

.. math::

    f = M_x \ddot X + V_x + G_x, \qquad
    M_x = J^{-T} M J^{-1}, \quad
    V_x = J^{-T} \left(V - M J^{-1} \dot J \dot\theta\right), \quad
    G_x = J^{-T} G,

and works it out for the :ref:`ideal 2R arm
<sphx_glr_generated_gallery_mechanics_plot_two_mass_arm.py>` in the axes of its second link,

.. math::

    J = \begin{bmatrix} l_1 s_2 & 0 \\ l_1 c_2 + l_2 & l_2 \end{bmatrix}, \qquad
    M_x = \begin{bmatrix} m_2 + m_1 / s_2^2 & 0 \\ 0 & m_2 \end{bmatrix}, \qquad
    G_x = \begin{bmatrix} m_1 g\, c_1 / s_2 + m_2 g\, s_{12} \\ m_2 g\, c_{12} \end{bmatrix} .

.. admonition:: Errata

    * :math:`(M_x)_{11}` is printed as :math:`m_2 + m_1 / s_2`. It has :math:`s_2^2`; as printed,
      the mass would be negative for :math:`\theta_2 < 0`.
    * :math:`V_x` is left open. It is

      .. math::

          V_x = \begin{bmatrix}
              -m_2 (l_1 c_2 + l_2)\, \dot\theta_1^2 - m_2 l_2\, \dot\theta_2^2
              - (2 m_2 l_2 + m_2 l_1 c_2 + m_1 l_1 c_2 / s_2^2)\, \dot\theta_1 \dot\theta_2 \\
              m_2 l_1 s_2\, \dot\theta_1 (\dot\theta_1 + \dot\theta_2) \end{bmatrix},

      where :math:`\ddot X` are the rates of the components of :math:`\dot X` along the moving
      axes: :math:`\dot J` is taken in these axes.

:Lectures: session 17, Cartesian space
:Equations: 15
:Shows: M, V and G of the end effector, and a pull along the link
"""

from importlib.resources import files

import numpy as np
from matplotlib import pyplot as plt
from scipy.integrate import solve_ivp  # pip install ".[gallery]"

from arm_dynamics.task_space import TaskSpace
from arm_sim import Simulator
from arm_sim.figures import animation, use_style

use_style()

# %%
# The scene
# ---------

print((files("arm_sim") / "scenes/lectures/two_mass_arm.yaml").read_text())
m1, m2, l1, l2, g = 1.3, 0.7, 0.6, 0.4, 9.81


def jacobian(q: np.ndarray) -> np.ndarray:
    """Speeds of the end effector along and across the second link, per joint speed."""
    s2, c2 = np.sin(q[1]), np.cos(q[1])
    return np.array([[l1 * s2, 0.0], [l1 * c2 + l2, l2]])


def terms(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """M_x, V_x and G_x, from the equations above."""
    s2, c2, c1 = np.sin(q[1]), np.cos(q[1]), np.cos(q[0])
    M = np.diag([m2 + m1 / s2**2, m2])
    V = np.array([
        -m2 * (l1 * c2 + l2) * v[0] ** 2 - m2 * l2 * v[1] ** 2
        - (2 * m2 * l2 + m2 * l1 * c2 + m1 * l1 * c2 / s2**2) * v[0] * v[1],
        m2 * l1 * s2 * v[0] * (v[0] + v[1]),
    ])  # fmt: skip
    G = g * np.array([m1 * c1 / s2 + m2 * np.sin(q.sum()), m2 * np.cos(q.sum())])
    return M, V, G


# %%
# The terms
# ---------
# ``TaskSpace`` computes them for any arm; ``local`` are the axes of the frame.

sim = Simulator("two_mass_arm", dt=5e-3, tolerance=1e-13)
space = TaskSpace(sim.dynamics, "tip", reference="local", selection=("x", "z"))
q, v = np.array([0.4, -1.1]), np.array([-1.5, 2.0])
computed = space.terms(q, v)
M_x, V_x, G_x = terms(q, v)
for name, ours, theirs in (
    ("J", computed.jacobian, jacobian(q)), ("M_x", computed.inertia, M_x),
    ("V_x", computed.coriolis, V_x), ("G_x", computed.gravity, G_x),
):  # fmt: skip
    print(f"{name}: largest difference {np.abs(ours - theirs).max():.1e}")
    assert np.abs(ours - theirs).max() <= 1e-10
printed = m2 + m1 / np.sin(q[1])
print(f"(M_x)_11 = {M_x[0, 0]:.3f} kg; as printed {printed:.3f} kg")
assert abs(printed - computed.inertia[0, 0]) > 1.0

# %%
# The run and an independent solution
# -----------------------------------
# A constant force pulls the end effector back along the second link, the weight being carried,
# :math:`f = G_x - (2\,\mathrm{N}, 0)`. The simulator gets it as joint torques :math:`\tau = J^T
# f`, held for a step of 5 ms. The reference integrates the equation in Cartesian space: its state
# is the angles, and the velocity :math:`w` of the end effector in the axes of the link.

PULL = np.array([-2.0, 0.0])  # [N]


def pulled(state) -> np.ndarray:
    """Joint torques that carry the arm and pull the end effector."""
    q = np.asarray(state.q)
    return jacobian(q).T @ (terms(q, np.zeros(2))[2] + PULL)


def rates(time: float, x: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Rates of the angles, and of the components of the end effector's velocity."""
    J = jacobian(x[:2])
    v = np.linalg.solve(J, x[2:])
    M, V, G = terms(x[:2], v)
    return np.concatenate([v, np.linalg.solve(M, np.linalg.solve(J.T, tau) - V - G)])


run = sim.run(1.0, pulled)
x, other = np.hstack([run.q[0], [0.0, 0.0]]), []
for tau in run.command:
    other.append(np.hstack([x[:2], np.linalg.solve(jacobian(x[:2]), x[2:])]))
    x = solve_ivp(rates, (0.0, sim.dt), x, "DOP853", args=(tau,), rtol=1e-13, atol=1e-14).y[:, -1]
error = np.abs(np.hstack([run.q, run.v]) - other).max()
print(f"largest difference: {error:.1e}")
assert error <= 1e-8
elbow_angle = run.q[:, 1]
print(f"the elbow stays between {elbow_angle.min():.2f} and {elbow_angle.max():.2f} rad")

# %%
# In a figure
# -----------
# Along the second link the end effector feels both masses, the first one through a lever that
# locks as the arm straightens; across the link it feels the load alone.

figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 2.9))
bend = np.linspace(0.15, np.pi - 0.15, 200)
left.semilogy(np.degrees(bend), m2 + m1 / np.sin(bend) ** 2, label="along the link")
left.semilogy(np.degrees(bend), m2 + 0 * bend, label="across the link")
left.semilogy(np.degrees(bend), m2 + m1 / np.sin(bend), "C2--", label="along, as printed")
left.set(xlabel="elbow [°]", ylabel="mass at the end effector [kg]", title="Mass $M_x$ by posture")
left.legend(loc="upper center")
along, across = np.transpose([jacobian(a) @ b for a, b in zip(run.q, run.v, strict=True)])
right.plot(run.time, along, label="along the link")
right.plot(run.time, across, label="across the link")
right.set(
    xlabel="time [s]", ylabel="end-effector speed [m/s]", title="Pulled along the link by 2 N"
)
right.legend()

# %%
# In motion
# ---------
# The pink line is the force, drawn beside the link.

elbow = l1 * np.stack([np.cos(run.q[:, 0]), np.sin(run.q[:, 0])], axis=1)
both = run.q.sum(axis=1)
along = np.stack([np.cos(both), np.sin(both)], axis=1)
tip = elbow + l2 * along
beside = tip + 0.03 * np.stack([-along[:, 1], along[:, 0]], axis=1)
arrow = np.stack([beside, beside - 0.12 * along], axis=1)  # the force
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    run.time,
    [
        (np.stack([0.0 * elbow, elbow, tip], axis=1), {"label": "arm"}),
        (arrow, {"color": "C3", "marker": "", "linewidth": 2.0, "label": "force"}),
    ],
    trail=(tip, {"label": "path of the end effector"}),
    speed=0.5,
)
plt.show()

# %%
# Questions
# ---------
# 1. Which joint torques does a force along the second link need when the arm is stretched? *Hint:*
#    look at :math:`J^T` for :math:`s_2 = 0`, and at the mass along the link.
# 2. Is :math:`\ddot X` of the equation the acceleration of the end effector? *Hint:* compare it
#    with :math:`J\ddot\theta + \dot J\dot\theta` in axes that do not turn.
