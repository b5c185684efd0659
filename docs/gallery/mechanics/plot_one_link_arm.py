# SPDX-License-Identifier: Apache-2.0
r"""
One-link arm with friction
==========================

A motor turns a link, with viscous friction :math:`c\dot\theta` in the joint: example 1 of *Applied
Dynamics* (HCMUTE, chapter 8). The link has the mass :math:`m`, the moment of inertia :math:`I_C`
about its centre of mass, and that centre at a distance :math:`l` from the joint. The notes give

.. math::

    T = \tfrac12 I \dot\theta^2 = \tfrac12 (I_C + m l^2)\, \dot\theta^2, \qquad
    V = -m g \cos\theta,

.. math::

    Q = I \ddot\theta + c \dot\theta + m g l \sin\theta .

.. admonition:: Erratum

    The potential energy lacks the length, and the Lagrangian with it:
    :math:`V = -m g l \cos\theta`. Only this gives the equation of motion that follows, which is
    correct.

:Lectures: HCMUTE, example 1
:Equations: 1; 8; 10
:Shows: a motor lifts a link; where its work goes
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

print((files("arm_sim") / "scenes/lectures/one_link_arm.yaml").read_text())

# %%
# The run and an independent solution
# -----------------------------------
# The motor lifts the hanging arm with a constant torque, two thirds of what would hold it
# horizontal.

m, l, g, c = 1.5, 0.3, 9.81, 0.25
I = 0.02 + m * l**2
Q = 3.0  # [N m]; m g l = 4.41 N m

sim = Simulator("one_link_arm", dt=0.01, tolerance=1e-12)
run = sim.run(5.0, [Q])


def rates(time: float, x: np.ndarray) -> list[float]:
    """Rates of angle and speed."""
    return [x[1], (Q - c * x[1] - m * g * l * np.sin(x[0])) / I]


reference = solve_ivp(
    rates, (0.0, 5.0), [0.0, 0.0], method="DOP853", rtol=1e-13, atol=1e-14, t_eval=run.time
)
error = np.abs(run.q[:, 0] - reference.y[0]).max()
print(f"largest difference: {error:.1e} rad")
assert error <= 1e-8

# %%
# The energy decides about the erratum. With the corrected potential energy the sum of the
# energies grows by exactly what the motor puts in, :math:`Q\theta`, less the heat of the friction,
# :math:`\int c\dot\theta^2 dt`; with the printed one it does not.

angle, speed = run.q[:, 0], run.v[:, 0]
T = 0.5 * I * speed**2
put_in = Q * angle - run.lost
left_over = {
    name: np.abs(T + V - (T + V)[0] - put_in).max()
    for name, V in (("corrected", -m * g * l * np.cos(angle)), ("printed", -m * g * np.cos(angle)))
}
print({name: f"{value:.1e} J" for name, value in left_over.items()})
assert left_over["corrected"] <= 1e-8 and left_over["printed"] > 1.0

# %%
# In a figure
# -----------
# Friction lets the swings die out; the arm comes to rest where :math:`Q = m g l \sin\theta`.

figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 2.9))
left.plot(run.time, np.degrees(angle), label="run")
level = np.degrees(np.arcsin(Q / (m * g * l)))
left.axhline(level, color="0.5", linestyle=":", label="static equilibrium")
left.legend()
left.set(xlabel="time [s]", ylabel="angle [°]", title="Lifted by 3 N m")
right.plot(run.time, Q * angle, label="work of the motor")
right.plot(run.time, run.lost, label="heat of the friction")
right.plot(run.time, T - m * g * l * (np.cos(angle) - 1.0), label="energy of the arm")
right.set(xlabel="time [s]", ylabel="energy [J]", title="Where the energy goes")
right.legend()

# %%
# In motion
# ---------

end = 2.0 * l * np.stack([np.sin(angle), -np.cos(angle)], axis=1)
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    run.time,
    [(np.stack([0.0 * end, end], axis=1), {"label": "link"})],
    trail=(end, {"label": "path of its end"}),
)
plt.show()

# %%
# Questions
# ---------
# 1. Which constant torque takes the arm over the top? *Hint:* without friction it is
#    :math:`0.725\, m g l`: why is that less than :math:`m g l`?
# 2. Which constant :math:`c` lets the arm come to rest soonest without overshoot? *Hint:*
#    linearize about the place of rest; critical damping is :math:`c = 2\sqrt{I\, m g l
#    \cos\theta}`.
