# SPDX-License-Identifier: Apache-2.0
"""Friction models: Stribeck curve, stick-slip, pre-sliding hysteresis, break-away."""

import numpy as np

from arm_sim import Simulator
from arm_sim.figures import figure

WHEEL = """<robot name="wheel"><link name="base"/><link name="wheel"><inertial><mass value="1"/>
  <inertia ixx="{J}" ixy="0" ixz="0" iyy="{J}" iyz="0" izz="{J}"/></inertial></link>
  <joint name="axle" type="continuous"><parent link="base"/><child link="wheel"/>
  <axis xyz="0 0 1"/></joint></robot>"""
DRY = {"coulomb": 1.0, "static": 1.5, "stribeck_velocity": 0.1, "viscous": 0.4}
LUGRE = DRY | {"stribeck_velocity": 0.001}
LUGRE["lugre"] = {"sigma0": 1e5, "sigma1": 316.0, "sigma1_velocity": 0.02}


def wheel(inertia: float, friction: dict) -> Simulator:
    """A wheel on a vertical axis with friction."""
    joint = {"friction": friction}
    return Simulator({"robot": {"urdf": WHEEL.format(J=inertia)}, "joints": {"axle": joint}})


# --- steady motion ----------------------------------------------------------------------------
with figure("friction", columns=2, size=(7.2, 2.6)) as (curve, pulled):
    speeds = np.linspace(-1.5, 1.5, 1201)
    SIDES = {
        "viscous": {"positive": 0.8, "negative": 0.2},
        "coulomb": {"positive": 1.2, "negative": 0.8},
    }
    for name, law in (("dry, Stribeck", DRY), ("by direction", SIDES)):
        torques = wheel(1.0, law).dynamics.friction(speeds[:, None])
        torques[600] = np.nan  # at rest, friction is a reaction
        curve.plot(speeds, torques, label=name)
    curve.set(xlabel="speed [rad/s]", ylabel="friction [N m]", title="Steady motion")
    curve.legend()

    # --- a load pulled by a spring at constant speed: stick-slip ---
    STIFFNESS, SPEED, DT = 20.0, 0.1, 1e-3
    slip = {name: wheel(1.0, law) for name, law in (("dry, Stribeck", DRY), ("LuGre", LUGRE))}
    motions = {}
    for name, sim in slip.items():
        # The spring force in the middle of the tick.
        motions[name] = sim.run(
            8.0,
            lambda s: STIFFNESS * (SPEED * (s.time + 0.5 * DT) - s.q - 0.5 * DT * s.v),
        )
        color = "C2" if name == "LuGre" else "C0"  # C1 is the other law of the left panel
        pulled.plot(motions[name].time, motions[name].q[:, 0], color, label=name)
    pulled.plot([0, 8], [0, 8 * SPEED], ":", color="0.5", label="end of the spring")
    pulled.set(xlabel="time [s]", ylabel="angle [rad]", title="Pulled by a slow spring")
    pulled.legend()
still = float(np.mean(motions["dry, Stribeck"].v == 0.0))
print(f"stick-slip: exactly at rest {100 * still:.0f} % of the time")

# --- bristles: pre-sliding displacement -------------------------------------------------------
with figure("bristles", columns=2, size=(7.2, 2.6)) as (loop, breaking):
    soft = {"coulomb": 1.0, "lugre": {"sigma0": 1e3, "sigma1": 1.0}}
    ramp = np.linspace(0.0, 1.0, 2001)[1:]
    shape = np.concatenate([ramp, 1.0 - ramp, -ramp, ramp - 1.0, ramp])
    for peak in (0.95, 0.7, 0.4):
        run = wheel(1e-3, soft).run(len(shape) * DT, (peak * shape)[:, None])
        loop.plot(1e3 * run.q[:, 0], run.tau[:, 0], label=f"±{peak} N m")
        if peak == 0.7:
            expected = -1e-3 * np.log(1.0 - peak)
            reached = run.q[2000, 0]
    loop.set(xlabel="angle [mrad]", ylabel="torque [N m]", title="Hysteresis before slipping")
    loop.set_xlim(-0.9, 4.1)
    loop.legend(loc="lower right")
    print(f"hysteresis: {1e3 * reached:.3f} mrad at 0.7 N m, closed form {1e3 * expected:.3f}")

    # --- the faster the torque grows, the lower the break-away torque ---
    rates, forces = np.geomspace(1.0, 50.0, 12), []
    for rate in rates:
        sim = wheel(1.0, LUGRE)
        ticks = int(2.0 / rate / DT) + 50
        run = sim.run(ticks * DT, (rate * DT * (np.arange(ticks) + 1))[:, None])
        forces.append(LUGRE["lugre"]["sigma0"] * run.z.max())
    breaking.semilogx(rates, forces, "o-", label="break-away")
    breaking.axhline(DRY["static"], color="0.5", linestyle="--", label="static friction")
    breaking.axhline(DRY["coulomb"], color="0.5", linestyle=":", label="Coulomb friction")
    breaking.set(
        xlabel="rate of the torque [N m/s]",
        ylabel="largest bristle torque [N m]",
        title="Break-away",
        ylim=(0.95, 1.75),
    )
    breaking.legend(loc="upper right", ncols=2)
print(f"break-away: {forces[0]:.2f} N m at {rates[0]:.0f} N m/s, {forces[-1]:.2f} at 50")

assert 0.3 < still < 1.0
assert abs(reached - expected) < 0.02 * expected
assert (np.diff(forces) < 1e-3).all() and forces[0] > 1.4
