# SPDX-License-Identifier: Apache-2.0
r"""
Pendulum on a cart
==================

A cart :math:`m_1` on a rail carries a pendulum, a point mass :math:`m_2` on a rod of length
:math:`l_2`, that stands upright and would fall. *Robot Dynamics* (EECS 106B) gives its energies,
with :math:`q_1` the position of the cart, :math:`q_2` the angle from upright and :math:`l_1` the
height of the hinge:

.. math::

    T = \tfrac12 m_1 \dot q_1^2 + \tfrac12 m_2 \left(\dot q_1^2 + l_2^2 \dot q_2^2
        - 2 l_2 \cos(q_2)\, \dot q_1 \dot q_2\right), \qquad
    V = m_2 g\,(l_1 + l_2 \cos q_2) .

The minus sign says that :math:`q_2` is positive where the pendulum leans back,
:math:`x_2 = q_1 - l_2 \sin q_2`. The notes stop here; Lagrange's equations with a force :math:`F`
on the cart are

.. math::

    (m_1 + m_2)\, \ddot q_1 - m_2 l_2 \cos q_2\, \ddot q_2 + m_2 l_2 \sin q_2\, \dot q_2^2 &= F, \\
    - m_2 l_2 \cos q_2\, \ddot q_1 + m_2 l_2^2\, \ddot q_2 - m_2 g l_2 \sin q_2 &= 0 .

:Lectures: EECS 106B, pendulum on a cart
:Equations: 1; 12
:Shows: a controller that balances, from an exact linearization
"""

from importlib.resources import files

import numpy as np
from matplotlib import pyplot as plt
from scipy.integrate import solve_ivp  # pip install ".[gallery]"
from scipy.linalg import solve_discrete_are

from arm_sim import Simulator
from arm_sim.figures import animation, use_style

use_style()

# %%
# The scene
# ---------

print((files("arm_sim") / "scenes/lectures/cart_pendulum.yaml").read_text())

# %%
# Falling, and an independent solution
# ------------------------------------
# The equations above, solved by SciPy, and the simulator, which knows nothing but the robot
# description.

m1, m2, l2, g = 2.0, 0.5, 0.6, 9.81


def rates(time: float, x: np.ndarray, force: float = 0.0) -> np.ndarray:
    """Rates of (q1, q2) and their speeds."""
    c, s = np.cos(x[1]), np.sin(x[1])
    M = np.array([[m1 + m2, -m2 * l2 * c], [-m2 * l2 * c, m2 * l2**2]])
    right = [force - m2 * l2 * s * x[3] ** 2, m2 * g * l2 * s]
    return np.concatenate([x[2:], np.linalg.solve(M, right)])


exactly = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14}
sim = Simulator("cart_pendulum", dt=0.01, tolerance=1e-12)
fall = sim.run(2.0)
start = [0.0, 0.3, 0.0, 0.0]
reference = solve_ivp(rates, (0.0, 2.0), start, t_eval=fall.time, **exactly)
error = np.abs(np.hstack([fall.q, fall.v]).T - reference.y).max()
print(f"largest difference: {error:.1e}")
assert error <= 1e-8

# %%
# Nothing pushes the whole from outside along the rail, so the centre of mass stays where it was.

centre = (m1 * fall.q[:, 0] + m2 * (fall.q[:, 0] - l2 * np.sin(fall.q[:, 1]))) / (m1 + m2)
print(f"the centre of mass moves by {np.ptp(centre):.1e} m")
assert np.ptp(centre) <= 1e-10

# %%
# A balancing controller
# ----------------------
# About the upright position the motion from step to step is nearly linear,
# :math:`x_{k+1} = A x_k + B F_k`; the simulator gives the exact derivatives of its step. The force
# :math:`F = -K x` that minimizes :math:`\sum x^T Q x + R F^2` follows from a Riccati equation
# (the linear quadratic regulator). The weights are those of 0.1 m, 0.1 rad and 10 N.

sim.reset(q=[0.0, 0.0])
A, B = sim.linearize(sim.state, np.zeros(2))
B = B[:, :1]  # the hinge has no drive
Q, R = np.diag([100.0, 100.0, 1.0, 1.0]), np.array([[0.01]])
P = solve_discrete_are(A, B, Q, R)
K = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)[0]
print("K =", np.round(K, 2))
print("eigenvalues:", np.round(np.linalg.eigvals(A - np.outer(B, K)), 3))


def balance(state) -> np.ndarray:
    """Force on the cart, and no torque at the hinge."""
    return np.array([-K @ np.concatenate([state.q, state.v]), 0.0])


sim.reset(q=[0.0, 0.5])
run = sim.run(3.0, balance)
print(f"from 0.5 rad: {abs(run.q[-1, 1]):.1e} rad after 3 s; up to {abs(run.command).max():.0f} N")
assert abs(run.q[-1, 1]) < 2e-3

# %%
# The independent solution is led by the same gains, and holds each force for a step as well.

x, other = np.array([0.0, 0.5, 0.0, 0.0]), []
for _ in run.time:
    other.append(x)
    force = -K @ x
    x = solve_ivp(rates, (0.0, sim.dt), x, args=(force,), **exactly).y[:, -1]
error = np.abs(np.hstack([run.q, run.v]) - other).max()
print(f"largest difference: {error:.1e}")
assert error <= 1e-8

# %%
# In a figure
# -----------

figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 2.9))
left.plot(run.time, run.q[:, 0])
left.set(xlabel="time [s]", title="Balanced from 0.5 rad", ylim=(-0.8, 0.6))
left.set_ylabel("cart [m]", color="C0")
other = left.twinx()
other.grid(False)
other.spines["right"].set_visible(True)
other.set_ylabel("pendulum [rad]", color="C1")
other.plot(run.time, run.q[:, 1], color="C1")
other.set_ylim(-0.8, 0.6)
right.step(run.time, run.command[:, 0], where="post")
right.set(xlabel="time [s]", ylabel="force on the cart [N]", title="Control force")

# %%
# In motion
# ---------

cart, angle = run.q.T
hinge = np.stack([cart, np.full_like(cart, 0.1)], axis=1)
bob = hinge + l2 * np.stack([-np.sin(angle), np.cos(angle)], axis=1)
corners = np.array([[-0.15, 0.0], [0.15, 0.0], [0.15, 0.1], [-0.15, 0.1], [-0.15, 0.0]])
box = corners + np.stack([cart, 0.0 * cart], axis=1)[:, None]
rail = np.array([[-1.0, -0.01], [0.4, -0.01]])
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    run.time,
    [rail, (box, {"marker": "", "color": "0.3", "label": "cart"}),
     (np.stack([hinge, bob], axis=1), {"label": "pendulum"})],
    size=(5.5, 4.0),
)  # fmt: skip
plt.show()

# %%
# Questions
# ---------
# 1. From which angle on does the controller no longer save the pendulum? *Hint:* the rail ends at
#    2 m; and how much force would a nearly horizontal pendulum need?
# 2. The cart first moves *towards* the side to which the pendulum leans. Why must it do
#    so at some time? *Hint:* the second equation: which accelerations of the cart right the
#    pendulum?
