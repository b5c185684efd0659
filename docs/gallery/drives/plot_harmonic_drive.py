# SPDX-License-Identifier: Apache-2.0
r"""
Harmonic drive with hysteresis
==============================

ME 6102 names "hysteresis in harmonic drives" as its example of a model that comes from
measurements of input and output rather than from the physics of the phenomenon. It gives no
equations; these are ours.

The flexible spline of the gear twists by :math:`\delta = \theta_m / N - \theta_l`. Its torque has
a spring that stiffens and a part that depends on the way that led to the twist, the law of Bouc
and Wen with a state :math:`w`, :math:`|w| \le 1`:

.. math::

   \tau_s = k\,\delta + k_3\,\delta^3 + H w, \qquad \dot w = \frac{1}{D} \left( \dot\delta -
   \tfrac12 \bigl( \dot\delta\,|w| + |\dot\delta|\,w \bigr) \right)

With the output clamped and :math:`\theta = \theta_m / N` the motor has

.. math:: N^2 J_m \ddot\theta + N^2 B_m \dot\theta + \tau_s = N \tau_m .

The rate :math:`dw/d\delta` depends on the direction of :math:`\dot\delta` and on nothing else of
it: the loop is the same at any speed. While a twist grows, :math:`1 - w` falls as
:math:`e^{-\delta / D}`; after a reversal :math:`w` comes down as a straight line, like that of a
spring :math:`H/D`.

:Lectures: ME 6102, "hysteresis in harmonic drives"
:Equations: Flexible joint, belt, harmonic drive
:Shows: a twist that remembers the way that led to it
"""

from importlib.resources import files

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp  # pip install ".[gallery]"

from arm_sim import Simulator
from arm_sim.figures import animation, use_style

use_style()

# %%
# The scene
# ---------
# How the numbers are found on a data sheet stands on the page "Drives": H is half the
# width of the loop at zero torque, D the twist in which a reversal closes half of it.

print((files("arm_sim") / "scenes/lectures/harmonic_drive.yaml").read_text())
sim = Simulator("harmonic_drive", tolerance=1e-11)
print(sim.z_names)

# %%
# The run and an independent solution
# -----------------------------------
# The torque swings sinusoidally with a period of 2 s, in steps of 5 ms, with three amplitudes.

ticks = np.arange(500) * sim.dt
runs = {}
for amplitude in (8.0, 15.0, 30.0):
    sim.reset()
    runs[amplitude] = sim.run(2.5, amplitude * np.sin(np.pi * ticks)[:, None])
    assert (runs[amplitude].q == 0.0).all()  # the clamp holds to the bit

# %%
# DOP853 of SciPy integrates the equations above from step to step of the torque.

k, k3, H, D = 4000.0, 2e8, 4.0, 4e-4
J, B = 100.0**2 * 1e-4, 100.0**2 * 2e-3


def rates(t, x, tau):
    twist, speed, w = x
    bent = speed * abs(w) + abs(speed) * w
    push = tau - B * speed - (k * twist + k3 * twist**3 + H * w)
    return [speed, push / J, (speed - 0.5 * bent) / D]


run = runs[15.0]
x, exact = np.zeros(3), [np.zeros(3)]
for tau in run.command[:-1, 0]:
    x = solve_ivp(
        rates, (0, sim.dt), x, args=(tau,), method="DOP853", rtol=1e-12, atol=1e-15
    ).y[:, -1]  # fmt: skip
    exact.append(x)
exact = np.array(exact)
for name, column in (("twist [rad]", 0), ("hysteresis w", 2)):
    error = np.abs(run.z[:, column] - exact[:, column]).max()
    print(f"{name}: largest difference {error:.1e}, of {exact[:, column].max():.1e}")
    assert error <= 1e-8

# %%
# The area of the loop is the energy that a cycle turns into heat. Over a full period all that the
# motor gives ends in the loop and in its bearing, :math:`\int N^2 B_m \dot\theta^2 dt`.


def integral(y: np.ndarray, x: np.ndarray) -> float:
    """The integral of y over x, by trapezoids."""
    return float(0.5 * (y[1:] + y[:-1]) @ np.diff(x))


cycle = (run.time >= 0.5) & (run.time <= 2.5)
twist, w = run.z[cycle, 0], run.z[cycle, 2]
area = integral(H * w, twist)
lost = run.lost[cycle][-1] - run.lost[cycle][0]
bearing = integral(B * run.z[cycle, 1] ** 2, run.time[cycle])
print(f"area of the loop {1e3 * area:.2f} mJ; lost {1e3 * lost:.2f} mJ, of which "
      f"{1e3 * bearing:.2f} mJ in the bearing")  # fmt: skip
assert abs(area + bearing - lost) < 0.01 * lost

# %%
# In a figure
# -----------

figure, axes = plt.subplots(1, 2, figsize=(7.2, 3.4))
for amplitude, loop in reversed(runs.items()):
    torque = k * loop.z[:, 0] + k3 * loop.z[:, 0] ** 3 + H * loop.z[:, 2]
    axes[0].plot(1e3 * loop.z[:, 0], torque, label=f"±{amplitude:g} N m")
    axes[1].plot(1e3 * loop.z[:, 0], H * loop.z[:, 2])
axes[0].set(xlabel="twist [mrad]", ylabel="torque [N m]", title="Output clamped")
axes[1].set(xlabel="twist [mrad]", ylabel="hysteresis H w [N m]", title="The part with a memory")
axes[0].legend(loc="upper left")

# %%
# In motion
# ---------
# The wave generator, whose ellipse turns a hundred times as far as the spline twists, and the
# place on the loop.

loop = runs[30.0]
seen = loop.time >= 0.5
angle = 100.0 * loop.z[seen, 0]
turn = np.linspace(0.0, 2 * np.pi, 61)
ellipse = np.column_stack([0.95 * np.cos(turn), 0.7 * np.sin(turn)])
cos, sin = np.cos(angle), np.sin(angle)
spline = np.einsum("ijk,lj->kli", np.array([[cos, -sin], [sin, cos]]), ellipse)
arrow = np.stack([-spline[:, 0], spline[:, 0]], axis=1)
torque = k * loop.z[seen, 0] + k3 * loop.z[seen, 0] ** 3 + H * loop.z[seen, 2]
place = np.column_stack([2.6 + loop.z[seen, 0] / loop.z[:, 0].max(), torque / 30.0])
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    loop.time[seen],
    [np.column_stack([np.cos(turn), np.sin(turn)]), (spline, {"marker": "", "label": "spline"}),
     (arrow, {"marker": "", "linewidth": 1.0, "color": "0.3"}),
     (place[:, None], {"color": "C3", "label": "now"})],
    trail=(place, {"label": "torque over twist"}),
    size=(6.4, 3.6),
    title="Wave generator, and its place on the loop",
)  # fmt: skip
plt.gca().set_axis_off()  # a sketch, not to scale
plt.show()

# %%
# Questions
# ---------
# 1. Show that the loop does not depend on the speed: run the largest amplitude with half the
#    frequency. *Hint:* compare ``H * w`` over the twist; what changes is the part of the bearing.
# 2. A controller sees the motor's angle and wants the output to within 0.1 mrad. How far is the
#    output off after the torque went up to 30 N m and back to zero? *Hint:* look at the twist
#    where the torque passes zero; it is about :math:`H/k` at most.
