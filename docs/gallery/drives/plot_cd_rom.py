# SPDX-License-Identifier: Apache-2.0
r"""
CD-ROM: coarse and fine tracking
================================

The pickup of a CD player is the longest example of ME 6102: a motor moves a sled to the track
("Gross Tracking"), and a lens on a soft suspension does the rest ("Fine Tracking and Focussing").
The notes have pictures and questions: which inertia does the motor see, how many degrees of
freedom has the lens, is a spring with a mass a good model of it? The equations are ours.

**Coarse.** The motor drives the sled by a pinion of radius :math:`\rho` on a rack, :math:`x_s =
\rho\,\theta`, so :math:`N = 1/\rho`. Equal kinetic energies give the equivalent inertia on the
motor's side, :math:`J_m + (m_s + m)\rho^2`; seen from the sled it is a mass, :math:`m_s + m + N^2
J_m`.

**Fine.** The lens, :math:`m`, hangs on springs and is moved by voice coils, one along the radius
and one towards the disc: two degrees of freedom, with the sled three. A voice coil is a DC motor
that slides, with a force :math:`K_f\,i` and a back-EMF :math:`K_f\,\dot x`:

.. math::

   (m_s + m + N^2 J_m)\,\ddot x_s + m\,\ddot x_l + N^2 B_m \dot x_s &= N K\,i_s \\
   m\,(\ddot x_s + \ddot x_l) + c\,\dot x_l + k\,x_l &= K_f\,i_l \\
   m\,\ddot z + c\,\dot z + k\,(z - z_0) + m g &= K_f\,i_z

with :math:`L_j\,di_j/dt + R_j\,i_j + E_j = V_j` for each winding, :math:`E_s = N K \dot x_s`,
:math:`E_l = K_f \dot x_l`, :math:`E_z = K_f \dot z`.

:Lectures: ME 6102, "Gross Tracking", "Fine Tracking and Focussing"
:Equations: 20; Motor
:Shows: a sled and a lens that follow a track to a micrometre
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
# A voice coil is an ``actuator`` of a sliding joint, whose torque constant is in N/A.

print((files("arm_sim") / "scenes/lectures/cd_rom.yaml").read_text())
sim = Simulator("cd_rom", tolerance=1e-12)

m_s, m, J_m, B_m, N = 0.05, 1e-3, 3e-7, 1e-6, 500.0
felt = sim.dynamics.mass_matrix(np.zeros(3))[0, 0]
print(f"mass that the rack feels: {felt:.4f} kg, of which {J_m * N**2:.4f} kg is the rotor")
assert abs(felt - (m_s + m + J_m * N**2)) < 1e-12

# %%
# The run
# -------
# The track runs outwards at 4 mm/s, as in a fast search, and the disc is not centred (0.1 mm, 8
# turns a second) and not flat (0.2 mm). The lens has a PID controller at 10 kHz that sees nothing
# but the errors; the sled goes where the lens is off its middle.

h, spin = sim.dt, 2 * np.pi * 8.0


def track(t):
    return 4e-3 * t + 1e-4 * np.sin(spin * t)


def disc(t):
    return 2e-4 * np.sin(spin * t)


class Pickup:
    """Voltages from the two errors, sampled: PID for the lens, and P for the sled."""

    K_P, K_I, K_D = 40e3, 6e6, 30.0  # [V/m], [V/(m s)], [V s/m]

    def __init__(self):
        self.sum, self.last = np.zeros(2), np.zeros(2)

    def volts(self, t, q):
        error = np.array([track(t) - q[0] - q[1], disc(t) - q[2]])
        self.sum += h * error
        lens = self.K_P * error + self.K_I * self.sum + self.K_D * (error - self.last) / h
        self.last = error
        return [50.0 * q[1], *lens]


pickup = Pickup()
run = sim.run(0.5, lambda state: pickup.volts(state.time, state.q))
radius = run.q[:, 0] + run.q[:, 1]
error = np.column_stack([track(run.time) - radius, disc(run.time) - run.q[:, 2]])
settled = np.abs(error[run.time > 0.1]).max(axis=0)
print(f"off the track by at most {1e6 * settled[0]:.2f} µm")
print(f"out of focus by at most {1e6 * settled[1]:.2f} µm")

# %%
# The independent solution
# ------------------------
# Between two samples the voltages are held and the equations are linear,
# :math:`\dot x = A x + B V + a`, so the exponential of one matrix carries the state exactly from
# sample to sample; the controller starts anew on top of it.

K, R, L = np.array([0.005 * N, 0.5, 0.5]), np.array([8.0, 6.0, 6.0]), np.array([1e-3, 5e-4, 5e-4])
k, c, z0, g = 63.0, 0.05, 1.557e-4, 9.81
M = np.array([[m_s + m + J_m * N**2, m, 0], [m, m, 0], [0, 0, m]])
to_v = np.linalg.inv(M)
A = np.zeros((13, 13))  # q, v, i; the three voltages; one
A[0:3, 3:6] = np.eye(3)
A[3:6, 0:3] = -to_v @ np.diag([0, k, k])
A[3:6, 3:6] = -to_v @ np.diag([N**2 * B_m, c, c])
A[3:6, 6:9] = to_v @ np.diag(K)
A[3:6, 12] = to_v @ [0, 0, k * z0 - m * g]
A[6:9, 3:6], A[6:9, 6:9], A[6:9, 9:12] = -np.diag(K / L), -np.diag(R / L), np.diag(1 / L)
tick = expm(A * h)

x, pickup, states = np.append(np.zeros(12), 1.0), Pickup(), []
for t in run.time:
    states.append(x[:9])
    x[9:12] = pickup.volts(t, x[:3])
    x = tick @ x
states = np.array(states)

for name, simulated, exact, unit in (
    ("position", run.q, states[:, :3], "m"), ("current", run.z, states[:, 6:], "A"),
):  # fmt: skip
    worst, size = np.abs(simulated - exact).max(), np.abs(exact).max()
    print(f"{name}: largest difference {worst:.1e} {unit}, of {size:.1e} {unit}")
    assert worst <= 1e-8 * size

# %%
# Is a spring with a mass a good model of the lens? The suspension's frequency is 40 Hz, and the
# controller works far above, where the lens is a free mass; what the model leaves out, the bending
# of the suspension from some kHz on, is what limits a real player.

print(f"suspension {np.sqrt(k / m) / (2 * np.pi):.0f} Hz, "
      f"controller {np.sqrt(0.5 / 6 * Pickup.K_P / m) / (2 * np.pi):.0f} Hz")  # fmt: skip
assert settled.max() < 2e-6

# %%
# In a figure
# -----------

figure = plt.figure(figsize=(7.2, 4.8))
axes = list(figure.subplot_mosaic([["track", "track"], ["error", "volts"]]).values())
axes[0].plot(run.time, 1e3 * track(run.time), "k", lw=1.0, label="track")
axes[0].plot(run.time, 1e3 * run.q[:, 0], label="sled")
axes[0].plot(run.time, 1e3 * run.q[:, :2].sum(axis=1), "--", label="lens")
axes[0].set(xlabel="time [s]", ylabel="radius [mm]", title="Two stages")
axes[0].legend()
axes[1].plot(run.time, 1e6 * error[:, 0], label="off the track")
axes[1].plot(run.time, 1e6 * error[:, 1], label="out of focus")
axes[1].set(xlabel="time [s]", ylabel="error [µm]", title="Tracking errors")
axes[1].legend()
axes[2].plot(run.time, 10 * run.command[:, 0], label="sled, × 10")
axes[2].plot(run.time, run.command[:, 1], label="tracking coil")
axes[2].plot(run.time, run.command[:, 2], label="focus coil")
axes[2].set(xlabel="time [s]", ylabel="voltage [V]", title="Commands", ylim=(-0.4, 0.9))
axes[2].legend()

# %%
# In motion
# ---------
# Sled and lens along the radius, seen from the side, and the disc above with the track as a mark.

sled_box = 1e-3 * np.array([[-0.6, -0.8], [0.6, -0.8], [0.6, -0.5], [-0.6, -0.5], [-0.6, -0.8]])
lens_box = 1e-3 * np.array([[-0.2, 0.0], [0.2, 0.0], [0.2, 0.1], [-0.2, 0.1], [-0.2, 0.0]])
x_s, x_l, z = run.q.T
flat = np.zeros_like(z)
sled = sled_box + np.stack([x_s, flat], axis=-1)[:, None]
lens = lens_box + np.stack([x_s + x_l, z], axis=-1)[:, None]
spring = np.stack([
    np.stack([x_s + x_l - 2e-4, z], -1), np.stack([x_s, flat - 5e-4], -1),
    np.stack([x_s + x_l + 2e-4, z], -1),
], axis=1)  # fmt: skip
ends = 1e-3 * np.array([[-1.0, 0.0], [3.5, 0.0]])
plate = ends + np.stack([flat, 1e-3 + disc(run.time)], axis=-1)[:, None]
spot = np.stack([track(run.time), 1e-3 + disc(run.time)], axis=-1)[:, None]
beam = np.stack([np.stack([x_s + x_l, z + 1e-4], -1), np.stack([x_s + x_l, 1e-3 + z], -1)], axis=1)
thin = {"marker": "", "linewidth": 1.2}
# sphinx_gallery_thumbnail_number = 2
motion = animation(
    run.time,
    [(sled, {"marker": "", "label": "sled"}),
     (lens, {"marker": "", "color": "C2", "label": "lens"}),
     (spring, thin | {"color": "0.5", "label": "suspension"}),
     (plate, thin | {"color": "0.2", "label": "disc"}),
     (beam, thin | {"color": "C3", "label": "beam"}),
     (spot, {"color": "C1", "label": "track"})],
    speed=0.1,
    size=(7.0, 3.8),
    title="Pickup and disc",
)  # fmt: skip
plt.show()

# %%
# Questions
# ---------
# 1. What is left over if the sled works alone, or the lens alone? *Hint:* set one of the gains to
#    zero; the sled's loop has a bandwidth of a few hertz, the lens reaches its stop at 1 mm.
# 2. Which pinion lets the sled accelerate most for a given current? *Hint:* the mass that the rack
#    feels and the force both depend on :math:`N`; compare :math:`N^2 J_m` with
#    :math:`m_s + m`.
