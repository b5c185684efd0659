# SPDX-License-Identifier: Apache-2.0
r"""
Regulation: go to a point and stay there
========================================

Task 1 of ME 6102: "we want the manipulator to move P from :math:`P_s` to :math:`P_f`, not
bothered about path". Its two steps are inverse kinematics and a command to the motors, and its
questions: what is a command, how large must the torque be, and how do the links stay where they
are? Four controllers answer, each of which knows more than the one before. The arm is that of the
notes, with two centres of mass:

.. math::

   d_{11} \ddot q_1 + d_{12} \ddot q_2 + h\,(2 \dot q_1 \dot q_2 + \dot q_2^2)
   + \partial V / \partial q_1 + b_1 \dot q_1 &= \tau_1 \\
   d_{12} \ddot q_1 + d_{22} \ddot q_2 - h\,\dot q_1^2
   + \partial V / \partial q_2 + b_2 \dot q_2 &= \tau_2

with :math:`h = -m_2 l_1 l_{c2} \sin q_2` and

.. math::

   d_{11} &= m_1 l_{c1}^2 + m_2 (l_1^2 + l_{c2}^2 + 2 l_1 l_{c2} \cos q_2) + I_1 + I_2 \\
   d_{12} &= m_2 (l_{c2}^2 + l_1 l_{c2} \cos q_2) + I_2, \qquad d_{22} = m_2 l_{c2}^2 + I_2

.. admonition:: Erratum

   The weight on the second joint is printed without :math:`g`. It is

   .. math:: \frac{\partial V}{\partial q_2} = m_2\,l_{c2}\,g \cos(q_1 + q_2) .

   A controller that carries the weight as printed leaves the end effector millimetres from its
   goal, as seen at the end of the comparison.

:Lectures: ME 6102, task 1: regulation
:Equations: 1; 13; 16
:Shows: four controllers on the way to a point
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp  # pip install ".[gallery]"

from arm_dynamics.control import PD, PID, ComputedTorque, PDGravity
from arm_dynamics.task_space import InverseKinematics, Pose, TaskSpace
from arm_dynamics.trajectory import Reference
from arm_sim import Simulator
from arm_sim.figures import animation, use_style

use_style()

# %%
# The scene
# ---------
# ``two_link`` comes with the suite: rods of 0.5 and 0.4 m in a vertical plane, of 2 and 1.5 kg,
# with viscous friction. Its motors give 60 and 25 N m at most.

sim = Simulator("two_link", dt=2e-3, tolerance=1e-11)
l1, l2, lc1, lc2, m1, m2, g = 0.5, 0.4, 0.25, 0.2, 2.0, 1.5, 9.81
I1, I2 = m1 * l1**2 / 12, m2 * l2**2 / 12
b, limit = np.array([0.4, 0.2]), np.array([60.0, 25.0])

# %%
# Step 1: inverse kinematics
# --------------------------
# The joint angles for a point :math:`(x, z)` follow from the law of cosines. There are two of
# them, which the notes do not mention: the elbow points up or down.


def joints(x, z, elbow):
    bend = elbow * np.arccos((x**2 + z**2 - l1**2 - l2**2) / (2 * l1 * l2))
    lift = np.arctan2(z, x) - np.arctan2(l2 * np.sin(bend), l1 + l2 * np.cos(bend))
    return np.array([lift, bend])


def position(q):
    upper, lower = q[..., 0], q[..., 0] + q[..., 1]
    x = l1 * np.cos(upper) + l2 * np.cos(lower)
    return np.stack([x, l1 * np.sin(upper) + l2 * np.sin(lower)], axis=-1)


P_f = np.array([0.45, 0.45])
goals = {"up": joints(*P_f, -1.0), "down": joints(*P_f, 1.0)}
for way, q in goals.items():
    print(f"elbow {way}: {np.round(q, 4)} rad")
    assert np.abs(position(q) - P_f).max() < 1e-12
goal = goals["down"]

# %%
# The suite finds the same for any arm, by iteration:

tip = TaskSpace(sim.dynamics, "tip", selection=("x", "z"))
found = InverseKinematics(tip).reach(Pose(np.array([P_f[0], 0.0, P_f[1]]), np.eye(3)))
assert min(np.abs(found - q).max() for q in goals.values()) < 1e-8

# %%
# Step 2: a command to the motors
# -------------------------------
# With :math:`e = q_d - q` and a reference at rest:
#
# PD
#    :math:`\tau = K_p e - K_d \dot q`
# PID
#    :math:`\tau = K_p e - K_d \dot q + K_i \int e\,dt`
# PD with gravity
#    :math:`\tau = G(q) + K_p e - K_d \dot q`
# Computed torque
#    :math:`\tau = M(q) (\omega^2 e - 2 \omega \dot q) + C \dot q + G + b \dot q`

kp, ki, kd, omega = np.array([80.0, 25.0]), np.array([200.0, 80.0]), np.array([14.0, 3.5]), 8.0
reference = Reference(goal, np.zeros(2), np.zeros(2))
controllers = {
    "PD": PD(2, kp, kd),
    "PID": PID(2, kp, ki, kd, sim.dt),
    "PD with gravity": PDGravity(sim.dynamics, kp, kd),
    "computed torque": ComputedTorque(sim.dynamics, omega, dt=0.0),
}
runs = {}
for name, controller in controllers.items():
    sim.reset()
    runs[name] = sim.run(2.0, lambda s, c=controller: c.torque(s, reference))
    away = 1e3 * np.linalg.norm(position(runs[name].q) - P_f, axis=1)
    print(f"{name:16s} away from the point after 0.5, 1 and 2 s: "
          + ", ".join(f"{away[round(t / sim.dt)]:9.4f} mm" for t in (0.5, 1, 2)))  # fmt: skip

# %%
# An independent solution
# -----------------------
# The equations of the notes and the four formulas, written by hand for all four arms at once;
# DOP853 of SciPy carries them from one command to the next.


def terms(q, v):
    """M, C v + b v and G of the notes, for arms in rows."""
    c2, s2 = np.cos(q[:, 1]), np.sin(q[:, 1])
    d12 = m2 * (lc2**2 + l1 * lc2 * c2) + I2
    d11 = m1 * lc1**2 + m2 * (l1**2 + lc2**2 + 2 * l1 * lc2 * c2) + I1 + I2
    d22 = np.full_like(d12, m2 * lc2**2 + I2)
    h = -m2 * l1 * lc2 * s2
    speed = [h * (2 * v[:, 0] * v[:, 1] + v[:, 1] ** 2), -h * v[:, 0] ** 2]
    second = m2 * lc2 * g * np.cos(q[:, 0] + q[:, 1])
    first = (m1 * lc1 + m2 * l1) * g * np.cos(q[:, 0]) + second
    M = np.array([[d11, d12], [d12, d22]]).transpose(2, 0, 1)
    return M, np.stack(speed, axis=1) + b * v, np.stack([first, second], axis=1)


def rates(t, x, tau):
    q, v = x.reshape(2, 4, 2)
    M, moving, weight = terms(q, v)
    a = np.linalg.solve(M, (tau - moving - weight)[..., None])[..., 0]
    return np.concatenate([v, a]).ravel()


x = np.array([[sim.model.scene.initial.position[joint] for joint in sim.joint_names]] * 4)
x, integral, states = np.concatenate([x, np.zeros((4, 2))]), np.zeros(2), []
for _ in runs["PD"].time:
    q, v = x.reshape(2, 4, 2)
    states.append(q)
    M, moving, weight = terms(q, v)
    e = goal - q
    tau = kp * e - kd * v
    tau[1] += integral
    tau[2] += weight[2]
    tau[3] = M[3] @ (omega**2 * e[3] - 2 * omega * v[3]) + moving[3] + weight[3]
    integral = integral + ki * sim.dt * e[1]
    x = solve_ivp(
        rates, (0, sim.dt), x.ravel(), args=(np.clip(tau, -limit, limit),),
        method="DOP853", rtol=1e-11, atol=1e-12,
    ).y[:, -1]  # fmt: skip
states = np.array(states)
for k, (name, run) in enumerate(runs.items()):
    error = np.abs(run.q - states[:, k]).max()
    print(f"{name:16s} largest difference {error:.1e} rad")
    assert error <= 1e-8

# %%
# Where they end
# --------------
# PD comes to rest where its springs carry the weight, :math:`K_p e = G(q)`. With the weight added
# it rests at the goal, but not with the weight as printed. The gains of computed torque make the
# error of each joint :math:`e_0 (1 + \omega t)\,e^{-\omega t}`, but for the torque that is held
# for a control cycle.

rest = runs["PD"].q[-1]
assert np.abs(kp * (goal - rest) - sim.dynamics.gravity(rest)).max() < 0.02
assert np.linalg.norm(position(rest) - P_f) > 0.05
assert np.linalg.norm(position(runs["computed torque"].q[-1]) - P_f) < 1e-5


def as_printed(state):
    weight = sim.dynamics.gravity(state.q)
    weight[1] /= g
    return weight + kp * (goal - state.q) - kd * state.v


sim.reset()
off = np.linalg.norm(position(sim.run(2.0, as_printed).q[-1]) - P_f)
print(f"PD with the weight as printed: {1e3 * off:.1f} mm away")
assert off > 0.004

# %%
# In a figure
# -----------

figure, axes = plt.subplots(1, 2, figsize=(7.2, 3.4))
for (name, run), color in zip(runs.items(), ("0.6", "C1", "C2", "C0"), strict=True):
    path = position(run.q)
    far = 1e3 * np.linalg.norm(path - P_f, axis=1)
    axes[0].semilogy(run.time, far, color=color, label=name)
    axes[1].plot(*path.T, color=color)
axes[0].set(xlabel="time [s]", ylabel="distance from the goal [mm]", title="Convergence")
axes[0].legend()
axes[1].plot(*P_f, "k+", ms=12, label="goal")
axes[1].set(xlabel="x [m]", ylabel="z [m]", aspect="equal", title="Path of the end effector")
axes[1].legend()

# %%
# In motion
# ---------
# Computed torque (blue) and PD (grey).


def chain(q):
    elbow = l1 * np.stack([np.cos(q[:, 0]), np.sin(q[:, 0])], axis=-1)
    return np.stack([0 * elbow, elbow, position(q)], axis=1)


shown = runs["PD"].time <= 1.5
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    runs["PD"].time[shown],
    [(chain(runs["PD"].q[shown]), {"color": "0.6", "label": "PD"}),
     (chain(runs["computed torque"].q[shown]), {"label": "computed torque"}),
     (np.array([P_f, P_f]),
      {"marker": "+", "markersize": 12, "color": "k", "linestyle": "", "label": "goal"})],
    trail=(
        position(runs["computed torque"].q[shown]),
        {"color": "C0", "label": "path of the end effector"},
    ),
    speed=0.5,
)  # fmt: skip
plt.show()

# %%
# Questions
# ---------
# 1. "What if we want the robot to take P to the final position faster?" Double :math:`\omega`,
#    and look at the torques. *Hint:* ``runs["computed torque"].tau`` meets the limits of the
#    motors; how does the largest torque grow with :math:`\omega`?
# 2. Tell the model a forearm that is 20 % heavier and compare all four. *Hint:* give the
#    controllers the ``dynamics`` of another scene, with a ``payloads`` entry; who still arrives?
