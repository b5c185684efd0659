# SPDX-License-Identifier: Apache-2.0
r"""
DC motor: winding, rotor and torque–speed curve
===============================================

A DC motor is an electrical and a mechanical system that are tied together by one constant. ME 6102
("Motor dynamics") has the two equations, for a motor that drives a load :math:`\tau_l` through a
gear of ratio :math:`N`:

.. math::

   J_m \ddot\theta_m + B_m \dot\theta_m + \frac{\tau_l}{N} = \tau_m = K_t \phi I_a, \qquad
   V_a = R_a I_a + E_b + L \frac{dI_a}{dt}, \qquad E_b = K \phi\, \omega

.. admonition:: Left open

   The notes write :math:`K_t` in one equation and :math:`K` in the other. In SI units they are the
   same number: the electrical power :math:`E_b I_a` that the rotor takes is the mechanical power
   :math:`\tau_m \omega` that it gives, so :math:`K_t \phi = K \phi`. Data sheets give the product
   with the flux :math:`\phi`, as "torque constant", 0.05 N m/A on this page. Where the notes then
   add friction they print :math:`\tau_l` for :math:`\tau_l / N`, see :doc:`plot_motor_friction`.

The load is a flywheel :math:`J_l` and a torque :math:`\tau_e` that pulls it back, so that
:math:`\tau_l = J_l \dot\omega_l + \tau_e` with :math:`\omega_l = \omega / N`. The equivalent
inertia at the motor, which the notes leave to the lecture, is :math:`J = J_m + J_l / N^2`.

:Lectures: ME 6102, "Motor dynamics"
:Equations: Motor
:Shows: winding, back-EMF and the torque–speed curve
"""

from importlib.resources import files

import matplotlib.pyplot as plt
import numpy as np
import yaml
from scipy.linalg import expm  # pip install ".[gallery]"

from arm_sim import Simulator
from arm_sim.figures import animation, use_style

use_style()

# %%
# The scene
# ---------
# The joint's position is that of the flywheel. The current is a state of its own, ``run.z``,
# because there is an inductance. ``tunable: [external]`` lets a torque act from outside.

text = (files("arm_sim") / "scenes/lectures/dc_motor.yaml").read_text()
print(text)

# %%
# The run and an independent solution
# -----------------------------------
# 12 V at time zero; after 0.3 s a torque of 2 N m holds the flywheel back.

sim = Simulator("dc_motor", tolerance=1e-12)
volts, pulled = 12.0, 2.0
spin_up = sim.run(0.3, [volts])
sim.set_parameter("external", [-pulled])
loaded = sim.run(0.3, [volts])
time = np.append(spin_up.time, loaded.time[1:])
current = np.append(spin_up.z[:, 0], loaded.z[1:, 0])
speed = np.append(spin_up.v[:, 0], loaded.v[1:, 0])  # of the flywheel

# %%
# The two equations are linear in :math:`x = (I_a, \omega)`, :math:`\dot x = A x + b`, so the
# solution is :math:`x = x_\infty + e^{At} (x_0 - x_\infty)` with :math:`x_\infty = -A^{-1} b`.

R, L, K, J_m, B_m, N, J_l = 1.0, 2e-3, 0.05, 5e-5, 1e-5, 10.0, 5e-3
J = J_m + J_l / N**2
A = np.array([[-R / L, -K / L], [K / J, -B_m / J]])


def closed_form(x0, torque, times):
    settled = -np.linalg.solve(A, [volts / L, -torque / N / J])
    return np.array([settled + expm(A * t) @ (x0 - settled) for t in times])


free = closed_form(np.zeros(2), 0.0, spin_up.time)
braked = closed_form(free[-1], pulled, spin_up.time)
exact = np.vstack([free, braked[1:]])
for name, run, solution, unit in (
    ("current", current, exact[:, 0], "A"), ("speed", N * speed, exact[:, 1], "rad/s"),
):  # fmt: skip
    error = np.abs(run - solution).max()
    print(f"largest difference of the {name}: {error:.1e} {unit}, of {solution.max():.0f} {unit}")
    assert error <= 1e-8
without_ratio = closed_form(free[-1], N * pulled, spin_up.time)
assert abs(without_ratio[-1, 1] - N * speed[-1]) > 100.0  # τ_l in place of τ_l / N
print("poles:", np.round(np.linalg.eigvals(A), 1), "1/s")

# %%
# One constant for torque and back-EMF also closes the energy account: what the voltage supplies is
# kinetic or magnetic energy, or heat of the winding and the bearing.

print(f"supplied {spin_up.supplied[-1]:.3f} J, stored {spin_up.energy[-1]:.3f} J, "
      f"lost {spin_up.lost[-1]:.3f} J")  # fmt: skip
assert np.abs(spin_up.balance).max() < 1e-9

# %%
# The torque–speed curve
# ----------------------
# At constant speed and current the two equations become one line from the stall torque to the
# no-load speed,
#
# .. math:: \tau_m = K \frac{V_a - K\omega}{R_a}.
#
# The motor is run against six loads until it settles, and every end lies on the line. A current
# limit, as amplifiers have, cuts it off.

curve = []
for load in np.linspace(0.0, 5.0, 6):
    sim.reset()
    sim.set_parameter("external", [-load])
    end = sim.run(1.0, [volts]).z[-1, 0], N * sim.state.v[0]
    curve.append((end[1], K * end[0]))
curve = np.array(curve)
off = np.abs(curve[:, 1] - K * (volts - K * curve[:, 0]) / R).max()
print(f"largest distance of the settled torque from the line: {off:.1e} N m")
assert off <= 1e-8

limited = yaml.safe_load(text)
limited["joints"]["shaft"]["actuator"] |= {"current_limit": 8.0}
cut = Simulator(limited, tolerance=1e-10).run(0.4, [volts])
assert abs(cut.z[:, 0].max() - 8.0) < 1e-6

# %%
# In a figure
# -----------

figure, axes = plt.subplots(1, 2, figsize=(7.2, 3.0))
axes[0].plot(time, current)
axes[0].set(xlabel="time [s]", title="12 V, and a load from 0.3 s on")
axes[0].set_ylabel("current [A]", color="C0")
other = axes[0].twinx()
other.grid(False)
other.spines["right"].set_visible(True)
other.set_ylabel("speed of the flywheel [rad/s]", color="C1")
other.plot(time, speed, color="C1")

w = np.linspace(0.0, volts / K, 200)
axes[1].plot(w, K * (volts - K * w) / R, color="0.6", label="steady state")
axes[1].plot(N * speed, K * current, label="the run")
axes[1].plot(N * cut.v[:, 0], K * cut.z[:, 0], "--", label="with a limit of 8 A")
axes[1].plot(*curve.T, "ko", ms=4, label="settled under six loads")
axes[1].set(xlabel="speed of the motor [rad/s]", ylabel="torque of the motor [N m]",
            title="Torque–speed curve", ylim=(0, 0.8))  # fmt: skip
axes[1].legend(loc="upper right")

# %%
# In motion
# ---------
# The flywheel, a tenth as fast as it is, and the voltage's two parts as bars: what the winding
# takes, :math:`R_a I_a + L\,dI_a/dt` (left), and the back-EMF :math:`E_b` (right), which grows
# until little is left for the current, and gives some of it back under the load.

angle = np.append(spin_up.q[:, 0], loaded.q[1:, 0])
shown = time <= 0.5
turn = np.linspace(0.0, 2 * np.pi, 61)
rim = np.column_stack([np.cos(turn), np.sin(turn)])
spoke = np.column_stack([np.sin(angle), -np.cos(angle)])[shown]
wheel = np.stack([-spoke, spoke], axis=1)
height = 2.0 * K * N * speed[shown] / volts - 1.0
bar = np.array([[1.9, -1.0], [1.9, -1.0]]) + np.zeros((len(height), 1, 1))
bar[:, 1, 1] = height
rest = np.array([[1.5, -1.0], [1.5, -1.0]]) + np.zeros((len(height), 1, 1))
rest[:, 1, 1] = -height
thick = {"linewidth": 12, "marker": "", "solid_capstyle": "butt"}
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    time[shown],
    [
        rim,
        (wheel, {"marker": "", "label": "flywheel"}),
        (bar, thick | {"color": "C2", "label": "back-EMF"}),
        (rest, thick | {"color": "C1", "label": "winding"}),
    ],
    speed=0.1,
    size=(5.4, 3.8),
    title="Flywheel and the parts of the voltage",
)
plt.gca().set_axis_off()  # a sketch, not to scale
plt.show()

# %%
# Questions
# ---------
# 1. At which speed does the motor give most power, and which part of the electrical power is that?
#    *Hint:* :math:`\tau_m\omega` is a parabola; at its top the current is half of
#    the stall current.
# 2. Which pole is electrical, which mechanical, and what do they become for :math:`L \to 0`?
#    *Hint:* print the poles with ``L`` a tenth as large; one goes to :math:`-R/L`, the other to
#    :math:`-K^2 / (R J)`. Leave ``inductance`` out of the scene and ``run.z`` is empty.
