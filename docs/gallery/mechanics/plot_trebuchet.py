# SPDX-License-Identifier: Apache-2.0
r"""
Trebuchet
=========

A heavy weight :math:`m_1` falls and, through a beam and a sling, throws a light stone
:math:`m_2`: example 2 of *Applied Dynamics* (HCMUTE, chapter 8). The beam is weightless, with arms
:math:`b` and :math:`a`; the weight hangs on a rod :math:`c`, the stone in a sling :math:`l`. The
coordinates are the angle :math:`\theta` of the beam from upright, and the angles :math:`\gamma`
and :math:`\alpha` of rod and sling to the beam. Corrected, the positions are

.. math::

    x_1 &= b \sin\theta - c \sin(\theta + \gamma), \qquad &
    y_1 &= -b \cos\theta + c \cos(\theta + \gamma), \\
    x_2 &= -a \sin\theta - l \sin(\alpha - \theta), \qquad &
    y_2 &= +a \cos\theta - l \cos(\alpha - \theta),

and the energies

.. math::

    T &= \tfrac12 m_1 \left((b^2 + c^2)\, \dot\theta^2 + c^2 \dot\gamma^2
        + 2 c^2 \dot\theta \dot\gamma \right)
        - m_1 b c\, \dot\theta (\dot\theta + \dot\gamma) \cos\gamma \\
      &+ \tfrac12 m_2 \left((a^2 + l^2)\, \dot\theta^2 + l^2 \dot\alpha^2
        - 2 l^2 \dot\theta \dot\alpha \right)
        - m_2 a l\, \dot\theta (\dot\theta - \dot\alpha) \cos\alpha, \\
    V &= m_1 g\, y_1 + m_2 g\, y_2 .

.. admonition:: Errata

    * :math:`y_2 = -a\cos\theta - \dots` would put both ends of the beam on the same side of the
      pivot: the beam would have to be bent. Correct is :math:`+a\cos\theta`. The sign goes on
      into :math:`\dot y_2`, whose first term is :math:`-a\dot\theta\sin\theta`, into :math:`V`,
      and into :math:`T`, where :math:`\cos(2\theta - \alpha)` becomes :math:`\cos\alpha`.
    * :math:`\dot y_1` ends with :math:`\sin(\theta + \gamma)`, not :math:`\cos(\theta + \gamma)`.
    * :math:`\dot x_2 = l\,(c - \dot\alpha) \cos(\alpha - \theta) - \dots` has a length :math:`c`
      where :math:`\dot\theta` belongs.
    * The third of Lagrange's equations differentiates by :math:`\gamma`, not by :math:`y`.

The sling lets go when it has swung far enough. That is the end of these equations: the stone flies
off as a point mass.

:Lectures: HCMUTE, example 2
:Equations: 1; 4; 18
:Shows: a throw by a falling weight, and the equations as they should be printed
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
# In the simulator the stone is a free body, and the sling a constraint that keeps its distance
# from the end of the beam. It can be switched off. The beam has a moment of inertia, :math:`J`,
# which adds :math:`\tfrac12 J \dot\theta^2` to :math:`T`: without the stone, a weightless beam in
# line with the rod of the weight would have no inertia at all, and no definite acceleration.

print((files("arm_sim") / "scenes/lectures/trebuchet.yaml").read_text())

# %%
# The run
# -------
# A first run shows when the sling has swung to 150 degrees; the second lets go there, and follows
# the stone to the ground, 1 m below the pivot.

m1, m2, a, b, c, l, g = 60.0, 1.0, 1.0, 0.25, 0.5, 0.9, 9.81
J = 0.3  # [kg m²]
sim = Simulator("trebuchet", dt=1e-3, tolerance=1e-12)
theta_at, gamma_at, x_at, z_at = (
    sim.joint_names.index(name) for name in ("theta", "gamma", "stone_x", "stone_z")
)


def sling(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The angle of the sling to the beam, and the end of the beam, for positions q."""
    end = a * np.stack([-np.sin(q[:, theta_at]), np.cos(q[:, theta_at])], axis=1)
    along = end - q[:, [x_at, z_at]]
    return np.unwrap(q[:, theta_at] + np.arctan2(along[:, 0], along[:, 1])), end


swing = sim.run(0.6)
ticks = int(np.argmax(sling(swing.q)[0] > np.deg2rad(150.0)))
sim.reset()
throw = sim.run(ticks * sim.dt)
sim.set_constraint("sling", False)
flight = sim.run(4.0)
landing = int(np.argmax(flight.q[:, z_at] < -1.0))
reach = flight.q[landing, x_at]
leaves = throw.v[-1, [x_at, z_at]]
print(f"the sling lets go after {throw.time[-1]:.3f} s, at {np.hypot(*leaves):.1f} m/s and")
print(f"{np.degrees(np.arctan2(*leaves[::-1])):.0f}° upwards; the stone flies {reach:.1f} m")
assert throw.multipliers[:, 0].min() > 0.0  # a sling can only pull

# %%
# The independent solution
# ------------------------
# Lagrange's equations of the corrected energies, in :math:`(\theta, \alpha, \gamma)` and without
# any constraint, then a parabola.


def rates(time: float, x: np.ndarray) -> np.ndarray:
    """Rates of the angles (theta, alpha, gamma) and their speeds."""
    theta, alpha, gamma, d_theta, d_alpha, d_gamma = x
    ca, sa, cg, sg = np.cos(alpha), np.sin(alpha), np.cos(gamma), np.sin(gamma)
    M = np.array([
        [J + m1 * (b**2 + c**2 - 2 * b * c * cg) + m2 * (a**2 + l**2 - 2 * a * l * ca),
         m2 * l * (a * ca - l), m1 * c * (c - b * cg)],
        [m2 * l * (a * ca - l), m2 * l**2, 0.0],
        [m1 * c * (c - b * cg), 0.0, m1 * c**2],
    ])  # fmt: skip
    coriolis = np.array(
        [
            m1 * b * c * sg * d_gamma * (2 * d_theta + d_gamma)
            + m2 * a * l * sa * d_alpha * (2 * d_theta - d_alpha),
            -m2 * a * l * sa * d_theta**2,
            -m1 * b * c * sg * d_theta**2,
        ]
    )
    weight = g * np.array(
        [
            m1 * (b * np.sin(theta) - c * np.sin(theta + gamma))
            - m2 * (a * np.sin(theta) + l * np.sin(alpha - theta)),
            m2 * l * np.sin(alpha - theta),
            -m1 * c * np.sin(theta + gamma),
        ]
    )
    return np.concatenate([x[3:], np.linalg.solve(M, -coriolis - weight)])


start = np.deg2rad([150.0, 60.0, 30.0, 0.0, 0.0, 0.0])
theta, alpha, gamma, d_theta, d_alpha, d_gamma = solve_ivp(
    rates, (0.0, throw.time[-1]), start, method="DOP853", rtol=1e-13, atol=1e-14, t_eval=throw.time
).y
x2 = -a * np.sin(theta) - l * np.sin(alpha - theta)
y2 = a * np.cos(theta) - l * np.cos(alpha - theta)
error = np.abs(throw.q[:, [theta_at, gamma_at, x_at, z_at]].T - [theta, gamma, x2, y2]).max()
print(f"largest difference until the release: {error:.1e}")
assert error <= 1e-8

dx2 = l * (d_theta - d_alpha) * np.cos(alpha - theta) - a * d_theta * np.cos(theta)
dy2 = -a * d_theta * np.sin(theta) - l * (d_theta - d_alpha) * np.sin(alpha - theta)
t = flight.time - flight.time[0]
fly = np.stack([x2[-1] + dx2[-1] * t, y2[-1] + dy2[-1] * t - 0.5 * g * t**2], axis=1)
error = np.abs(flight.q[:, [x_at, z_at]] - fly).max()
print(f"in flight: {error:.1e} m")
assert error <= 1e-8

# %%
# The kinetic energy of the run decides about the errata in :math:`T` and :math:`\dot y_1`.

of_beam = 0.5 * J * d_theta**2
of_weight = b**2 * d_theta**2 + c**2 * (d_theta + d_gamma) ** 2
of_weight -= 2.0 * b * c * d_theta * (d_theta + d_gamma) * np.cos(gamma)
of_weight *= 0.5 * m1
of_stone = 0.5 * m2 * (a**2 * d_theta**2 + l**2 * (d_theta - d_alpha) ** 2)
lever = m2 * a * l * d_theta * (d_theta - d_alpha)
corrected = of_beam + of_weight + of_stone - lever * np.cos(alpha)
printed = of_beam + of_weight + of_stone - lever * np.cos(2 * theta - alpha)
dx1 = b * d_theta * np.cos(theta) - c * (d_theta + d_gamma) * np.cos(theta + gamma)
dy1 = [
    b * d_theta * np.sin(theta) - c * (d_theta + d_gamma) * of_sum(theta + gamma)
    for of_sum in (np.sin, np.cos)
]
off = [np.abs(T - throw.kinetic).max() for T in (corrected, printed)]
off += [np.abs(0.5 * m1 * (dx1**2 + each**2) - of_weight).max() for each in dy1]
print("off in T:   corrected {:.1e} J, printed {:.1e} J".format(*off[:2]))
print("off in dy1: corrected {:.1e} J, printed {:.1e} J".format(*off[2:]))
assert max(off[0], off[2]) <= 1e-8 and min(off[1], off[3]) > 1.0

# %%
# And the sum of the energies decides about :math:`y_2` in :math:`V`: nothing is lost, so it must
# not change.

y1 = -b * np.cos(theta) + c * np.cos(theta + gamma)
for name, sign in (("corrected", +1.0), ("printed", -1.0)):
    high = sign * a * np.cos(theta) - l * np.cos(alpha - theta)
    change = np.ptp(corrected + m1 * g * y1 + m2 * g * high)
    print(f"the energy changes by {change:.1e} J with y2 as {name}")
    assert change <= 1e-8 if sign > 0.0 else change > 1.0

# %%
# In a figure
# -----------
# Most of what the weight loses ends up in the stone: the weight is nearly at rest when the sling
# lets go.

figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 2.9), width_ratios=(2, 1))
left.plot(*throw.q[:, [x_at, z_at]].T, color="C1", label="in the sling")
left.plot(*flight.q[: landing + 1, [x_at, z_at]].T, label="in flight")
left.set(xlabel="x [m]", ylabel="z [m]", aspect="equal", title=f"The throw: {reach:.1f} m")
left.legend(loc="lower center")
right.plot(throw.time, of_weight, label="weight")
right.plot(throw.time, corrected - of_weight - of_beam, label="stone")
right.plot(throw.time, of_beam, label="beam")
right.set(xlabel="time [s]", ylabel="kinetic energy [J]", title="Until release")
right.legend()

# %%
# In motion
# ---------
# Slowed down six times. What is not drawn at the end is the sling, which has been released.

after = flight.q[1:180]
q = np.vstack([throw.q, after])
time = np.concatenate([throw.time, flight.time[1:180]])
end = sling(q)[1]
short = -b / a * end
turn = q[:, theta_at] + q[:, gamma_at]
weight = short + c * np.stack([-np.sin(turn), np.cos(turn)], axis=1)
stone = q[:, [x_at, z_at]]
rope = np.stack([end, stone], axis=1)
rope[len(throw.q) :] = np.nan
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    time,
    [
        np.array([[-0.4, -1.0], [0.0, 0.0], [0.4, -1.0]]),
        (rope, {"color": "0.3", "linewidth": 1.0, "marker": ""}),
        (np.stack([end, short, weight], axis=1), {"label": "beam"}),
        (weight[:, None], {"markersize": 12, "color": "0.3", "label": "weight"}),
        (stone[:, None], {"color": "C1", "label": "stone, and its path"}),
    ],
    trail=stone,
    speed=1.0 / 6.0,
    size=(5.5, 5.0),
)
plt.show()

# %%
# Questions
# ---------
# 1. At which angle must the sling be released for the farthest throw? *Hint:* repeat the throw
#    for angles from 120 to 170 degrees; the best is not the one of the greatest speed.
# 2. How far would the stone fly at best if it got all the energy of the weight? *Hint:* a point
#    mass with the energy :math:`E` reaches :math:`2E/(m_2 g)`. The ratio is the trebuchet's range
#    efficiency.
