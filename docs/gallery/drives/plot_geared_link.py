# SPDX-License-Identifier: Apache-2.0
r"""
A link driven through a gear
============================

One motor, one gear, one link: the smallest robot. It is in "Introduction to Robotics", session 17
(single link, single motor coupled by a drive shaft), and in ME 6102 (single link manipulator with
gear box).

The motor turns :math:`N` times for one turn of the link, :math:`\theta_m = N\theta_l`, so the two
angles are one coordinate. Session 17, where the ratio is :math:`r`, writes everything at the link,
a uniform rod of mass :math:`M` and length :math:`L` that hangs down at :math:`\theta_l = 0`:

.. math::

   T = \tfrac12 \left(N^2 J_m + J_l\right) \dot\theta_l^2, \qquad
   V = \frac{M g L}{2}\,(1 - \cos\theta_l), \qquad
   J \ddot\theta_l + B \dot\theta_l + \frac{M g L}{2} \sin\theta_l = N \tau_m

with :math:`J = N^2 J_m + J_l`. ME 6102 writes the same at the motor, with :math:`n` for the
ratio and the centre of mass at the distance :math:`l = L/2`:

.. math::

   \left(J_m + \frac{J_l}{N^2}\right) \ddot\theta_m + \left(B_m + \frac{B_l}{N^2}\right)
   \dot\theta_m + \frac{M g l}{N} \sin\frac{\theta_m}{N} = \tau_m

.. admonition:: Erratum

   Session 17 has the damping as :math:`B = N B_m + B_l`. The power that is lost must be the same
   on both sides of the gear, :math:`B \dot\theta_l^2 = B_m \dot\theta_m^2 + B_l \dot\theta_l^2`,
   so

   .. math:: B = N^2 B_m + B_l ,

   as in ME 6102, whose equation is the one above divided by :math:`N`. Three smaller slips there:
   :math:`\theta_m = r\,\theta_1` should be :math:`r\,\theta_l`; :math:`B` is called a damping
   torque, which is :math:`-B\dot\theta_l`; and :math:`J_l` is the inertia about the hinge,
   :math:`M L^2 / 3`, not about the centre of mass.

:Lectures: session 17, single link with a gear; ME 6102, single link manipulator with gear box
:Equations: 8; 9
:Shows: how a gear reflects inertia and damping, and the best ratio
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
# The rod's inertia in the URDF is about its centre of mass, :math:`M L^2 / 12 = 0.025` kg m². The
# rotor's inertia and damping are those of the motor; that they count :math:`N^2`-fold at the link
# is left to the simulator. The command of the joint is a torque *at the joint*,
# :math:`u = N \tau_m`.

print((files("arm_sim") / "scenes/lectures/geared_link.yaml").read_text())

# %%
# The run and an independent solution
# -----------------------------------
# The motor pulls with 0.1 N m for two seconds, then it is switched off.

sim = Simulator("geared_link", tolerance=1e-12)
N, pull, until, end = 20.0, 0.1, 2.0, 5.0
motor_torque = np.where(np.arange(round(end / sim.dt)) * sim.dt < until, pull, 0.0)
run = sim.run(end, N * motor_torque[:, None])

# %%
# Both equations are integrated by DOP853 of SciPy, each with the numbers of the scene in its own
# terms, one piece for each torque.

M, L, g = 1.2, 0.5, 9.81
J_m, B_m, J_l, B_l = 5e-4, 1e-4, M * L**2 / 3, 0.05
before, after = run.time[run.time <= until], run.time[run.time >= until]


def solve(J, B, weight, ratio, torque):
    """J a + B v + weight sin(x / ratio) = torque until the motor is switched off, then = 0."""

    def rates(t, x, tau):
        return [x[1], (tau - B * x[1] - weight * np.sin(x[0] / ratio)) / J]

    exact = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14}
    up = solve_ivp(rates, (0.0, until), [0, 0], t_eval=before, args=(torque,), **exact).y
    down = solve_ivp(rates, (until, end), up[:, -1], t_eval=after, args=(0.0,), **exact).y
    return np.hstack([up, down[:, 1:]])[0]


at_link = solve(N**2 * J_m + J_l, N**2 * B_m + B_l, M * g * L / 2, 1.0, N * pull)
at_motor = solve(J_m + J_l / N**2, B_m + B_l / N**2, M * g * L / 2 / N, N, pull)
misprinted = solve(N**2 * J_m + J_l, N * B_m + B_l, M * g * L / 2, 1.0, N * pull)

angle = run.q[:, 0]
for name, solution in (("session 17", at_link), ("ME 6102", at_motor / N)):
    error = np.abs(angle - solution).max()
    print(f"largest difference to {name}, corrected: {error:.1e} rad")
    assert error <= 1e-8
wrong = np.abs(angle - misprinted).max()
print(f"with the damping as printed: {wrong:.2f} rad")
assert wrong > 0.1

# %%
# In a figure
# -----------

figure, axes = plt.subplots(1, 2, figsize=(7.2, 3.0))
axes[0].plot(run.time, angle, label="simulated")
axes[0].plot(run.time, misprinted, "--", label=r"with $B = N B_m + B_l$, as printed")
axes[0].axvline(until, color="0.7", lw=0.8)
axes[0].set(xlabel="time [s]", ylabel="angle of the link [rad]", ylim=(-1.3, 2.6),
            title="Pulled up and released")  # fmt: skip
axes[0].legend()

ratios = np.linspace(1.0, 40.0, 400)
for inertia, label in ((J_m, "this rotor"), (J_m / 4, "one with a quarter of its inertia")):
    axes[1].plot(ratios, ratios * pull / (ratios**2 * inertia + J_l), label=label)
    best = np.sqrt(J_l / inertia)
    axes[1].plot(best, pull / (2 * np.sqrt(inertia * J_l)), "ko", ms=4)
axes[1].plot([], [], "ko", ms=4, label="largest")
axes[1].set(xlabel="gear ratio N", ylabel="acceleration [rad/s²]", ylim=(0, None),
            title="First acceleration under 0.1 N m")  # fmt: skip
axes[1].legend()

# %%
# In motion
# ---------
# The link, and on the left the rotor, which turns twenty times as far: in slow motion.

first = run.time <= 1.2
q = angle[first]
rod = np.stack([np.zeros((len(q), 2)), L * np.column_stack([np.sin(q), -np.cos(q)])], axis=1)
turn = np.linspace(0.0, 2 * np.pi, 61)
rotor = np.array([-0.35, 0.0]) + 0.12 * np.column_stack([np.cos(turn), np.sin(turn)])
mark = 0.12 * np.column_stack([np.sin(N * q), -np.cos(N * q)])
pointer = (
    np.stack([-mark, mark], axis=1) + np.array([-0.35, 0.0]),
    {"marker": "", "color": "C2", "label": "rotor"},
)
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    run.time[first],
    [(rod, {"label": "link"}), rotor, pointer],
    trail=(rod[:, 1], {"label": "path of its end"}),
    speed=0.2,
    title="A link and the rotor",
)
plt.show()

# %%
# Questions
# ---------
# 1. Which gear ratio accelerates the link most, for a given torque of the motor and without
#    weight? *Hint:* differentiate :math:`N \tau_m / (N^2 J_m + J_l)`; at the optimum the rotor,
#    seen at the link, is as heavy as the link itself. The dots in the figure are there.
# 2. With the same motor and twice the gear ratio, how long does the link swing after the motor
#    is switched off? *Hint:* of the time constant :math:`2 J / B` both parts change.
