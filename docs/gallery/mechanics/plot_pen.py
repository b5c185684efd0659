# SPDX-License-Identifier: Apache-2.0
r"""
Pen at constant height
======================

"Writing with a pen (constant height)" is an example of a constraint in *Dynamics of open chain*
(CTU): the velocity obeys :math:`A(q)\, \dot q = 0`, with :math:`A = \partial z/\partial q` for the
height :math:`z` of the pen, and

.. math::

    \tau = M(q)\, \ddot q + h(q, \dot q) + A^T(q)\, \lambda, \qquad
    \lambda = \left(A M^{-1} A^T\right)^{-1}
        \left(A M^{-1} (\tau - h) + \dot A \dot q\right) .

:math:`A^T\lambda` is the force against the constraint, as joint torques: :math:`\lambda` is the
force on the sheet, upwards positive. Inverse dynamics computes :math:`\tau` from a wanted
:math:`\ddot q` and a wanted :math:`\lambda`, so a motion along the sheet and a pressure onto it
can be chosen together. For a force :math:`f_d` of the end effector,
:math:`\lambda = (J^{-T} A^T)^\dagger f_d`.

:Lectures: CTU, "Writing with a pen (constant height)"
:Equations: 18
:Shows: motion along a sheet and pressure onto it, chosen together
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

print((files("arm_sim") / "scenes/lectures/pen_arm.yaml").read_text())
m1, m2, l1, l2, g, height = 1.3, 0.7, 0.6, 0.4, 9.81, 0.1

# %%
# The equations of this arm
# -------------------------
# M and h of the :ref:`ideal 2R arm <sphx_glr_generated_gallery_mechanics_plot_two_mass_arm.py>`,
# and the Jacobian of its tip, whose second row is A.


def terms(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, ...]:
    """M, h, J and the acceleration of the tip that is there without joint acceleration."""
    s1, c1, s12, c12 = np.sin(q[0]), np.cos(q[0]), np.sin(q.sum()), np.cos(q.sum())
    s2, c2, w = np.sin(q[1]), np.cos(q[1]), v.sum()
    both = m2 * l2 * (l2 + l1 * c2)
    M = np.array([[(m1 + m2) * l1**2 + m2 * l2 * (l2 + 2 * l1 * c2), both], [both, m2 * l2**2]])
    h = m2 * l1 * l2 * s2 * np.array([-2 * v[0] * v[1] - v[1] ** 2, v[0] ** 2])
    h += g * np.array([(m1 + m2) * l1 * c1 + m2 * l2 * c12, m2 * l2 * c12])
    J = np.array([[-l1 * s1 - l2 * s12, -l2 * s12], [l1 * c1 + l2 * c12, l2 * c12]])
    rate = -np.array(
        [l1 * c1 * v[0] ** 2 + l2 * c12 * w**2, l1 * s1 * v[0] ** 2 + l2 * s12 * w**2]
    )
    return M, h, J, rate


def multiplier(q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> float:
    """λ by the formula of the notes."""
    M, h, J, rate = terms(q, v)
    A = J[1]
    W = np.linalg.solve(M, A)  # M⁻¹ Aᵀ
    return float((W @ (tau - h) + rate[1]) / (A @ W))


# %%
# A controller
# ------------
# The pen is to move to and fro along the sheet, pressed on with 5 N. Inverse dynamics gives the
# torques, with a small correction of errors along the sheet.

PRESSURE, SWING, TURN = 5.0, 0.15, 2.0 * np.pi  # [N], [m], [rad/s]
sim = Simulator("pen_arm", dt=2e-3, tolerance=1e-12)


def tip(q: np.ndarray) -> np.ndarray:
    """Where the pen is, for positions of shape (k, 2)."""
    both = q.sum(axis=-1)
    return np.stack(
        [l1 * np.cos(q[..., 0]) + l2 * np.cos(both), l1 * np.sin(q[..., 0]) + l2 * np.sin(both)],
        axis=-1,
    )


middle = tip(np.asarray(sim.state.q))[0]


def write(state) -> np.ndarray:
    """Torques for the motion along the sheet and the pressure onto it."""
    q, v, t = np.asarray(state.q), np.asarray(state.v), state.time
    M, h, J, rate = terms(q, v)
    ahead, behind = 1.0 - np.cos(TURN * t), np.sin(TURN * t)
    goal = np.array([middle + SWING * ahead, SWING * TURN * behind])  # place and speed
    wanted = SWING * TURN**2 * np.cos(TURN * t)
    wanted += 100.0 * (goal[0] - tip(q)[0]) + 20.0 * (goal[1] - J[0] @ v)
    a = np.linalg.solve(J, np.array([wanted, 0.0]) - rate)
    return M @ a + h + J[1] * -PRESSURE


run = sim.run(1.0, write)
pressure = -run.multipliers[:, 0]
path = tip(run.q)
print(f"the pen leaves the sheet by {np.abs(path[:, 1] - height).max():.1e} m")
off = np.abs(pressure - PRESSURE)[:-1].max()
print(f"pressure at the beginning of each tick: 5 N to {off:.1e} N")
assert np.abs(path[:, 1] - height).max() <= 1e-12
assert off <= 1e-8

# %%
# The independent solution
# ------------------------
# The notes' formula for :math:`\lambda`, then :math:`\ddot q = M^{-1}(\tau - h - A^T\lambda)`,
# with the torques that the controller gave.


def rates(time: float, x: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Rates of angles and speeds."""
    q, v = x[:2], x[2:]
    M, h, J, _ = terms(q, v)
    return np.concatenate([v, np.linalg.solve(M, tau - h - J[1] * multiplier(q, v, tau))])


x, other, forces = np.hstack([run.q[0], run.v[0]]), [], []
for tau in run.command:
    other.append(x)
    forces.append(-multiplier(x[:2], x[2:], tau))
    x = solve_ivp(rates, (0.0, sim.dt), x, "DOP853", args=(tau,), rtol=1e-13, atol=1e-14).y[:, -1]
error = np.abs(np.hstack([run.q, run.v]) - other).max()
print(f"largest difference: {error:.1e}, of the pressure {np.abs(pressure - forces).max():.1e} N")
assert error <= 1e-8 and np.abs(pressure - forces).max() <= 1e-8

# %%
# The last formula of the notes: a force of 5 N downwards is the multiplier −5. It is exact for
# forces that the constraint can take. A force that also points along the sheet has the same
# multiplier: the pseudo-inverse drops what would move the pen, and :math:`J^T f = A^T \lambda`
# does not hold.

J = terms(run.q[0], run.v[0])[2]
by_force = np.linalg.pinv(np.linalg.solve(J.T, J[1:].T))
for force in ([0.0, -PRESSURE], [3.0, -PRESSURE]):
    (of_force,) = by_force @ force
    left_over = np.abs(J.T @ force - J[1] * of_force).max()
    print(f"λ of the force {force} N: {of_force:.3f}; left over {left_over:.1e} N m")
    assert abs(of_force + PRESSURE) <= 1e-12 and (left_over <= 1e-12) == (force[0] == 0.0)

# %%
# In a figure
# -----------
# The torques are held for 2 ms, between which the pressure is not exactly the commanded one.

figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 2.9))
left.plot(run.time, 1e3 * (path[:, 0] - middle), label="pen")
left.plot(run.time, 1e3 * SWING * (1.0 - np.cos(TURN * run.time)), "--", label="goal")
left.set(xlabel="time [s]", ylabel="along the sheet [mm]", title="Motion")
left.legend()
right.plot(run.time[:-1], run.command[:-1], label=["shoulder", "elbow"])
right.set(xlabel="time [s]", ylabel="torque [N m]", title="Torques: motion, weight and pressure")
right.legend()

# %%
# In motion
# ---------

elbow = l1 * np.stack([np.cos(run.q[:, 0]), np.sin(run.q[:, 0])], axis=1)
sheet = np.array([[0.3, height], [1.05, height]])
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    run.time,
    [
        (sheet, {"label": "sheet"}),
        (np.stack([0.0 * elbow, elbow, path], axis=1), {"label": "arm"}),
    ],
    speed=0.5,
)
plt.show()

# %%
# Questions
# ---------
# 1. How does the pressure change if the controller takes the mass :math:`m_2` for 10 % lighter
#    than it is? *Hint:* change ``m2`` in the controller only, and look at ``run.multipliers``.
# 2. The sheet could not pull the pen. When does this constraint pull? *Hint:* set the pressure to
#    zero and watch the sign of :math:`\lambda`; what would a real pen do?
