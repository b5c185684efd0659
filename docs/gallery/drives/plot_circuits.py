# SPDX-License-Identifier: Apache-2.0
r"""
Circuits, by analogy
====================

ME 6102 sets electrical and mechanical energies side by side ("Energies in Mech Electrical
domain"): an inductance stores :math:`\tfrac12 L i^2` as a mass does :math:`\tfrac12 m v^2`, a
capacitor stores energy as a spring does, a resistance loses it as a damper does. With the charge
:math:`q` for the position, :math:`i = \dot q`, Lagrange's equation gives the loop of a circuit:

.. math::

   \underbrace{L \ddot q}_{m \ddot x} + \underbrace{R \dot q}_{b \dot x}
   + \underbrace{q / C}_{k x} = \underbrace{V}_{F}, \qquad
   \text{LR: } L \frac{di}{dt} + R i = V, \qquad \text{RC: } R \dot q + \frac{q}{C} = V .

.. admonition:: Erratum

   The potential energy of a capacitor is printed as :math:`V = \tfrac12 C V^2`: one letter for
   energy and voltage, and a formula that must not be put into Lagrange's equation. With the charge
   as coordinate the energy is

   .. math:: U = \frac{q^2}{2 C},

   the counterpart of :math:`\tfrac12 k x^2` with :math:`k = 1/C`. Both are the same number, but
   not the same function: for the plates of the notes, :math:`C = \varepsilon A / g`, the force
   that closes the gap is :math:`-\partial U / \partial g = -q^2 / (2 \varepsilon A)`, while
   :math:`-\partial(\tfrac12 C V^2)/\partial g` has the opposite sign: the plates would repel.

A scene has no capacitors, but it has motors, and a motor makes all three circuits:

* its winding is an LR circuit, if a brake holds the rotor;
* its rotor is a capacitor: the back-EMF is :math:`E = K\omega` and :math:`J\dot\omega = K i`, so
  :math:`i = (J/K^2)\,\dot E` and :math:`C = J/K^2`; without inductance it is an RC circuit;
* with both it is the series circuit of L, R and C.

:Lectures: ME 6102, "Energies in Mech Electrical domain"
:Equations: Motor
:Shows: LR, RC and RLC circuits, built from motors
"""

from importlib.resources import files

import matplotlib.pyplot as plt
import numpy as np
from scipy.linalg import expm  # pip install ".[gallery]"

from arm_sim import Simulator
from arm_sim.figures import animation, use_style

use_style()

# %%
# The scene
# ---------
# Three joints, three circuits. With :math:`R = 2\,\Omega`, :math:`L = 20` mH and :math:`C = 5` mF
# the time constants :math:`L/R` and :math:`RC` are both 10 ms.

print((files("arm_sim") / "scenes/lectures/circuits.yaml").read_text())

# %%
# The run and an independent solution
# -----------------------------------
# 5 V for 60 ms, then the terminals are shorted: the coil keeps its current going, the capacitor
# discharges.

sim = Simulator("circuits", dt=5e-4, tolerance=1e-12)
on = 0.06
volts = np.where(np.arange(240) * sim.dt < on, 5.0, 0.0)
run = sim.run(0.12, np.column_stack([volts] * 3))
print(sim.z_names)

# %%
# The LR circuit tends to :math:`V/R` and the RC circuit to :math:`V`, exponentially; the three
# together are linear in :math:`(i, E)`, and solved by the exponential of a matrix.

R, L, K, J = 2.0, 0.02, 0.05, 1.25e-5
C, V = J / K**2, 5.0
t = run.time
rising, falling = t[t <= on], t[t > on] - on

lr = V / R * (1 - np.exp(-rising * R / L))
lr = np.append(lr, lr[-1] * np.exp(-falling * R / L))
rc = V * (1 - np.exp(-rising / (R * C)))
rc = np.append(rc, rc[-1] * np.exp(-falling / (R * C)))

A = np.array([[-R / L, -1 / L], [1 / C, 0.0]])
full = np.array([0.0, V])
up = np.array([full - expm(A * s) @ full for s in rising])
down = np.array([expm(A * s) @ up[-1] for s in falling])
rlc = np.vstack([up, down])

E = K * run.v  # back-EMF, the voltage of the capacitor
checks = {
    "LR, current [A]": (run.z[:, 0], lr),
    "RC, voltage [V]": (E[:, 1], rc),
    "RLC, current [A]": (run.z[:, 1], rlc[:, 0]),
    "RLC, voltage [V]": (E[:, 2], rlc[:, 1]),
}
for name, (simulated, exact) in checks.items():
    error = np.abs(simulated - exact).max()
    print(f"{name}: largest difference {error:.1e}, of {np.abs(exact).max():.2f}")
    assert error <= 1e-8
assert (run.q[:, 0] == 0.0).all()  # the blocked rotor has not moved by one bit

# %%
# The sign of the force on the capacitor's plates, by differences of both energies:

area, gap, charge, step = 8.85e-12 * 1e-2, 1e-3, 1e-8, 1e-7  # ε A [F m], g [m], q [C]


def capacitance(g):
    return area / g


voltage = charge / capacitance(gap)


def slope(energy):
    return (energy(gap + step) - energy(gap - step)) / (2 * step)


of_charge = -slope(lambda g: charge**2 / (2 * capacitance(g)))
as_printed = -slope(lambda g: 0.5 * capacitance(g) * voltage**2)
print(f"force from q²/2C: {of_charge:.3e} N (attracts), from CV²/2: {as_printed:.3e} N")
assert of_charge < 0 < as_printed
assert abs(of_charge + charge**2 / (2 * area)) < 1e-8 * abs(of_charge)

# %%
# In a figure
# -----------

figure = plt.figure(figsize=(7.2, 4.8))
axes = list(figure.subplot_mosaic([["LR", "RC"], ["RLC", "RLC"]]).values())
ms = 1e3 * t
axes[0].plot(ms, run.z[:, 0])
axes[0].set(ylabel="current [A]", title="LR: the blocked motor")
axes[1].plot(ms, E[:, 1], "C1")
axes[1].set(ylabel="voltage [V]", title="RC: the motor without inductance")
axes[2].plot(ms, run.z[:, 1])
axes[2].set(title="RLC: the whole motor", ylim=(-1.75, 1.75))
axes[2].set_ylabel("current [A]", color="C0")
other = axes[2].twinx()
other.grid(False)
other.spines["right"].set_visible(True)
other.set_ylabel("voltage of the capacitor [V]", color="C1")
other.plot(ms, E[:, 2], color="C1")
other.set_ylim(-7.0, 7.0)
for axis in axes:
    axis.axvline(1e3 * on, color="0.7", lw=0.8)
    axis.set_xlabel("time [ms]")
axes[0].axvline(1e3 * L / R, color="0.4", ls="--", lw=1.0, label="L / R")
axes[1].axvline(1e3 * R * C, color="0.4", ls="--", lw=1.0, label="R C")
for axis in axes[:2]:
    axis.legend()

# %%
# In motion
# ---------
# The three rotors in slow motion: the brake holds the first, and the speed of the others is the
# voltage of their capacitor. The third swings once past the speed of the second.

turn = np.linspace(0.0, 2 * np.pi, 61)
rim = np.column_stack([np.cos(turn), np.sin(turn)])
spoke = np.stack([np.sin(run.q), -np.cos(run.q)], axis=-1)  # (k, 3, 2)
centres = np.array([[0.0, 0.0], [2.6, 0.0], [5.2, 0.0]])
looks = [
    {"marker": "", "color": color, "label": label}
    for color, label in (("C0", "LR"), ("C1", "RC"), ("C2", "RLC"))
]
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    t,
    [rim + centre for centre in centres]
    + [(np.stack([c - spoke[:, j], c + spoke[:, j]], axis=1), looks[j])
       for j, c in enumerate(centres)],
    speed=0.02,
    size=(7.0, 3.2),
    title="The rotors of the three circuits",
)  # fmt: skip
plt.gca().set_axis_off()  # a sketch, not to scale
plt.show()

# %%
# Questions
# ---------
# 1. Which resistance makes the series circuit settle without swinging? *Hint:* the mass on a
#    spring with damper, :math:`b = 2\sqrt{km}`, in electrical terms.
# 2. How much of the energy that the source gives to the RC circuit ends in the capacitor, and
#    does it depend on :math:`R`? *Hint:* compare ``run.kinetic``, ``run.lost`` and
#    ``run.supplied`` of a scene with that joint alone; it is one half, whatever :math:`R` is.
