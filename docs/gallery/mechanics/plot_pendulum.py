# SPDX-License-Identifier: Apache-2.0
r"""
Pendulum
========

A point mass :math:`m` on a weightless rod of length :math:`l` swings without friction. It is the
smallest mechanism whose equation of motion is not linear, and one of the few that has a solution
in closed form.

With the angle :math:`\theta` from the hanging position, the kinetic and potential energies are

.. math::

    T = \tfrac12 m l^2 \dot\theta^2, \qquad V = -m g l \cos\theta,

and Lagrange's equation :math:`\frac{d}{dt}\frac{\partial L}{\partial\dot\theta} -
\frac{\partial L}{\partial\theta} = 0` gives

.. math::

    \ddot\theta + \omega_0^2 \sin\theta = 0, \qquad \omega_0 = \sqrt{g / l}.

Released at rest from the angle :math:`\theta_0`, the pendulum moves by Jacobi's elliptic functions
with the modulus :math:`k = \sin(\theta_0/2)` (Whittaker, *Analytical Dynamics*, section 44),

.. math::

    \sin\frac{\theta}{2} = k \, \mathrm{cd}(\omega_0 t \mid k^2), \qquad
    \tau = \frac{4}{\omega_0} K(k^2),

so the period :math:`\tau` grows with the amplitude; :math:`2\pi/\omega_0` holds for small swings
only.

:Lectures: textbooks, Whittaker, *Analytical Dynamics*, section 44
:Equations: 1; 10
:Shows: large swings against Jacobi's elliptic functions
"""

from importlib.resources import files

import numpy as np
from matplotlib import pyplot as plt
from scipy.special import ellipj, ellipk  # pip install ".[gallery]"

from arm_sim import Simulator
from arm_sim.figures import animation, use_style

use_style()

# %%
# The scene
# ---------
# The mass is 1 kg, the rod 1 m long. The robot description has one joint, ``swing``.

print((files("arm_sim") / "scenes/pendulum.yaml").read_text())

# %%
# The run and the closed form
# ---------------------------
# The pendulum is released at rest from 170 degrees, almost upright, where a linear model would be
# far off. The integrator controls its own error.

start = np.deg2rad(170.0)
sim = Simulator("pendulum", dt=0.01, tolerance=1e-12)
sim.reset(q=[start])
run = sim.run(6.0)

pace = np.sqrt(9.81 / 1.0)  # [rad/s]
k = np.sin(start / 2.0)
sn, cn, dn, _ = ellipj(pace * run.time, k**2)
exact = 2.0 * np.arcsin(k * cn / dn)  # cd = cn / dn

error = np.abs(run.q[:, 0] - exact).max()
print(f"largest difference: {error:.1e} rad")
assert error <= 1e-8

# %%
# In a figure
# -----------
# The period against the amplitude: measured in runs as four times the time to the lowest point,
# and by the elliptic integral.

amplitudes = np.deg2rad([10.0, 45.0, 90.0, 135.0, 160.0, 170.0, 175.0])
periods = []
for amplitude in amplitudes:
    sim.reset(q=[amplitude])
    swing = sim.run(3.0)
    after = int(np.argmax(swing.q[:, 0] < 0.0))  # the first step below
    before = after - 1
    share = swing.q[before, 0] / (swing.q[before, 0] - swing.q[after, 0])
    periods.append(4.0 * (before + share) * sim.dt)

figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 2.9))
left.plot(run.time, np.degrees(run.q[:, 0]), label="run")
left.plot(run.time, np.degrees(start * np.cos(pace * run.time)), "--", label="small swings")
left.set(xlabel="time [s]", ylabel="angle [°]", title="Released from 170°", ylim=(-190, 270))
left.set_yticks([-180, -90, 0, 90, 180])
left.legend(loc="upper left", ncols=2)
every = np.linspace(0.01, np.deg2rad(177.0), 200)
exact = 4.0 / pace * ellipk(np.sin(every / 2.0) ** 2)
right.plot(np.degrees(every), exact, color="0.6", label="elliptic integral")
right.plot(np.degrees(amplitudes), periods, "C0o", label="runs")
right.axhline(2.0 * np.pi / pace, color="C1", ls="--", label=r"small swings, $2\pi/\omega_0$")
right.set(xlabel="amplitude [°]", ylabel="period [s]", title="Period")
right.legend()

# %%
# In motion
# ---------

bob = np.stack([np.sin(run.q[:, 0]), -np.cos(run.q[:, 0])], axis=1)  # [m]
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    run.time,
    [(np.stack([0.0 * bob, bob], axis=1), {"label": "pendulum"})],
    trail=(bob, {"label": "path of the mass"}),
)
plt.show()

# %%
# Questions
# ---------
# 1. From which amplitude on is the period longer than :math:`2\pi/\omega_0` by one percent?
#    *Hint:* read it from the elliptic integral, and compare with the series
#    :math:`1 + \theta_0^2/16`.
# 2. Start the pendulum at the bottom with a speed of 6.5 rad/s. Why does it not turn back, and
#    what is the least speed for this? *Hint:* compare :math:`\tfrac12 m l^2 \dot\theta^2` with
#    :math:`2 m g l`.
