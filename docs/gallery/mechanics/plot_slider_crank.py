# SPDX-License-Identifier: Apache-2.0
r"""
Slider-crank under constant torque
==================================

*Design of Mechatronic Systems* (ME 6102) asks: "for constant torque what would be time evolution
of position", and leaves the equations to Lagrange. With the crank :math:`r` at the angle
:math:`\theta`, the rod :math:`l` at :math:`\varphi` below the horizontal and the slider at
:math:`x`, the chain is closed where

.. math::

    \sin\varphi = \frac{r}{l} \sin\theta, \qquad x = r \cos\theta + l \cos\varphi,

so there is one degree of freedom. With the positions of the centres of mass as functions of
:math:`\theta`, and :math:`' = d/d\theta`, the kinetic energy is
:math:`\tfrac12 J(\theta)\, \dot\theta^2`,

.. math::

    J(\theta) = I_c + m_r \left(x_r'^2 + z_r'^2\right) + I_r\, \varphi'^2 + m_s\, x'^2, \qquad
    V(\theta) = m_c g\, z_c + m_r g\, z_r,

and Lagrange's equation becomes

.. math::

    J\, \ddot\theta + \tfrac12 J'\, \dot\theta^2 + V' = \tau .

A constant torque has the potential :math:`-\tau\theta`. So the speed at every angle is known
without solving the equation: :math:`\tfrac12 J \dot\theta^2 + V - \tau\theta` does not change.

:Lectures: ME 6102, "for constant torque what would be time evolution of position"
:Equations: 18
:Shows: a closed chain without drift, against one equation in one angle
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
# Crank and rod are slender rods. The scene describes an open chain and a pin that closes it; the
# simulator never sees the equations above.

print((files("arm_sim") / "scenes/slider_crank.yaml").read_text())
r, l, g = 0.15, 0.4, 9.81
m_c, m_r, m_s = 0.5, 0.8, 1.0
I_c, I_r = m_c * r**2 / 3, m_r * l**2 / 12  # about the pivot; about its centre

# %%
# The run
# -------

tau = 1.5  # [N m]
sim = Simulator("slider_crank", dt=2e-3, tolerance=1e-12)
pivot, rail = sim.joint_names.index("pivot"), sim.joint_names.index("rail")
run = sim.run(1.0, tau * np.eye(sim.n)[pivot])
angle, speed = run.q[:, pivot], run.v[:, pivot]
print(f"{(angle[-1] - angle[0]) / (2.0 * np.pi):.1f} turns in 1 s")

# %%
# The independent solution
# ------------------------


def of_angle(theta: np.ndarray) -> tuple[np.ndarray, ...]:
    """The angle of the rod, and its first and second derivative by the angle of the crank."""
    s, c = np.sin(theta), np.cos(theta)
    phi = np.arcsin(r / l * s)
    first = r / l * c / np.cos(phi)
    second = -r / l * s / np.cos(phi) + np.tan(phi) * first**2
    return phi, first, second


def terms(theta: np.ndarray) -> tuple[np.ndarray, ...]:
    """J, half its derivative, V and its derivative."""
    s, c = np.sin(theta), np.cos(theta)
    phi, p1, p2 = of_angle(theta)
    dx_r, ddx_r = (
        -r * s - l / 2 * np.sin(phi) * p1,
        -r * c - l / 2 * (np.cos(phi) * p1**2 + np.sin(phi) * p2),
    )
    dz_r, ddz_r = r / 2 * c, -r / 2 * s  # the middle of the rod is half as high as the crank pin
    dx, ddx = -r * s - l * np.sin(phi) * p1, -r * c - l * (np.cos(phi) * p1**2 + np.sin(phi) * p2)
    J = I_c + m_r * (dx_r**2 + dz_r**2) + I_r * p1**2 + m_s * dx**2
    half = m_r * (dx_r * ddx_r + dz_r * ddz_r) + I_r * p1 * p2 + m_s * dx * ddx
    lift = (m_c + m_r) * g * r / 2
    return J, half, lift * s, lift * c


def rates(time: float, x: np.ndarray) -> list[float]:
    """Rates of the crank's angle and speed."""
    J, half, _, slope = terms(x[0])
    return [x[1], (tau - half * x[1] ** 2 - slope) / J]


reference = solve_ivp(
    rates, (0.0, 1.0), [angle[0], 0.0], method="DOP853", rtol=1e-13, atol=1e-14, t_eval=run.time
)
error = np.abs(angle - reference.y[0]).max()
slider = np.abs(run.q[:, rail] - r * np.cos(angle) - l * np.cos(of_angle(angle)[0])).max()
J, _, V, _ = terms(angle)
kept = 0.5 * J * speed**2 + V - tau * angle
print(f"largest difference: {error:.1e} rad; slider off its place by {slider:.1e} m")
print(f"the constant changes by {np.ptp(kept):.1e} J")
assert error <= 1e-8 and slider <= 1e-10 and np.ptp(kept) <= 1e-8

# %%
# In a figure
# -----------
# The speed grows with the square root of the angle, and is modulated twice a turn: where the
# slider is fast, the mechanism is heavy.

figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 2.9))
left.plot(run.time, angle / (2.0 * np.pi))
left.set(xlabel="time [s]", title="Position under 1.5 N m")
left.set_ylabel("turns of the crank", color="C0")
other = left.twinx()
other.grid(False)
other.spines["right"].set_visible(True)
other.set_ylabel("slider [m]", color="C1")
other.plot(run.time, run.q[:, rail], color="C1")
turns = angle / (2.0 * np.pi)
right.plot(turns, speed, label="run")
mean = np.sum(0.5 * (J[1:] + J[:-1]) * np.diff(angle)) / np.ptp(angle)  # over the angle
smooth = np.sqrt(2.0 * tau * (angle - angle[0]) / mean)
right.plot(turns, smooth, "--", label="with the mean inertia")
right.set(xlabel="turns of the crank", ylabel="speed [rad/s]", title="Speed")
right.legend()

# %%
# In motion
# ---------
# Slowed down four times.

pin = r * np.stack([np.cos(angle), np.sin(angle)], axis=1)
end = np.stack([run.q[:, rail], 0.0 * angle], axis=1)
chain = np.stack([0.0 * pin, pin, end], axis=1)
block = np.array([[-0.04, -0.03], [0.04, -0.03], [0.04, 0.03], [-0.04, 0.03], [-0.04, -0.03]])
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    run.time,
    [
        np.array([[0.2, -0.03], [0.6, -0.03]]),
        (
            block + end[:, None],
            {"color": "0.3", "marker": "", "linewidth": 1.5, "label": "slider"},
        ),
        (chain, {"label": "crank and rod"}),
    ],
    speed=0.25,
    size=(5.5, 3.5),
)
plt.show()

# %%
# Questions
# ---------
# 1. Which least torque turns the crank all the way round from rest at the bottom? *Hint:* look for
#    the smallest :math:`\tau` for which :math:`V - \tau\theta` has no way back.
# 2. A connecting rod is often replaced by two point masses at its ends. How wrong is :math:`J`
#    then? *Hint:* with a sixth of the rod's mass at each end and the rest in the middle it would
#    be right.
