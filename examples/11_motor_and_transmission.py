# SPDX-License-Identifier: Apache-2.0
"""Motors and transmissions: step response, torque-speed curve, belt, backlash, harmonic drive."""

import numpy as np

from arm_sim import Simulator
from arm_sim.figures import figure

WHEEL = """<robot name="wheel"><link name="base"/><link name="wheel"><inertial><mass value="1"/>
  <inertia ixx="{J}" ixy="0" ixz="0" iyy="{J}" iyz="0" izz="{J}"/></inertial></link>
  <joint name="axle" type="continuous"><parent link="base"/><child link="wheel"/>
  <axis xyz="0 0 1"/></joint></robot>"""
R, L, K, J = 1.0, 1e-3, 0.05, 5e-5


def wheel(
    inertia: float, actuator: dict, transmission: dict | None = None, dt: float = 1e-3
) -> Simulator:
    """A wheel on a vertical axis with a drive."""
    joint = {"actuator": actuator} | ({"transmission": transmission} if transmission else {})
    scene = {"robot": {"urdf": WHEEL.format(J=inertia)}, "joints": {"axle": joint}}
    return Simulator(scene, dt=dt)


# --- motor: a step of 12 V, compared with the closed form ------------------------------------
winding = {"resistance": R, "inductance": L, "torque_constant": K}
step = wheel(J, {"command": "voltage"} | winding, dt=1e-4).run(0.1, [12.0])
poles = np.roots([1.0, R / L, K**2 / (L * J)])
t, (a, b) = step.time, poles
current = 12.0 / L * (np.exp(a * t) - np.exp(b * t)) / (a - b)
error = abs(step.z[:, 0] - current.real).max() / current.real.max()
print(f"step response: poles {a:.1f}/s and {b:.1f}/s, current within {error:.0e} of closed form")

with figure("motor", columns=2, size=(7.2, 2.6)) as (left, right):
    left.plot(1e3 * t, step.z[:, 0])
    left.set(xlabel="time [ms]", title="12 V on a motor at rest")
    left.set_ylabel("current [A]", color="C0")
    other = left.twinx()
    other.grid(False)
    other.spines["right"].set_visible(True)
    other.set_ylabel("speed [rad/s]", color="C1")
    other.plot(1e3 * t, step.v[:, 0], color="C1")

    # --- motor: the torque-speed curve, by commanding too much torque at every speed -------------
    limits = {"current_limit": 8.0, "voltage_limit": 12.0}
    geared = winding | limits | {"gear_ratio": 20.0, "rotor_inertia": J}
    motor = wheel(0.1, geared)
    speeds, limit = np.linspace(0.0, 14.0, 141), motor.model.command_limit[0]
    torques = []
    for speed in speeds:
        motor.reset([0.0], [speed])
        motor.step([limit])
        torques.append(motor.effort[0])
    right.plot(speeds, torques)
    right.set(
        xlabel="joint speed [rad/s]", ylabel="torque [N m]", title="Limits 8 A and 12 V, gear 20"
    )
    right.axhline(0.0, color="0.7", lw=0.8)
no_load = np.interp(12.0, speeds, torques)
corner = (12.0 - 8.0 * R) / (K * 20.0)
print(f"torque-speed curve: {torques[0]:.3g} N m up to {corner:.3g} rad/s, none at 12 rad/s")

# --- belt: rigid, flexible, with backlash -----------------------------------------------------
rotor = {"rotor_inertia": 2e-5, "gear_ratio": 50.0}
belts = {
    "rigid": None,
    "flexible": {"stiffness": 60.0, "damping": 0.15},
    "with backlash": {"stiffness": 60.0, "damping": 0.15, "backlash": 0.05},
}
push = np.where(np.arange(800) < 300, 0.5, -0.5)[:, None]  # [N m], held for a tick each
with figure("transmission", columns=3, size=(7.2, 2.6)) as axes:
    for name, belt in belts.items():
        motion = wheel(0.1, rotor, belt).run(0.8, push)
        axes[0].plot(motion.time, motion.v[:, 0], label=name)
    axes[0].set(
        xlabel="time [s]", ylabel="speed of the link [rad/s]", title="±0.5 N m at the joint"
    )
    axes[0].legend()

    # --- harmonic drive: hysteresis of a blocked output ------------------------------------------
    harmonic = {
        "stiffness": 4e3,
        "stiffening": 2e8,
        "hysteresis": {"torque": 4.0, "deflection": 4e-4},
    }
    blocked = wheel(
        1e6, {"rotor_inertia": 1e-4, "gear_ratio": 100.0, "rotor_damping": 2e-3}, harmonic
    )
    loop = blocked.run(6.0, 30.0 * np.sin(np.pi * 1e-3 * np.arange(6000))[:, None])
    twist, last = loop.z[:, 0] - loop.q[:, 0], slice(2000, None)
    axes[1].plot(1e3 * twist[last], loop.tau[last, 0])
    axes[1].set(xlabel="twist [mrad]", ylabel="torque [N m]", title="Blocked harmonic drive")
    torque, cycle = loop.tau[4000:6001, 0], twist[4000:6001]
    area = 0.5 * (torque[1:] + torque[:-1]) @ np.diff(cycle)
    print(f"harmonic drive: {area * 1e3:.3g} mJ lost in a cycle of 30 N m")

    # --- harmonic drive: its kinematic error excites the arm -------------------------------------
    wave = {"kinematic_error": {"amplitude": 2e-4, "order": 2}, "stiffness": 4e3, "damping": 1.0}
    resonance = np.sqrt(4e3 * (1.0 / 1.0 + 1.0 / 0.3))  # rotor and link against each other
    sim = wheel(0.3, {"rotor_inertia": 1e-4, "gear_ratio": 100.0}, wave)
    speeds, shaking = [], []
    for start in np.linspace(0.2, 1.6, 71):
        sim.reset([0.0], [start])
        turning = sim.run(1.0).v[500:, 0]
        speeds.append(turning.mean())
        shaking.append(turning.std())
    axes[2].plot(speeds, 1e3 * np.array(shaking), ".")
    axes[2].axvline(resonance / 200.0, color="0.7", ls=":", label="resonance")
    axes[2].set(
        xlabel="mean speed [rad/s]", ylabel="speed ripple [mrad/s]", title="Kinematic error"
    )
    axes[2].legend()
loudest = speeds[int(np.argmax(shaking))]
print(
    f"kinematic error: largest ripple at {loudest:.2f} rad/s, resonance at {resonance / 200:.2f}"
)

assert error < 1e-9
assert abs(torques[0] - 8.0) < 1e-9 and abs(no_load) < 1e-2
assert area > 0.0
assert abs(loudest - resonance / 200.0) < 0.06
