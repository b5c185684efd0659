# SPDX-License-Identifier: Apache-2.0
"""The method chosen for a scene: its fastest rate, in closed form, relative to the limits."""

import logging
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, Dynamics, InvalidInput, load_scene
from arm_sim.integrators.selection import (
    IMPLICIT_STIFFNESS,
    SHARE,
    SHARE_IMPLICIT,
    STIFFNESS,
    STRIBECK_RATE,
    Choice,
    choose,
    fastest_rate,
    law_rate,
)
from arm_sim.plant.plant import Plant
from models.driven import wheel
from models.rotor import rotor
from tolerances import assert_close

CONTROLLED, IMPLICIT = pytest.approx(1e-6 * SHARE), pytest.approx(1e-6 * SHARE_IMPLICIT)


def model(scene: Any) -> ArmModel:
    return ArmModel(load_scene(scene))


def rate_of(scene: Any) -> float:
    return fastest_rate(Plant(model(scene)))


def chosen(
    scene: Any, name: str | None = None, dt: float | None = None, tolerance: float | None = None
) -> Choice:
    return choose(Plant(model(scene)), name, dt, tolerance)


def bristles(J: float, v0: float = 0.0, **more: float) -> dict[str, Any]:
    law = {"viscous": 20.0, "coulomb": 0.5, "lugre": {"sigma0": 1e4, "sigma1": 1.0} | more}
    return {**rotor(J, **law), "initial": {"velocity": {"axle": v0}}}  # type: ignore[arg-type]


@pytest.mark.parametrize(("J", "v0", "rate"), [
    (0.1, 0.0, 1e4 / 0.5), (0.1, -3.0, 3e4 / 0.5), (1e-6, 0.0, np.sqrt(1e10)),
])  # fmt: skip
def test_bristles_answer_as_a_spring_or_as_they_bend(J: float, v0: float, rate: float) -> None:
    """The larger of sqrt(σ0/J) and σ0 max(1, |v0|)/Fc."""
    assert_close(law_rate(model(bristles(J, v0)))[0] / rate, 1.0, 1e-9)


def test_dry_friction_that_rises_decides() -> None:
    """The largest slope of ΔF (1 - exp(-(v/vs)²)), here by search."""
    fc, fs, vs, b = 0.6, 0.2, 0.03, 0.1
    drag = {"positive": 0.5 * b, "negative": b}  # of which the stronger side counts
    scene = rotor(0.1, viscous=drag, coulomb=fc, static=fs, stribeck_velocity=vs)  # type: ignore[arg-type]
    v = np.linspace(0.0, 3.0 * vs, 100_001)
    slope = np.diff((fc - fs) * (1.0 - np.exp(-((v / vs) ** 2)))).max() / v[1]
    assert_close(rate_of(scene), (b + slope) / 0.1, 1e-6 * slope)


def test_viscous_friction_is_stiff_beyond_its_limit() -> None:
    """b/J dt = 1.4: RK4 is stable up to 2.8."""
    dt = 1e-2
    for factor, name, accurate in ((0.99, "rk4", "dop853"), (1.01, "implicit", "implicit")):
        scene = rotor(0.1, viscous=0.1 * factor * STIFFNESS / dt)
        choice = chosen(scene, dt=dt)
        assert (choice.method.name, choice.tolerance, choice.dt) == (name, None, dt)
        choice = chosen(scene, dt=dt, tolerance=1e-6)
        assert (choice.method.name, choice.tolerance) == (accurate, 1e-6)
        assert ("friction stops a joint" in choice.reason) == (factor > 1)
        assert chosen(scene, "rk4", dt).method.name == "rk4"


def test_bristles_are_not_left_to_a_fixed_step() -> None:
    """σ0/Fc dt = 20: implicit with error control, unless error control is asked for by name."""
    scene = bristles(0.1)
    for name in (None, "rk4"):
        choice = chosen(scene, name)
        assert (choice.method.name, choice.tolerance) == ("implicit", IMPLICIT)
    assert chosen(scene, tolerance=1e-9).tolerance == 1e-9
    assert chosen(scene, "dop853", tolerance=1e-9).method.name == "dop853"
    assert chosen(scene, "rk4", dt=5e-5).method.name == "rk4"  # 1e-3 of a tick's limit of 1.4


@pytest.mark.parametrize(("L", "name", "tolerance"), [
    (1e-4, "implicit", IMPLICIT), (1e-1, "dop853", CONTROLLED),
])  # fmt: skip
def test_drives_get_error_control(L: float, name: str, tolerance: float) -> None:
    """The current of a winding decays at R/L; from 50 a tick on the implicit method pays."""
    scene = wheel(command="voltage", resistance=20.0, inductance=L, torque_constant=0.05)
    rate = rate_of(scene)
    b, J = 0.05**2 / (L * 0.1), 20.0 / L
    assert_close(rate / (J / 2 + np.sqrt(J * J / 4 - b)), 1.0, 1e-9)
    assert (rate * 1e-3 > IMPLICIT_STIFFNESS) == (name == "implicit")
    choice = chosen(scene)
    assert (choice.method.name, choice.tolerance) == (name, tolerance)
    assert chosen(scene, tolerance=1e-5).tolerance == 1e-5


def against(stop: dict[str, float], mass: float = 1.0) -> dict[str, Any]:
    """A mass on a rail, with compliant stops at -1 and 0.1 m."""
    joint = {"limits": {"lower": -1.0, "upper": 0.1, "stop": stop}}
    return {"robot": {"urdf": rails(mass)}, "gravity": [0, 0, 0], "joints": {"rail0": joint}}


def rails(*masses: float) -> str:
    """Masses beside each other on rails ``rail0``, ``rail1``, …"""
    rail = """<link name="m{0}"><inertial><mass value="{1}"/><inertia ixx="1" iyy="1" izz="1"
      ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="rail{0}" type="prismatic">
      <parent link="base"/><child link="m{0}"/><limit effort="0" velocity="0"/></joint>"""
    all_ = "".join(rail.format(i, mass) for i, mass in enumerate(masses))
    return f'<robot name="rails"><link name="base"/>{all_}</robot>'


@pytest.mark.parametrize(("stiffness", "name", "tolerance"), [
    (2.4e3, "rk4", None), (2.6e3, "dop853", CONTROLLED), (2.6e9, "implicit", IMPLICIT),
])  # fmt: skip
def test_compliant_stops_get_error_control(
    stiffness: float, name: str, tolerance: float | None
) -> None:
    """From a contact of π/0.05 ticks on; with dampers likewise, and where a mass is light."""
    for mass in (1.0, 1e-3):
        choice = chosen(against({"stiffness": mass * stiffness}, mass))
        assert (choice.method.name, choice.tolerance) == (name, tolerance)
        assert ("a stop throws back a joint" in choice.reason) == (tolerance is not None)
    assert chosen(against({"stiffness": 1.0, "damping": 100.0})).tolerance == CONTROLLED


def test_postures_in_which_a_joint_is_light_are_looked_at() -> None:
    """A load at the tip of two links, stretched at first, nearly vanishes when they fold."""
    scene = models.scene("two_link").model_dump(exclude_unset=True)
    scene |= {"initial": {}, "payloads": [{"frame": "tip", "mass": 50.0}]}
    for viscous, name in ((300.0, "rk4"), (2e4, "implicit")):
        joints = {"shoulder": {"friction": {"viscous": viscous}}}
        scene["joints"] = joints | {"elbow": {"actuator": {"rotor_inertia": 1e3}}}
        assert viscous / Dynamics(scene).mass_matrix([0.0, 0.0])[0, 0] * 1e-3 < STIFFNESS
        assert chosen(scene).method.name == name


def test_backlash_does_not_hide_the_stiffness_behind_it() -> None:
    """At rest between the teeth nothing pushes; in contact the shaft swings at √(k/J + k/Jm)."""
    soft = {"stiffness": 1e9, "backlash": 0.1}
    rate = rate_of(wheel(0.1, soft, command="torque", rotor_inertia=0.1))
    assert_close(rate / np.sqrt(1e9 / 0.1 + 1e9 / 0.1), 1.0, 1e-6)


def test_what_varies_with_the_position_gets_error_control() -> None:
    """A joint may pass its waves at any speed; back-EMF only slows it down."""
    motor = {"rotor_inertia": 4e-5, "gear_ratio": 100.0}
    waves = motor | {"cogging": {"amplitude": 0.05, "order": 12}}
    bent = {"stiffness": 1.0, "kinematic_error": {"amplitude": 1e-6, "order": 1}}
    table = {"coulomb": 1.0, "position": {"at": [0.0, 1.0], "factor": [1.0, 2.0]}}
    for joint, cause in (
        ({"actuator": waves}, "cogging"), ({"friction": table}, "friction varies"),
        ({"actuator": motor, "transmission": bent}, "drives with internal states"),
    ):  # fmt: skip
        found = chosen({**rotor(0.1), "joints": {"axle": joint}})
        assert (found.method.name, found.tolerance) == ("dop853", CONTROLLED)
        assert cause in found.reason
    damped = motor | {"command": "voltage", "resistance": 1.0, "torque_constant": 0.05}
    slowed = {**rotor(0.1), "joints": {"axle": {"actuator": damped}}}
    assert chosen(slowed, dt=0.5 / rate_of(slowed)).method.name == "rk4"


def test_friction_that_falls_fast_gets_error_control() -> None:
    """At a rate of sqrt(2/e) (Fs - Fc) / (J vs)."""
    for share, name in ((0.9, "rk4"), (1.1, "dop853")):
        speed = np.sqrt(2.0 / np.e) * 0.5 / (0.1 * share * STRIBECK_RATE * 1e3)
        law = {"coulomb": 1.0, "static": 1.5, "stribeck_velocity": speed}
        found = chosen(rotor(0.1, **law))
        assert found.method.name == name
        assert ("falling friction" in found.reason) == (name == "dop853")


def test_an_accuracy_that_is_asked_for_leads_the_tolerance() -> None:
    for accuracy in (1e-8, 1e-4):
        scene = bristles(0.1) | {"sim": {"accuracy": accuracy}}
        assert chosen(scene).tolerance == pytest.approx(SHARE_IMPLICIT * accuracy)
    spring = {
        "rail0": {"spring": {"stiffness": 1e4}},
        "rail1": {"friction": {"coulomb": 0.5, "lugre": {"sigma0": 1e5, "sigma1": 1.0}}},
    }
    beside = {"robot": {"urdf": rails(1.0, 1.0)}, "joints": spring}  # fmt: skip
    assert (chosen(beside).method.name, chosen(beside).tolerance) == ("implicit", CONTROLLED)


@pytest.mark.parametrize(("dt", "name"), [(1e-3, "rk4"), (2e-2, "dop853")])
def test_steps_of_fixed_length_are_kept_where_trial_motions_are_right(
    dt: float, name: str
) -> None:
    sim = models.simulator("double_pendulum", dt=dt)
    assert sim.choice.method.name == name and ("misses" in str(sim.plan)) == (name != "rk4")
    assert sim.run(0.5).trusted
    assert models.simulator("double_pendulum", integrator="rk4", dt=dt).choice.method.name == "rk4"


def test_a_light_joint_of_a_loop_moves_with_the_others() -> None:
    """A millionth of a kilogram that a cord ties to one kilogram, with friction: b/(m₀ + m₁)."""
    cord = {"type": "coupling", "joints": ["rail0", "rail1"], "ratio": 1.0}
    joints = {"rail0": {"friction": {"viscous": 10.0}}}
    alone = {"robot": {"urdf": rails(1e-6, 1.0)}, "joints": joints}
    assert_close(rate_of(alone), 1e7, 1.0)
    assert_close(rate_of({**alone, "constraints": [cord]}), 10.0, 1e-4)
    loose = {**cord, "switchable": True}
    assert_close(rate_of({**alone, "constraints": [loose]}), 1e7, 1.0)


def test_the_callers_word_comes_before_the_scenes() -> None:
    scene = {"robot": {"urdf": str(models.FOLDER / "gantry.urdf")},
             "sim": {"integrator": "dopri5", "dt": 2e-3, "tolerance": 1e-5}}  # fmt: skip
    own = chosen(scene)
    assert (own.method.name, own.dt, own.tolerance) == ("dopri5", 2e-3, 1e-5)
    other = chosen(scene, "rk4", 1e-2)
    assert (other.method.name, other.dt, other.tolerance) == ("rk4", 1e-2, None)
    assert chosen(scene, "auto").tolerance is None
    for dt, tolerance in ((1e-9, 1e-14), (10.0, 1e-1)):
        found = chosen(scene, dt=dt, tolerance=tolerance)
        assert (found.dt, found.tolerance) == (dt, tolerance)
    for bad in ({"dt": 0.9e-9}, {"dt": 10.1}, {"tolerance": 0.9e-14}, {"tolerance": 0.11}):
        with pytest.raises(InvalidInput, match="allowed"):
            chosen(scene, **bad)


def test_a_tick_that_is_long_for_an_arm_is_reported(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        chosen(rotor(0.1), dt=0.05)
        assert not caplog.records
        chosen(rotor(0.1), dt=1.0)
    assert "dt = 1 s is long for a time step" in caplog.text
