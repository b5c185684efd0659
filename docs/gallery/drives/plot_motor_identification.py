# SPDX-License-Identifier: Apache-2.0
r"""
Identifying a motor and its friction
====================================

"Identification of motor model parameters" is a slide of ME 6102 that says what is needed, a
realistic simulation before the controller, and what makes it hard: friction. The measurements that
every laboratory makes are four, each chosen so that most of the model drops out of

.. math::

   V = R\,i + L \frac{di}{dt} + K\omega, \qquad
   J \dot\omega + \tau_f(\omega) = K\,i, \qquad
   \tau_f = F_c + (F_s - F_c)\,e^{-(\omega / v_s)^2} + b\,\omega \quad (\omega > 0)

* **rotor blocked**, :math:`\omega = 0`: the winding alone, for :math:`R` and :math:`L`;
* **free run** at several voltages, all rates zero: :math:`V = R i + K\omega`, for :math:`K`;
* **constant speeds**: :math:`\tau_f = K i`, the friction curve point by point;
* **coast-down**, :math:`i = 0`: :math:`J \dot\omega = -\tau_f`, for :math:`J`.

All four are linear least squares, but for the one number :math:`v_s`.

:Lectures: ME 6102, "Identification of motor model parameters"
:Equations: 8; Motor
:Shows: four measurements that give a motor's numbers
"""

from importlib.resources import files

import matplotlib.pyplot as plt
import numpy as np
import yaml
from scipy.integrate import cumulative_trapezoid, solve_ivp  # pip install ".[gallery]"

from arm_sim import Simulator
from arm_sim.figures import animation, use_style
from arm_studies.identification import MotorRecord, identify_motor

use_style()

# %%
# The scene
# ---------
# The bench is the simulator; its instruments have noise, 2 mA and 0.05 rad/s. The numbers below
# are not used again until the end.

text = (files("arm_sim") / "scenes/lectures/motor_bench.yaml").read_text()
print(text)
rng = np.random.default_rng(1)


def read(run):
    """Time, current and speed as the instruments show them."""
    noise = rng.normal(size=(2, len(run.time)))
    return run.time, run.z[:, 0] + 2e-3 * noise[0], run.v[:, 0] + 0.05 * noise[1]


def fit(*columns, to):
    """Least squares: the factors of the columns whose sum comes closest."""
    return np.linalg.lstsq(np.column_stack(columns), to, rcond=None)[0]


# %%
# Rotor blocked
# -------------
# A step of 0.6 V is too little to break the shaft away, so friction itself blocks the rotor, to
# the bit. Differentiating a noisy current would be a bad idea; the equation is integrated
# instead, :math:`\int V dt = R \int i\,dt + L\,i`.

blocked = Simulator("motor_bench", dt=2e-4).run(0.03, [0.6])
assert (blocked.v == 0.0).all()
t, i, _ = read(blocked)
R, L = fit(cumulative_trapezoid(i, t, initial=0.0), i, to=0.6 * t)

# %%
# Free run and constant speeds
# ----------------------------
# From 3 to 12 V the motor settles, and the line through the points has the slopes :math:`R` and
# :math:`K`. It does not settle at low speed, where friction falls with speed: there a controller
# holds the speed, and the mean of the current is friction.

bench = Simulator("motor_bench")
settled = []
for volts in np.linspace(3.0, 12.0, 7):
    bench.reset()
    bench.run(1.2, [volts])
    _, i, w = read(bench.run(0.3, [volts]))
    settled.append((volts, i.mean(), w.mean()))
volts, i, w = np.transpose(settled)
(K,) = fit(w, to=volts - R * i)

held = []
for speed in (0.5, 1, 1.5, 2, 3, 4, 6, 8, 12, 20, 40, 80, 140, 200):
    bench.reset(v=[speed])

    def hold(state, speed=speed):
        return [R * 0.65 + K * speed + 0.4 * (speed - state.v[0])]

    bench.run(0.3, hold)
    _, i, w = read(bench.run(0.5, hold))
    held.append((w.mean(), K * i.mean()))
w, torque = np.transpose(held)

# %%
# Without :math:`v_s` the curve is linear in :math:`F_c`, :math:`F_s - F_c` and :math:`b`; so
# :math:`v_s` is searched along a line, and the others follow.

tried = np.geomspace(0.3, 30.0, 400)
fits = [fit(np.ones_like(w), np.exp(-((w / v) ** 2)), w, to=torque) for v in tried]
left = [np.sum((p[0] + p[1] * np.exp(-((w / v) ** 2)) + p[2] * w - torque) ** 2)
        for p, v in zip(fits, tried, strict=True)]  # fmt: skip
best = int(np.argmin(left))
v_s, (F_c, extra, b) = tried[best], fits[best]
F_s = F_c + extra


def friction(w):
    return F_c + extra * np.exp(-((w / v_s) ** 2)) + b * w


# %%
# Coast-down
# ----------
# The terminals are opened at 200 rad/s. Integrated, the equation is
# :math:`J (\omega_0 - \omega) = \int \tau_f(\omega)\,dt`, with the curve that is known by now.

opened = yaml.safe_load(text)
opened["joints"]["shaft"]["actuator"]["command"] = "current"
coast = Simulator(opened, tolerance=1e-12)
coast.reset(v=[200.0])
down = coast.run(1.0, [0.0])
t = down.time
w_read = down.v[:, 0] + 0.05 * rng.normal(size=len(t))
taken = cumulative_trapezoid(friction(w_read), t, initial=0.0)
moving = w_read > 5.0
one_over_J, w_0 = fit(-taken[moving], np.ones(moving.sum()), to=w_read[moving])
J = 1.0 / one_over_J

# %%
# What was found
# --------------

true = {
    "R": 1.2,
    "L": 3e-3,
    "K": 0.045,
    "J": 8e-5,
    "F_c": 0.02,
    "F_s": 0.03,
    "v_s": 3.0,
    "b": 1e-4,
}
found = {"R": R, "L": L, "K": K, "J": J, "F_c": F_c, "F_s": F_s, "v_s": v_s, "b": b}
for name, value in true.items():
    print(f"{name:4s} {found[name]:.5g}  true {value:g}  off by {found[name] / value - 1:+.2%}")
    assert abs(found[name] / value - 1) < (0.03 if name in ("v_s", "F_s") else 0.01)

# %%
# The suite has these tests ready, ``identify_motor`` or ``./arm identify-drive``: it lays
# simulated currents and speeds onto the records and says how sure each number is. Its friction is
# Coulomb's and viscous, so it gets records above Stribeck's speeds.

bench.reset(v=[100.0])
steps = np.repeat([10.0, 6.0, 12.0, 8.0], 150)
t_run, i_run, w_run = read(bench.run(0.6, steps[:, None]))
t_held, i_held, _ = read(blocked)
matched = identify_motor([
    MotorRecord.of("blocked", t_held, voltage=np.full_like(t_held, 0.6), current=i_held),
    MotorRecord.of("free", t_run, voltage=np.append(steps, 8.0), current=i_run, speed=w_run),
    MotorRecord.of("coast", t[w_read > 20.0], speed=w_read[w_read > 20.0]),
])  # fmt: skip
for name, ours in (
    ("resistance", R), ("inductance", L), ("torque_constant", K), ("rotor_inertia", J),
    ("coulomb", F_c), ("rotor_damping", b),
):  # fmt: skip
    print(f"{name:16s} {matched.values[name]:.5g}  by hand {ours:.5g}")
    assert abs(matched.values[name] / ours - 1) < 0.02

# %%
# The simulated bench itself has to be right: the coast-down beside DOP853 of SciPy, with the true
# numbers and the standstill found as an event.


def braked(t, w):
    return -(0.02 + 0.01 * np.exp(-((w / 3.0) ** 2)) + 1e-4 * w) / 8e-5


def still(t, w):
    return w[0]


still.terminal = True
exact = solve_ivp(braked, (0, 1), [200.0], method="DOP853", rtol=1e-13, atol=1e-14,
                  t_eval=t, events=still)  # fmt: skip
expected = np.append(exact.y[0], np.zeros(len(t) - exact.y.shape[1]))
error = np.abs(down.v[:, 0] - expected).max()
print(f"largest difference of the coast-down: {error:.1e} rad/s, of 200 rad/s; at rest after "
      f"{exact.t_events[0][0]:.4f} s")  # fmt: skip
assert error <= 1e-8

# %%
# And the purpose of it all: a scene with what was found moves as the motor does, on a voltage that
# no measurement had.

scene = yaml.safe_load(text.replace("8e-5", repr(float(J))))
scene["joints"]["shaft"]["actuator"] |= {
    "resistance": float(R), "inductance": float(L), "torque_constant": float(K),
}  # fmt: skip
scene["joints"]["shaft"]["friction"] = {
    "coulomb": float(F_c), "static": float(F_s), "stribeck_velocity": float(v_s),
    "viscous": float(b),
}  # fmt: skip
drive = (4.0 * np.sin(2 * np.pi * 1.5 * np.arange(1500) * 1e-3))[:, None]
motor, model = (Simulator(of).run(1.5, drive) for of in ("motor_bench", scene))
off = np.abs(motor.v - model.v).max()
print(f"speeds differ by at most {off:.2f} rad/s, of {motor.v.max():.0f} rad/s")
assert off < 0.02 * motor.v.max()

# %%
# In a figure
# -----------

figure, axes = plt.subplots(2, 2, figsize=(7.2, 5.0))
axes = axes.flat
axes[0].plot(1e3 * blocked.time, blocked.z[:, 0], label="measured")
axes[0].axhline(0.6 / R, color="0.5", ls="--", label="V / R")
axes[0].axvline(1e3 * L / R, color="0.5", ls=":", label="L / R")
axes[0].legend()
axes[0].set(xlabel="time [ms]", ylabel="current [A]", title="Rotor blocked: R, L")
fine = np.geomspace(0.3, 220.0, 300)
axes[1].semilogx(w, 1e3 * torque, "o", ms=4, label="measured")
axes[1].semilogx(fine, 1e3 * friction(fine), label="fitted")
axes[1].set(xlabel="speed [rad/s]", ylabel="friction [mN m]", title="Constant speeds: friction")
axes[1].legend()
axes[2].plot(t, w_read, lw=1.0, label="measured")
axes[2].plot(t[moving], w_0 - taken[moving] / J, "--", label="fitted")
axes[2].set(xlabel="time [s]", ylabel="speed [rad/s]", title="Coast-down: J")
axes[2].legend()
axes[3].plot(motor.time, motor.v[:, 0], label="motor")
axes[3].plot(model.time, model.v[:, 0], "--", label="model")
axes[3].set(xlabel="time [s]", ylabel="speed [rad/s]", title="4 V at 1.5 Hz")
axes[3].legend()

# %%
# In motion
# ---------
# The end of the coast-down: the rotor, and on the right the point on the friction curve, which
# rises as the rotor comes to rest.

last = (t >= exact.t_events[0][0] - 0.06) & (t <= exact.t_events[0][0] + 0.02)
angle, w_last = down.q[last, 0], down.v[last, 0]
turn = np.linspace(0.0, 2 * np.pi, 61)
mark = np.column_stack([np.sin(angle), -np.cos(angle)])
scale = np.array([2.0 / w_last.max(), 100.0])


def place(w):
    return np.array([1.4, -2.4]) + scale * np.column_stack([w, friction(w)])


# sphinx_gallery_thumbnail_number = 2
motion = animation(
    t[last],
    [np.column_stack([np.cos(turn), np.sin(turn)]),
     (place(np.linspace(0, w_last.max(), 100)), {"label": "friction over speed"}),
     (np.stack([0 * mark, mark], axis=1), {"marker": "", "label": "rotor"}),
     (place(w_last)[:, None], {"color": "C3", "label": "friction now"})],
    speed=0.02,
    size=(6.0, 3.4),
    title="Coming to rest",
)  # fmt: skip
plt.gca().set_axis_off()  # a sketch, not to scale
plt.show()

# %%
# Questions
# ---------
# 1. Why may the friction curve be measured by the mean current of a speed that wavers, and when
#    does that go wrong? *Hint:* over a time in which the speed returns, :math:`\int
#    J\dot\omega\,dt` vanishes; but the mean of a bent curve is not the curve of the mean.
# 2. Identify :math:`J` and the whole friction from the coast-down alone. Which of the numbers do
#    you trust? *Hint:* only their ratios to :math:`J` can be seen there.
