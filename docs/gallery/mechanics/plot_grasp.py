# SPDX-License-Identifier: Apache-2.0
r"""
A grasp held by friction
========================

Two fingers press on the sides of a box of mass :math:`m` with a force :math:`F` each. Friction
bears at most :math:`\mu F` at each finger, so the gripper lifts the box with an acceleration
:math:`a` if

.. math::

    F \ge F_{\min} = \frac{m (g + a)}{2 \mu} .

With less, the box slides down in the gripper by

.. math::

    s = \left(g + a - \frac{2 \mu F}{m}\right) \frac{t^2}{2} .

:Lectures: textbooks, grasps
:Equations: 19
:Shows: the smallest force that holds a box, and how it slides with less
"""

import numpy as np
from matplotlib import pyplot as plt

from arm_dynamics import load_scene
from arm_sim import Simulator
from arm_sim.figures import animation, use_style

use_style()

# %%
# The scene
# ---------
# The fingertips are balls, the sides of the box planes that move with it. The motors of the scene
# ``lifting_gripper`` are left out: commands are forces.

ready = load_scene("lifting_gripper").model_dump(exclude_unset=True)
sim = Simulator(ready | {"joints": {}})
lift, box, left, right = map(sim.joint_names.index, ("lift", "box_height", "left", "right"))
m, hand_mass, mu, g = 0.3, 0.66, 0.5, 9.81  # [kg], [m/s²]
closed = np.zeros(sim.n)
closed[[left, right]] = 0.025  # [m], half the box and the radius of the tips
closed[[lift, box]] = 0.15  # above the ground

# %%
# The run and its closed form
# ---------------------------
# The gripper stays where it is, or lifts with 2 m/s², for 0.15 s with several forces of the
# fingers. The box stays in the gripper to rounding, or slides by the formula.


def grasp(force: float, a: float, duration: float = 0.15):
    """Lift with an acceleration in [m/s²] and forces of the fingers in [N]."""
    tau = np.zeros(sim.n)
    carried = min(m * (g + a), 2 * mu * force)
    tau[lift], tau[left], tau[right] = hand_mass * (g + a) + carried, -force, -force
    sim.reset(closed)
    return sim.run(duration, tau)


least = {a: m * (g + a) / (2 * mu) for a in (0.0, 2.0)}  # [N]
forces, slides, worst = {}, {}, 0.0
for a in least:
    forces[a] = least[a] * np.array([0.2, 0.4, 0.6, 0.8, 0.95, 0.999, 1.001, 1.2])
    slides[a] = []
    for force in forces[a]:
        run = grasp(force, a)
        slide = run.q[:, lift] - run.q[:, box]
        formula = max(0.0, g + a - 2 * mu * force / m) * run.time**2 / 2
        worst = max(worst, np.abs(slide - formula).max())
        slides[a].append(slide[-1])
    print(f"a = {a:g} m/s²: held with {forces[a][-2]:.4f} N, not with {forces[a][-3]:.4f} N")
    assert abs(slides[a][-2]) < 1e-12 < slides[a][-3]
print(f"largest difference: {worst:.1e} m")
assert worst <= 1e-8

# %%
# In a figure
# -----------

figure, (slips, falls) = plt.subplots(1, 2, figsize=(7.2, 3.0))
for a in least:
    every = np.linspace(0.0, 1.2 * least[a], 200)
    formula = np.maximum(0.0, g + a - 2 * mu * every / m) * 0.15**2 / 2
    slips.plot(every, 1e3 * formula, label=f"lifted with {a:g} m/s²" if a else "held still")
for a in least:
    slips.plot(forces[a], 1e3 * np.array(slides[a]), "k.", label="" if a else "simulated")
slips.set(xlabel="force of a finger [N]", ylabel="sliding after 0.15 s [mm]",
          title="Sliding in the gripper")  # fmt: skip
slips.legend()
for share in (0.9, 1.1):
    run = grasp(share * least[a], a)
    falls.plot(run.time, 1e3 * run.q[:, box], label=f"box, {share:g} $F_{{\\min}}$")
falls.plot(run.time, 1e3 * run.q[:, lift], "k:", label="gripper")
falls.set(xlabel="time [s]", ylabel="height [mm]", title="Lifted with 2 m/s²")
falls.legend()

# %%
# In motion
# ---------
# With a tenth less than the smallest force.

run = grasp(0.9 * least[a], a)
height, up = run.q[:, box], run.q[:, lift]


def moved(points: list, by: np.ndarray) -> np.ndarray:
    """Points at heights."""
    return np.array(points) + np.stack([0.0 * by, by], axis=1)[:, None]


side = 0.02
square = [[-side, -side], [side, -side], [side, side], [-side, side], [-side, -side]]
gripper = [[-0.025, 0.0], [-0.025, 0.06], [0.025, 0.06], [0.025, 0.0]]
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    run.time,
    [(moved(square, height), {"marker": "", "color": "C1", "label": "box"}),
     (moved(gripper, up), {"label": "gripper"})],
    speed=0.1, axes="yz",
)  # fmt: skip
plt.show()

# %%
# Questions
# ---------
# 1. By which factor does the smallest force grow if the fingers press on the edges of a wedge with
#    an opening angle of 20°? *Hint:* the normal force has a component along gravity, too.
# 2. Why does a gripper squeeze a cup of unknown weight until it no longer slides, and not more?
#    *Hint:* :math:`F_{\min}` is proportional to the mass.
