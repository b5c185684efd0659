# SPDX-License-Identifier: Apache-2.0
r"""
Motor with friction: the LuGre model
====================================

Friction is what makes a motor hard to identify, says ME 6102 ("Motor Dynamics + friction",
"Friction models"), and gives the model of bristles that carries the names of Lund and Grenoble,
with the bristles' deflection :math:`\chi`:

.. math::

   J_m \ddot\theta_m + F_f = \tau_m, \qquad
   F_f = \sigma_0 \chi + \sigma_1 \dot\chi + \sigma_2 \dot\theta_m, \qquad
   \dot\chi = \dot\theta_m - \frac{|\dot\theta_m|}{g(\dot\theta_m)}\,\chi

.. math:: \sigma_0\,g(\dot\theta_m) = F_c + (F_s - F_c)\,e^{-(\dot\theta_m / v_s)^2}

.. admonition:: Errata

   * The notes put this :math:`\tau_f` into
     :math:`J_m \ddot\theta_m + B_m \dot\theta_m + \tau_f + \tau_l = \tau_m`. But
     :math:`\sigma_2 \dot\theta_m` is the viscous friction, so that :math:`B_m \dot\theta_m` counts
     it twice; and a load behind a gear enters as :math:`\tau_l / N`, as in the notes' other
     equations of the motor.
   * :math:`\tau_{fr} = F_f +` and :math:`\tau_{frp} =` end where they begin. With the model as
     above nothing is missing.
   * Friction is called a "transfer function", and Stribeck's model one "for viscous friction". Dry
     friction is not linear and has no transfer function, and Stribeck's curve is that of dry
     friction: how it falls from :math:`F_s` to :math:`F_c` as the joint begins to slide.

What the notes do not say: the model may give out energy where :math:`\sigma_1` is large. It never
does if :math:`\sigma_2 \ge \sigma_1 (F_s - F_c) / F_c`; a scene without that is refused.

:Lectures: ME 6102, "Motor Dynamics + friction", "Friction models"
:Equations: 8; Motor
:Shows: bristles that bend, hold and let slip
"""

from importlib.resources import files

import matplotlib.pyplot as plt
import numpy as np
import yaml
from scipy.integrate import solve_ivp  # pip install ".[gallery]"

from arm_dynamics import ArmError
from arm_sim import Simulator
from arm_sim.figures import animation, use_style

use_style()

# %%
# The scene
# ---------
# With ``lugre`` the keys ``coulomb``, ``static``, ``stribeck_velocity`` and ``viscous`` are
# :math:`F_c, F_s, v_s, \sigma_2`, and :math:`\chi` is a state, ``run.z``.

text = (files("arm_sim") / "scenes/lectures/motor_friction.yaml").read_text()
print(text)
lively = yaml.safe_load(text)
lively["joints"]["shaft"]["friction"]["lugre"]["sigma1"] = 0.04
try:
    Simulator(lively)
except ArmError as refused:
    print(refused)
else:
    raise AssertionError("a friction that gives out energy was accepted")

# %%
# The run and an independent solution
# -----------------------------------
# The current goes up and down in triangles that grow: the shaft gives way by up to 19 mrad, of
# which a part stays, since bristles that bend also slide; then it breaks away. The ripples are
# the rotor's oscillation on its bristles.

sim = Simulator("motor_friction", tolerance=1e-11)
phase = np.arange(600) * sim.dt / 0.4
triangle = 2 / np.pi * np.arcsin(np.sin(2 * np.pi * phase))
current = np.array([0.3, 0.5, 1.0])[phase.astype(int)] * triangle
run = sim.run(1.2, current[:, None])

# %%
# DOP853 of SciPy integrates the equations from one current to the next.

K, J, F_c, F_s, v_s, s0, s1, s2 = 0.05, 1e-4, 0.025, 0.03, 2.0, 3.0, 4e-3, 1e-3


def rates(t, x, torque):
    _, v, chi = x
    g = (F_c + (F_s - F_c) * np.exp(-((v / v_s) ** 2))) / s0
    chi_dot = v - abs(v) / g * chi
    return [v, (torque - s0 * chi - s1 * chi_dot - s2 * v) / J, chi_dot]


x, exact = np.zeros(3), [np.zeros(3)]
for i in current:
    x = solve_ivp(
        rates, (0, sim.dt), x, args=(K * i,), method="DOP853", rtol=1e-12, atol=1e-15
    ).y[:, -1]  # fmt: skip
    exact.append(x)
exact = np.array(exact)
for name, simulated, solution in (
    ("angle [rad]", run.q[:, 0], exact[:, 0]), ("bristles [rad]", run.z[:, 0], exact[:, 2]),
):  # fmt: skip
    error = np.abs(simulated - solution).max()
    print(f"{name}: largest difference {error:.1e}, of {np.abs(solution).max():.1e}")
    assert error <= 1e-8

# %%
# At constant speed the bristles rest, :math:`\chi = g`, and friction is Stribeck's curve. The
# speed at 1 A is where it meets the torque; with :math:`B_m \dot\theta_m` beside :math:`\sigma_2
# \dot\theta_m` it would be half of that.

steady = np.linspace(0.05, 30.0, 300)
curve = F_c + (F_s - F_c) * np.exp(-((steady / v_s) ** 2)) + s2 * steady
assert np.abs(sim.dynamics.friction(steady[:, None])[:, 0] - curve).max() < 1e-12
sim.reset()
reached = sim.run(3.0, [1.0]).v[-1, 0]
print(f"speed at 1 A: {reached:.4f} rad/s, from the curve {(K - F_c) / s2:.4f}")
assert abs(reached - (K - F_c) / s2) < 1e-6
assert abs(reached - (K - F_c) / (2 * s2)) > 10.0

# %%
# In a figure
# -----------

figure = plt.figure(figsize=(7.2, 5.0))
axes = figure.subplot_mosaic("ttbbss;aaaccc")
small, large = run.time <= 0.8, run.time >= 0.8
for name, ylabel, values in (
    ("t", "torque [mN m]", 1e3 * K * run.command[:, 0]),
    ("b", "bristles [mrad]", 1e3 * run.z[:, 0]),
    ("s", "speed [rad/s]", run.v[:, 0]),
):
    axes[name].plot(run.time, values)
    axes[name].set(xlabel="time [s]", ylabel=ylabel)
axes["a"].plot(1e3 * run.q[small, 0], 1e3 * K * run.command[small, 0])
axes["a"].set(xlabel="angle [mrad]", ylabel="torque [mN m]", title="Before it breaks away")
bristles_rate = np.gradient(exact[:, 2], run.time)
friction = s0 * run.z[:, 0] + s1 * bristles_rate + s2 * run.v[:, 0]
axes["c"].plot(run.v[large, 0], 1e3 * friction[large], lw=1.0, label="in the run")
axes["c"].plot(steady, 1e3 * curve, "k--", label="at constant speed")
axes["c"].plot(-steady, -1e3 * curve, "k--")
axes["c"].set(xlabel="speed [rad/s]", ylabel="friction [mN m]", title="Friction over speed",
              xlim=(-12, 12), ylim=(-45, 62))  # fmt: skip
axes["c"].legend(loc="upper left")

# %%
# In motion
# ---------
# The rotor turns over a bristle (orange, its deflection ten times as large), which bends, holds it
# back, and lets it slip.

seen = (run.time >= 0.4) & (run.time <= 1.0)
angle, bent = run.q[seen, 0], 10.0 * run.z[seen, 0]
turn = np.linspace(0.0, 2 * np.pi, 61)
mark = np.column_stack([np.sin(angle), -np.cos(angle)])
up = np.linspace(0.0, 1.0, 9)
bristle = np.stack(
    [bent[:, None] * up**2, np.broadcast_to(-1.6 + 0.6 * up, (len(bent), len(up)))], axis=-1
)
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    run.time[seen],
    [np.column_stack([np.cos(turn), np.sin(turn)]), np.array([[-0.5, -1.6], [0.5, -1.6]]),
     (np.stack([0 * mark, mark], axis=1), {"marker": "", "label": "rotor"}),
     (bristle, {"marker": "", "color": "C1", "label": "bristle, × 10"})],
    speed=0.1,
    title="Rotor and bristle",
)  # fmt: skip
plt.gca().set_axis_off()  # a sketch, not to scale
plt.show()

# %%
# Questions
# ---------
# 1. Does the shaft come back to where it was when the current returns to zero before it slips?
#    *Hint:* look at the angle at 0.2 s; bristles that bend also slide a little.
# 2. Between which speeds is friction an engine of oscillation, and what does that mean for a
#    motor that is to turn slowly? *Hint:* where the curve falls, a speed that drops a little is
#    braked more.
