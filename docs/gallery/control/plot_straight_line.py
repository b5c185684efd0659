# SPDX-License-Identifier: Apache-2.0
r"""
Tracking: the end effector follows a straight line
==================================================

Task 2 of ME 6102: move P from :math:`P_s` to :math:`P_f` in a straight line, with
:math:`\theta_i^d(t)` from inverse kinematics. The notes ask: "What would be the best controller to
do this job? PID, Feed forward etc." and "How much deviation from the straight line will occur?"
This page measures it.

On the line the end effector keeps to
:math:`P(t) = P_s + s(t)\,(P_f - P_s)` with :math:`s = 10\sigma^3 - 15\sigma^4 + 6\sigma^5`,
:math:`\sigma = t / T`, at rest at both ends. The joints follow from the Jacobian,

.. math::

   \dot q_d = J^{-1} \dot P, \qquad \ddot q_d = J^{-1} (\ddot P - \dot J \dot q_d),

and three controllers, with :math:`e = q_d - q`, are compared:

.. math::

   \text{PID:} \quad & \tau = K_p e + K_d \dot e + K_i \textstyle\int e\,dt \\
   \text{feed-forward:} \quad & \tau = M(q_d)\,\ddot q_d + C(q_d, \dot q_d)\,\dot q_d + G(q_d)
   + b\,\dot q_d + K_p e + K_d \dot e \\
   \text{computed torque:} \quad & \tau = M(q)\,(\ddot q_d + 2\omega\dot e + \omega^2 e)
   + C(q, \dot q)\,\dot q + G(q) + b\,\dot q

The arm and its equations are those of :doc:`plot_regulation`.

:Lectures: ME 6102, task 2: tracking
:Equations: 13; 14; 16
:Shows: how far the end effector leaves a line, by pace and by model
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp  # pip install ".[gallery]"

from arm_dynamics import load_scene
from arm_dynamics.control import PID, ComputedTorque, FeedForwardPD
from arm_dynamics.trajectory import Reference
from arm_sim import Simulator
from arm_sim.figures import animation, legend_outside, use_style

use_style()

# %%
# The scene
# ---------
# ``two_link``, and the same arm with 0.3 kg at its end effector, of which the controllers are not
# told.

exact = Simulator("two_link", dt=2e-3, tolerance=1e-11)
loaded = Simulator(
    load_scene("two_link").model_dump(exclude_unset=True)
    | {"payloads": [{"frame": "tip", "mass": 0.3}]},
    dt=2e-3,
    tolerance=1e-11,
)
dt, l1, l2, lc1, lc2, m1, m2, g = 2e-3, 0.5, 0.4, 0.25, 0.2, 2.0, 1.5, 9.81
I1, I2 = m1 * l1**2 / 12, m2 * l2**2 / 12
b, limit = np.array([0.4, 0.2]), np.array([60.0, 25.0])
P_s, P_f = np.array([0.65, -0.2]), np.array([0.3, 0.5])

# %%
# Inverse kinematics along the line
# ---------------------------------


def position(q):
    upper, lower = q[..., 0], q[..., 0] + q[..., 1]
    x = l1 * np.cos(upper) + l2 * np.cos(lower)
    return np.stack([x, l1 * np.sin(upper) + l2 * np.sin(lower)], axis=-1)


def desired(t, T):
    """Positions, velocities and accelerations of the joints."""
    u = min(t / T, 1.0)
    s, ds = 10 * u**3 - 15 * u**4 + 6 * u**5, 30 * u**2 * (1 - u) ** 2 / T
    dds = 60 * u * (1 - u) * (1 - 2 * u) / T**2
    x, z = P_s + s * (P_f - P_s)
    bend = np.arccos((x**2 + z**2 - l1**2 - l2**2) / (2 * l1 * l2))
    lift = np.arctan2(z, x) - np.arctan2(l2 * np.sin(bend), l1 + l2 * np.cos(bend))
    one = l1 * np.array([np.cos(lift), np.sin(lift)])
    two = l2 * np.array([np.cos(lift + bend), np.sin(lift + bend)])
    turned = np.array([[0, -1], [1, 0]])
    J = np.column_stack([turned @ (one + two), turned @ two])
    v = np.linalg.solve(J, ds * (P_f - P_s))
    J_dot_v = -one * v[0] ** 2 - two * (v[0] + v[1]) ** 2
    return np.array([lift, bend]), v, np.linalg.solve(J, dds * (P_f - P_s) - J_dot_v)


# %%
# The derivatives are checked by differences, and the positions by the way back.

step, T = 1e-5, 0.8
for t in (0.1, 0.3, 0.7):
    (q0, v0, _), (q1, v1, a1), (q2, v2, _) = (desired(t + k * step, T) for k in (-1, 0, 1))
    assert np.abs((q2 - q0) / (2 * step) - v1).max() < 1e-6
    assert np.abs((v2 - v0) / (2 * step) - a1).max() < 1e-6
    assert abs(np.linalg.det(np.column_stack([position(q1) - P_s, P_f - P_s]))) < 1e-12

# %%
# The run
# -------

kp, ki, kd, omega = np.array([250.0, 75.0]), np.array([800.0, 240.0]), np.array([25.0, 6.5]), 16.0


def controllers(model):
    return {
        "PID": PID(2, kp, ki, kd, dt),
        "feed-forward": FeedForwardPD(model, kp, kd),
        "computed torque": ComputedTorque(model, omega, dt=0.0),
    }


def follow(sim, controller, T):
    """Go along the line in the time T, with the model that the controller has."""
    sim.reset(desired(0.0, T)[0], np.zeros(2))
    return sim.run(T, lambda s: controller.torque(s, Reference(*desired(s.time, T))))


def off_line(run):
    """Distance of the end effector from the line in [m], and from where it should be on it."""
    along = (P_f - P_s) / np.linalg.norm(P_f - P_s)
    aside = (position(run.q) - P_s) @ np.array([-along[1], along[0]])
    asked = position(np.array([desired(t, run.time[-1])[0] for t in run.time]))
    return np.abs(aside), np.linalg.norm(position(run.q) - asked, axis=1)


runs = {name: follow(exact, c, T) for name, c in controllers(exact.dynamics).items()}
for name, run in runs.items():
    aside, away = off_line(run)
    print(f"{name:16s} at most {1e3 * aside.max():7.3f} mm off the line, "
          f"{1e3 * away.max():7.3f} mm off its place")  # fmt: skip

# %%
# An independent solution
# -----------------------
# The equations of the arm and the three formulas by hand, for three arms in rows.


def terms(q, v):
    """M, C v + b v and G."""
    c2, s2 = np.cos(q[:, 1]), np.sin(q[:, 1])
    d12 = m2 * (lc2**2 + l1 * lc2 * c2) + I2
    d11 = m1 * lc1**2 + m2 * (l1**2 + lc2**2 + 2 * l1 * lc2 * c2) + I1 + I2
    h = -m2 * l1 * lc2 * s2
    speed = [h * (2 * v[:, 0] * v[:, 1] + v[:, 1] ** 2), -h * v[:, 0] ** 2]
    second = m2 * lc2 * g * np.cos(q[:, 0] + q[:, 1])
    first = (m1 * lc1 + m2 * l1) * g * np.cos(q[:, 0]) + second
    M = np.array([[d11, d12], [d12, np.full_like(d12, m2 * lc2**2 + I2)]]).transpose(2, 0, 1)
    return M, np.stack(speed, axis=1) + b * v, np.stack([first, second], axis=1)


def rates(t, x, tau):
    q, v = x.reshape(2, 3, 2)
    M, moving, weight = terms(q, v)
    a = np.linalg.solve(M, (tau - moving - weight)[..., None])[..., 0]
    return np.concatenate([v, a]).ravel()


q, v, integral, states = np.tile(desired(0.0, T)[0], (3, 1)), np.zeros((3, 2)), np.zeros(2), []
for t in runs["PID"].time:
    states.append(q)
    q_d, v_d, a_d = desired(t, T)
    (M_d,), (moving_d,), (weight_d,) = terms(q_d[None], v_d[None])
    M, moving, weight = terms(q, v)
    e, e_dot = q_d - q, v_d - v
    tau = kp * e + kd * e_dot
    tau[0] += integral
    tau[1] += M_d @ a_d + moving_d + weight_d
    tau[2] = M[2] @ (a_d + 2 * omega * e_dot[2] + omega**2 * e[2]) + moving[2] + weight[2]
    integral = integral + ki * dt * e[0]
    x = solve_ivp(
        rates, (0, dt), np.concatenate([q, v]).ravel(), args=(np.clip(tau, -limit, limit),),
        method="DOP853", rtol=1e-11, atol=1e-12,
    ).y[:, -1]  # fmt: skip
    q, v = x.reshape(2, 3, 2)
states = np.array(states)
for k, (name, run) in enumerate(runs.items()):
    error = np.abs(run.q - states[:, k]).max()
    print(f"{name:16s} largest difference {error:.1e} rad")
    assert error <= 1e-8
worst = {name: off_line(run)[1].max() for name, run in runs.items()}
assert worst["computed torque"] < 0.1 * worst["PID"]
assert worst["feed-forward"] < 0.1 * worst["PID"]

# %%
# The faster, the farther off
# ---------------------------
# "What if we want the robot to take P to the final position faster?" PID makes all of its torque
# out of errors, that for the weight too, and the more torque a pace asks for, the farther off it
# is. With a model only what is wrong in it is left, and that a torque is held for a control cycle.

times = np.array([0.6, 0.8, 1.1, 1.5])
table = {
    (plant, name): [1e3 * off_line(follow(sim, controller, T))[0].max() for T in times]
    for plant, sim in (("exact model", exact), ("0.3 kg not known", loaded))
    for name in runs
    for controller in [controllers(exact.dynamics)[name]]
}
assert (np.diff(table["exact model", "computed torque"]) < 0).all()

# %%
# In a figure
# -----------

# The end effector of the two controllers with a model is on the line, within the width of the
# drawing.

figure, axes = plt.subplots(1, 2, figsize=(7.2, 3.8), width_ratios=[1.0, 1.9])
colours = {"PID": "C1", "feed-forward": "C2", "computed torque": "C0"}
axes[0].plot(*np.array([P_s, P_f]).T, "k:", label="line")
axes[0].plot(*position(runs["PID"].q).T, color=colours["PID"])
axes[0].set(xlabel="x [m]", ylabel="z [m]", aspect="equal", title="0.78 m in 0.8 s")
for (plant, name), values in table.items():
    style = "o-" if plant == "exact model" else "s--"
    label = name if plant == "exact model" else None
    axes[1].loglog(times, values, style, ms=4, color=colours[name], label=label)
axes[1].plot([], [], "o-", color="0.5", label="exact model")
axes[1].plot([], [], "s--", color="0.5", label="0.3 kg not known")
axes[1].set(xlabel="time for the line [s]", ylabel="largest distance from the line [mm]",
            title="Error by duration",
            xticks=times, xticklabels=[f"{T:g}" for T in times])  # fmt: skip
axes[1].minorticks_off()
legend_outside(figure)

# %%
# In motion
# ---------
# PID (orange) and computed torque (blue), half as fast.


def chain(q):
    elbow = l1 * np.stack([np.cos(q[:, 0]), np.sin(q[:, 0])], axis=-1)
    return np.stack([0 * elbow, elbow, position(q)], axis=1)


# sphinx_gallery_thumbnail_number = 2
motion = animation(
    runs["PID"].time,
    [(np.array([P_s, P_f]), {"label": "line"}),
     (chain(runs["PID"].q), {"color": "C1", "label": "PID, and its path"}),
     (chain(runs["computed torque"].q), {"label": "computed torque"})],
    trail=position(runs["PID"].q),
    speed=0.5,
)  # fmt: skip
plt.show()

# %%
# Questions
# ---------
# 1. Which of the controllers suffers most from the unknown mass, and which gains would help?
#    *Hint:* the dashed curves; an error of the model is a disturbance, and the feedback is
#    :math:`K_p` in one case and :math:`M \omega^2` in the other.
# 2. Move :math:`P_f` to a point 0.89 m from the shoulder; the arm reaches 0.9 m. What happens to
#    the joint speeds? *Hint:* print :math:`\det J = l_1 l_2 \sin q_2` along the line. For any
#    arm, ``arm_dynamics.trajectory`` makes lines (``line``, ``timed``, ``joint_path``) and slows
#    them down to its limits (``paced``).
