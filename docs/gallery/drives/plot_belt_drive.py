# SPDX-License-Identifier: Apache-2.0
r"""
Belt drive, rigid and flexible
==============================

ME 6102 asks for the "Belt drive with and without flexible belt": the inertia that the motor feels,
and the degree of freedom that appears when the belt gives. The notes have a picture and leave the
equations to the lecture; these are ours.

The motor (angle :math:`\theta_m`) has a pulley of radius :math:`r_1`, the wheel (:math:`\theta_l`)
one of :math:`r_2 = N r_1`. If the belt does not stretch, :math:`\theta_m = N\theta_l` is one
coordinate, and equal energies give the equivalent inertia at the motor's shaft,

.. math::

   \left(J_m + \frac{J_l}{N^2}\right) \ddot\theta_m
   + \left(B_m + \frac{B_l}{N^2}\right) \dot\theta_m = \tau .

A belt that stretches lets the angles differ. Of its two pre-tensioned runs, each a spring
:math:`k` with a damper :math:`c`, one lengthens by :math:`x = r_1\theta_m - r_2\theta_l` and the
other shortens, so that :math:`V = 2 \cdot \tfrac12 k x^2`:

.. math::

   J_m \ddot\theta_m + B_m \dot\theta_m + r_1 (2 k x + 2 c \dot x) &= \tau \\
   J_l \ddot\theta_l + B_l \dot\theta_l - r_2 (2 k x + 2 c \dot x) &= 0

:Lectures: ME 6102, "Belt drive with and without flexible belt"
:Equations: Flexible joint, belt, harmonic drive
:Shows: the inertia that a motor feels, and a belt that gives
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
# Stiffness and damping are those between motor and wheel, as the wheel feels them:
# :math:`2 k r_2^2` and :math:`2 c r_2^2`. Without the key ``transmission`` the same scene is the
# rigid drive.

text = (files("arm_sim") / "scenes/lectures/belt_drive.yaml").read_text()
print(text)
flexible = Simulator("belt_drive", tolerance=1e-12)
scene = yaml.safe_load(text)
del scene["joints"]["axle"]["transmission"]
rigid = Simulator(scene, tolerance=1e-12)

# %%
# The run and an independent solution
# -----------------------------------
# The motor turns with 0.2 N m for 0.2 s, then it brakes with as much. The command is the torque at
# the wheel, :math:`N\tau`. The flexible drive has two further states, angle and speed of the motor
# divided by :math:`N`.

N, pull, until, end = 4.0, 0.2, 0.2, 0.4
ticks = np.arange(round(end / rigid.dt)) * rigid.dt
torque = np.where(ticks < until, pull, -pull)[:, None]
stiff, soft = rigid.run(end, N * torque), flexible.run(end, N * torque)
t = soft.time
print(flexible.z_names)

# %%
# Both systems are linear, :math:`\dot x = A x + b\tau`; the solution is that of the exponential of
# a matrix, :math:`\begin{pmatrix} A & b\tau \\ 0 & 0 \end{pmatrix} t`.

r1, r2, k, c = 0.01, 0.04, 5e3, 6.25
J_m, B_m, J_l, B_l = 1e-4, 2e-4, 4e-3, 0.01


def solve(A, b):
    """The states at all times, from rest, under the two torques one after the other."""
    n = len(A)
    x, states = np.append(np.zeros(n), 1.0), []
    for tau in (pull, -pull):
        whole = np.zeros((n + 1, n + 1))
        whole[:n, :n], whole[:n, n] = A, np.array(b) * tau
        piece = np.array([expm(whole * s) @ x for s in t[t <= until]])
        states.append(piece if tau > 0 else piece[1:])
        x = piece[-1]
    return np.vstack(states)[:, :n]


J, B = J_m + J_l / N**2, B_m + B_l / N**2
one = solve(np.array([[0, 1], [0, -B / J]]), [0, 1 / J])  # θ_m and its rate

stretch = np.array([r1, -r2, 0, 0])  # x = stretch · (θ_m, θ_l, rates)
rate = np.array([0, 0, r1, -r2])
tension = 2 * k * stretch + 2 * c * rate
two = solve(
    np.array([
        [0, 0, 1, 0],
        [0, 0, 0, 1],
        (-r1 * tension - [0, 0, B_m, 0]) / J_m,
        (r2 * tension - [0, 0, 0, B_l]) / J_l,
    ]),
    [0, 0, 1 / J_m, 0],
)  # fmt: skip

for name, simulated, exact in (
    ("rigid: wheel", stiff.q[:, 0], one[:, 0] / N),
    ("flexible: wheel", soft.q[:, 0], two[:, 1]),
    ("flexible: motor", N * soft.z[:, 0], two[:, 0]),
):
    error = np.abs(simulated - exact).max()
    print(f"{name}: largest difference {error:.1e} rad, of {exact.max():.1f} rad")
    assert error <= 1e-8

# %%
# The two inertias swing against each other with
# :math:`\omega^2 = 2 k r_2^2 \left(\frac{1}{N^2 J_m} + \frac{1}{J_l}\right)`.

omega = np.sqrt(2 * k * r2**2 * (1 / (N**2 * J_m) + 1 / J_l))
print(f"natural frequency {omega / (2 * np.pi):.1f} Hz")
twist = soft.z[:, 0] - soft.q[:, 0]
swings = np.flatnonzero(np.diff(np.sign(np.gradient(twist[t < until])))) * rigid.dt
assert abs(np.pi / np.diff(swings).mean() / omega - 1) < 0.02  # two extremes in a period

# %%
# In a figure
# -----------

figure, axes = plt.subplots(1, 2, figsize=(7.2, 3.0))
axes[0].plot(t, stiff.v[:, 0], "k--", lw=1.0, label="rigid belt")
axes[0].plot(t, soft.v[:, 0], label="flexible belt: wheel")
axes[0].plot(t, soft.z[:, 1], lw=1.0, label="flexible belt: motor / N")
axes[0].set(xlabel="time [s]", ylabel="speed [rad/s]", title="0.2 N m, then −0.2 N m")
axes[0].legend()
x = r1 * two[:, 0] - r2 * two[:, 1]
pulling = 2 * k * x + 2 * c * (r1 * two[:, 2] - r2 * two[:, 3])
axes[1].plot(t, soft.tau[:, 0], label="simulated")
axes[1].plot(t, r2 * pulling, "k:", label="$r_2\\,(2kx + 2c\\dot x)$")
axes[1].set(xlabel="time [s]", ylabel="torque on the wheel [N m]", title="Torque of the belt")
axes[1].legend()

# %%
# In motion
# ---------
# Both pulleys, a twentieth as fast, and the belt's stretch twenty times as large: the mark on the
# large pulley falls behind the short one, which shows where it would be if the belt were rigid.

turn = np.linspace(0.0, 2 * np.pi, 61)
circle = np.column_stack([np.cos(turn), np.sin(turn)])
left, right = np.array([-0.08, 0.0]), np.array([0.03, 0.0])
shown = slice(0, 300)


def mark(angle, radius, centre, inner=0.0):
    way = np.column_stack([np.sin(angle), -np.cos(angle)])[:, None]
    return centre + way * np.array([inner, radius])[:, None]


lean = np.arcsin((r2 - r1) / (right - left)[0])  # of the straight runs of the belt
up = np.array([-np.sin(lean), np.cos(lean)])
runs = [np.array([left + r1 * side, right + r2 * side]) for side in (up, up * [1, -1])]
motor, wheel = two[shown, 0], two[shown, 1]
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    t[shown],
    [left + r1 * circle, right + r2 * circle, *runs,
     (mark(motor, r1, left), {"marker": "", "label": "motor, wheel"}),
     (mark(motor / N - 20 * (motor / N - wheel), r2, right), {"marker": ""}),
     (mark(motor / N, 1.25 * r2, right, 1.08 * r2),
      {"marker": "", "color": "C1", "label": "wheel with a rigid belt"})],
    speed=0.05,
    size=(6.4, 3.6),
    title="Belt drive, stretch × 20",
)  # fmt: skip
plt.show()

# %%
# Questions
# ---------
# 1. The controller of a robot sees the motor's angle only. Up to which frequency may it be fast?
#    *Hint:* with the motor held, the wheel swings at :math:`\sqrt{2 k r_2^2 / J_l}`; print it.
# 2. With belts ten and a hundred times as stiff, how does the largest distance between the rigid
#    and the flexible wheel fall? *Hint:* multiply ``stiffness``; the distance goes with
#    :math:`1/k`, the swings with :math:`1/\sqrt k` in speed.
