# SPDX-License-Identifier: Apache-2.0
r"""
A motor behind a worm gear
==========================

A worm is a screw: unrolled, its thread is a wedge of the lead angle :math:`\lambda` that slides
under a tooth of the wheel, which bears the load :math:`W = m g`. With the friction angle
:math:`\varphi = \arctan\mu`, the motor's force :math:`F` along the thread balances the load at

.. math::

    F = W \tan(\lambda + \varphi) \text{ on the way up,} \qquad
    F = W \tan(\lambda - \varphi) \text{ on the way down,}

and nothing moves in between. A worm with :math:`\lambda < \varphi` is *self-locking*: the load
stays without a torque of the motor. Beyond these limits, with the rotor's mass
:math:`m_w = J / r^2` at the pitch radius :math:`r`,

.. math::

    \left(m_w + m \tan\lambda \tan(\lambda \pm \varphi)\right) \ddot x =
    F - W \tan(\lambda \pm \varphi) .

:Lectures: textbooks, screws and self-locking
:Equations: 19; Motor
:Shows: a gear that cannot be driven from its output
"""

import numpy as np
from matplotlib import pyplot as plt

from arm_sim import Simulator
from arm_sim.figures import animation, use_style

use_style()
mu, m, g = 0.1, 20.0, 9.81  # of steel on bronze; [kg], [m/s²]
r, J, K, thread_mass = 0.01, 2e-4, 0.05, 0.02  # [m], [kg m²], [N m/A], [kg]
phi, W, m_w = np.arctan(mu), m * g, thread_mass + J / r**2

# %%
# The scene
# ---------
# The motor turns the worm, which moves its thread by :math:`r` per radian. The tooth is a point on
# the thread, an inclined plane with friction.

BODY = '<link name="{}"><inertial><mass value="{}"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3" \
ixy="0" ixz="0" iyz="0"/></inertial></link>'
SLIDE = '<joint name="{}" type="prismatic"><parent link="base"/><child link="{}"/><axis xyz="{}"/>\
<limit lower="-9" upper="9" effort="1e4" velocity="9"/></joint>'
ROBOT = f"""<robot name="worm_gear"><link name="base"/>{BODY.format("worm", thread_mass)}
{BODY.format("tooth", m)}{SLIDE.format("thread", "worm", "1 0 0")}
{SLIDE.format("wheel", "tooth", "0 0 1")}</robot>"""


def worm_gear(lead: float) -> Simulator:
    """With a worm of a lead angle in [rad]."""
    motor = {"command": "current", "torque_constant": K, "rotor_inertia": J, "gear_ratio": 1 / r}
    plane = {"frame": "worm", "normal": [np.sin(lead), 0.0, np.cos(lead)]}
    flank = {"type": "contact", "frame": "tooth", "plane": plane, "friction": mu}
    scene = {"robot": {"urdf": ROBOT}, "joints": {"thread": {"actuator": motor}}}
    return Simulator(scene | {"constraints": [flank]})


# %%
# The run and its closed form
# ---------------------------
# The motor lifts with a tenth more than it needs, is switched off, and turns back. The first worm
# holds the load; the second, whose lead angle is larger than :math:`\varphi` = 5.7°, runs back as
# soon as the motor is off.

PHASES = (0.3, 0.45, 0.6)  # ends, in [s]


def closed_form(time: np.ndarray, lead: float, forces: tuple[float, ...]) -> np.ndarray:
    """Positions of the thread in [m], from phase to phase and from stop to stop."""
    up, down = np.tan(lead + phi), np.tan(lead - phi)
    found, t, x, v = np.zeros(len(time)), 0.0, 0.0, 0.0
    for end, F in zip(PHASES, forces, strict=True):
        while t < end:
            tangent = up if v > 0.0 or (v == 0.0 and F > W * up) else down
            rests = v == 0.0 and W * down <= F <= W * up
            a = 0.0 if rests else (F - W * tangent) / (m_w + m * np.tan(lead) * tangent)
            length = min(end - t, -v / a if v * a < 0.0 else np.inf)
            now = (time >= t) & (time <= t + length + 1e-12)
            found[now] = x + v * (time[now] - t) + a * (time[now] - t) ** 2 / 2
            x, v, t = x + v * length + a * length**2 / 2, v + a * length, t + length
            v = 0.0 if abs(v) < 1e-12 else v
    return found


runs, closed = {}, {}
for degrees in (4.0, 8.0):
    lead = np.radians(degrees)
    forces = 1.1 * W * np.tan(lead + phi), 0.0, -0.2 * W * np.tan(lead + phi)
    sim = worm_gear(lead)
    when = np.searchsorted(PHASES, np.arange(round(PHASES[-1] / sim.dt)) * sim.dt, "right")
    current = np.array(forces)[when] * r / K
    runs[degrees] = run = sim.run(PHASES[-1], np.stack([current, 0 * current], axis=1))
    closed[degrees] = exact = closed_form(run.time, lead, forces)
    error = np.abs(run.q[:, 0] - exact).max()
    print(f"lead angle {degrees:g}°: at most {current.max():.1f} A, off by {error:.1e} m")
    assert error <= 1e-8
holding = (runs[4.0].time > 0.35) & (runs[4.0].time < PHASES[1])
assert np.ptp(runs[4.0].q[holding], axis=0).max() == 0.0  # to the bit

# %%
# In a figure
# -----------
# On the right, the forces that lift and lower a load: below the friction angle the motor has to
# push the load down.

figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 3.0))
for degrees, run in runs.items():
    left.plot(run.time, 1e3 * run.q[:, 1], label=f"lead angle {degrees:g}°")
for degrees, exact in closed.items():
    height = 1e3 * exact[::30] * np.tan(np.radians(degrees))
    left.plot(run.time[::30], height, "k.", ms=5, label="closed form" if degrees > 4.0 else "")
left.set(xlabel="time [s]", ylabel="height of the load [mm]", title="Lift, switch off, turn back")
left.legend()
angles = np.radians(np.linspace(0.0, 20.0, 200))
right.plot(np.degrees(angles), np.tan(angles + phi), label="lifts")
right.plot(np.degrees(angles), np.tan(angles - phi), label="lowers")
right.axvspan(0.0, np.degrees(phi), color="0.87", zorder=0, label="self-locking")
right.axhline(0.0, color="0.6", linewidth=0.8)
right.set(xlabel="lead angle [°]", ylabel="force of the motor / load", xlim=(0.0, 20.0),
          title="Force along the thread")  # fmt: skip
right.legend(loc="lower right")

# %%
# In motion
# ---------
# The thread with its unrolled flank, and the tooth that bears the load.

run, lead = runs[8.0], np.radians(8.0)
x, z = run.q.T
high = 0.3 * np.tan(lead)
corners = np.array([[-0.3, high], [-0.3, -0.1], [0.3, -0.1], [0.3, -high], [-0.3, high]])
wedge = corners + np.stack([x, 0.0 * x], axis=1)[:, None]
tip = np.array([[0.0, 0.0], [0.03, 0.08], [-0.03, 0.08], [0.0, 0.0]])
tooth = tip + np.stack([0.0 * z, z], axis=1)[:, None]
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    run.time,
    [(wedge, {"marker": "", "label": "thread"}),
     (tooth, {"marker": "", "color": "C1", "label": "tooth"})],
    speed=0.3,
    size=(4.4, 3.0),
    title="Lead angle 8°",
)  # fmt: skip
plt.show()

# %%
# Questions
# ---------
# 1. What is the efficiency of a worm that is just self-locking? *Hint:* compare
#    :math:`W \tan\lambda` with the force that lifts, at :math:`\lambda = \varphi`: it is less than
#    one half.
# 2. The ``efficiency`` of a gear (:doc:`drives </concepts/drives>`) never locks it. Why? *Hint:*
#    it loses the same share of the power in both directions.
