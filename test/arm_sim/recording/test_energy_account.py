# SPDX-License-Identifier: Apache-2.0
"""The energy account of a recording and of a running simulation, with and without laws' states."""

from typing import Any

import numpy as np
import pytest
from numpy.polynomial import Polynomial

import models
from arm_dynamics import Dynamics
from arm_sim import Simulator, State
from arm_sim.recording.energy_account import dissipated_work
from arm_sim.simulation.energy_meter import EnergyMeter
from arm_sim.simulation.runtime_changes import payload_change
from models.rotor import rotor
from tolerances import PINOCCHIO, assert_close

LUGRE = {
    "viscous": 0.5,
    "coulomb": 1.0,
    "static": 1.5,
    "stribeck_velocity": 0.01,
    "lugre": {"sigma0": 1e5, "sigma1": 300.0, "sigma1_velocity": 0.02},
}
DRY = {"viscous": 0.5, "coulomb": 0.5, "static": 0.8, "stribeck_velocity": 0.02}
MOTOR = {
    "command": "voltage", "resistance": 1.0, "inductance": 1e-3, "torque_constant": 0.05,
    "rotor_inertia": 5e-5, "gear_ratio": 100,
}  # fmt: skip
BELT = {"stiffness": 500.0, "damping": 0.3}
U = np.array([3.0, 5.0, -3.0])


def arm(*joints: dict[str, Any]) -> Simulator:
    """An arm in the plane whose three joints are as given."""
    scene = models.scene("planar_3r").model_dump(exclude_unset=True)
    names = models.dynamics("planar_3r").joint_names
    scene["joints"] = dict(zip(names, joints, strict=True))
    return Simulator(scene)


SCENES: dict[str, tuple[dict[str, Any], ...]] = {
    "bristles": ({"friction": LUGRE}, {"friction": LUGRE}, {"friction": {"viscous": 0.1}}),
    "dry friction, a belt with dry friction, a motor with bristles": (
        {"friction": DRY},
        {"friction": DRY, "actuator": MOTOR, "transmission": BELT},
        {"friction": LUGRE, "actuator": MOTOR},
    ),
}


@pytest.mark.parametrize("joints", SCENES.values(), ids=SCENES)
def test_the_balance_closes(joints: tuple[dict[str, Any], ...]) -> None:
    """Asked at the end, in the middle, and of the meter of a running simulation."""
    sim = arm(*joints)
    run = sim.run(0.1, U)
    moved = np.abs(run.kinetic).max() + np.abs(run.supplied).max()
    assert np.abs(run.balance).max() < 1e-7 * moved
    assert (np.diff(run.lost) >= 0.0).all() and run.lost[-1] > 0.0
    assert run.stored.max() > 0.0
    assert_close(run.energy, run.kinetic + run.potential + run.stored, 1e-12)
    assert run.supplied[0] == run.lost[0] == run.balance[0] == 0.0
    sim.reset()
    assert sim.run(0.05, U).balance.any()
    np.testing.assert_array_equal(sim.run(0.05, U).q[-1], run.q[-1])
    sim.reset()
    meter = EnergyMeter(sim.arm)
    for _ in range(20):
        sim.step(U)
        meter.note()
    account = meter.account()
    assert_close(account.total, run.energy[20], 1e-12)
    assert_close(account.input, run.supplied[20], 1e-7)
    assert_close(account.dissipated, run.lost[20], 1e-7)
    assert_close(account.balance, run.balance[20], 1e-7)


def test_a_motor_alone_loses_what_its_resistance_does() -> None:
    """No stops, no dry friction, fixed steps: the heat is R i², and b ω² of the joint."""
    scene = rotor(0.1, viscous=0.05)
    scene["joints"]["axle"]["actuator"] = MOTOR
    run = Simulator(scene, integrator="rk4", dt=1e-4).run(0.2, [12.0])
    heat = 1.0 * run.z[:, 0] ** 2 + 0.05 * run.v[:, 0] ** 2
    lost = np.sum(0.5 * (heat[1:] + heat[:-1])) * 1e-4
    assert_close(run.lost[-1], lost, 1e-4)
    assert np.abs(run.balance).max() < 1e-6


def test_the_balance_closes_over_stops() -> None:
    """Ticks near one are repeated, the others are not."""
    law = {"friction": {"viscous": 0.4}, "limits": {"lower": -0.6, "upper": 3.0}}
    scene = models.scene("two_link").model_dump(exclude_unset=True)
    run = Simulator(scene | {"joints": {"*": law}}, integrator="rk4").run(0.5)
    met = int(run.plant.model.stops.touched(run.q).any(axis=1).argmax())
    assert run.account.repeats(run.x) and not run.account.repeats(run.x[: met - 20])
    assert run.energy_error < 1e-6


def test_heat_of_friction_that_differs_by_position_and_load() -> None:
    """Simpson's rule needs the middle of a tick: known exactly of a cubic motion."""
    friction = {"viscous": 0.3, "coulomb": 0.5}
    friction |= {"position": {"at": [0.0, 1.0, 2.0], "factor": [1.0, 3.0, 1.5]},
                 "load": {"at": [0.0, 10.0], "factor": [1.0, 3.0]}}  # fmt: skip
    dyn, dt = Dynamics(rotor(**friction)), 0.5
    motion = Polynomial([0.2, 1.0, 0.8, -0.3])
    times = np.array([0.0, 0.5, 1.0])
    q, v, tau = motion(times)[:, None], motion.deriv()(times)[:, None], np.array([[3.0], [-7.0]])

    def power(t: float, load: float) -> float:
        speed = motion.deriv()(t)
        return float(dyn.friction([speed], q=[motion(t)], load=[load])[0] * speed)

    wanted = [
        dt / 6 * (power(t, load) + 4 * power(t + dt / 2, load) + power(t + dt, load))
        for t, load in zip(times, tau[:, 0], strict=False)
    ]
    x = np.hstack([q, v])
    assert_close(dissipated_work(dyn, dt, (x[:-1], x[1:]), tau), wanted, PINOCCHIO)


# --- what is changed while it runs ---------------------------------------------------------------

BALL = [0.02, 0.0, 0.0, 0.02, 0.0, 0.02]
LIGHT = [0.5, 0.0, 0.0, 0.1, *BALL]
HEAVY = [2.0, 0.05, 0.0, 0.2, *BALL]
MOON = [0.0, 0.5, -1.62]
ALL = ["gravity", "payload", "friction", "external"]


def load(row: list[float]) -> dict[str, Any]:
    return {"frame": "tip", "mass": row[0], "com": row[1:4], "inertia": row[4:]}


def tunable_scene(joints: dict[str, Any], **changed: Any) -> dict[str, Any]:
    scene = models.scene("two_link").model_dump(exclude_unset=True)
    return {**scene, "joints": joints, "payloads": [load(LIGHT)], "tunable": ALL} | changed


JOINTS: dict[str, tuple[dict[str, Any], float]] = {
    "dry friction": ({"*": {"friction": {"viscous": 0.3, "coulomb": 0.2, "static": 0.4}}}, 1e-8),
    "a motor": ({"shoulder": {"actuator": MOTOR, "friction": {"viscous": 0.3}}}, 1e-6),
}
CHANGES: dict[str, Any] = {
    "gravity": lambda sim: sim.set_parameter("gravity", MOON),
    "payload": lambda sim: payload_change(sim, 0, HEAVY[0], HEAVY[1:4], HEAVY[4:])(),
    "friction": lambda sim: sim.set_parameter("friction", [2.0, 0.0]),
    "external": lambda sim: sim.set_parameter("external", [3.0, -2.0]),
    "state": lambda sim: sim.set_state([0.4, -0.3], [1.0, 2.0], sim.state.z),
}


@pytest.fixture(scope="module", params=JOINTS.values(), ids=JOINTS)
def tuned(request: pytest.FixtureRequest) -> tuple[Simulator, float]:
    joints, allowed = request.param
    return Simulator(tunable_scene(joints)), allowed


def restart(sim: Simulator) -> None:
    for item in sim.arm.plant.parameters.items:
        sim.set_parameter(item.name, item.nominal)
    sim.reset([0.5, -0.8], [0.3, -0.2])


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_the_account_closes_over_changes_in_a_run(
    tuned: tuple[Simulator, float], change: Any
) -> None:
    """Changed in the middle, and back by another: the account says what each put in."""
    sim, allowed = tuned
    restart(sim)
    after: list[float] = []

    def control(state: State) -> list[float]:
        if state.step == 60:
            change(sim)
            here = sim.state
            after.append(sum(sim.dynamics.energy(here.q, here.v)))
        return [1.0, 0.5]

    run = sim.run(0.1, control)
    moved = np.ptp(run.kinetic) + np.ptp(run.potential)
    assert np.abs(run.balance).max() < allowed * moved
    assert run.energy_error < allowed
    assert not run.changed[:60].any()
    assert (run.changed[60:] == run.changed[60]).all()
    assert run.kinetic[60] + run.potential[60] == pytest.approx(after[0], rel=1e-12)


def test_a_change_puts_in_what_the_energies_differ_by(tuned: tuple[Simulator, float]) -> None:
    """Against two arms that were built with the one payload and gravity, and the other."""
    sim, _ = tuned
    restart(sim)

    def control(state: State) -> list[float]:
        if state.step == 0:
            sim.set_parameter("gravity", MOON)
        if state.step == 5:
            sim.set_parameter("payload", HEAVY)
        return [0.0, 0.0]

    run = sim.run(0.01, control)
    joints = sim.model.scene.model_dump(exclude_unset=True)["joints"]
    arms = [
        Dynamics(tunable_scene(joints, **changed))
        for changed in ({}, {"gravity": MOON}, {"gravity": MOON, "payloads": [load(HEAVY)]})
    ]
    for row, before, now, sofar in ((0, *arms[:2], 0.0), (5, *arms[1:], run.changed[4])):
        q, v = run.q[row], run.v[row]
        put_in = sum(now.energy(q, v)) - sum(before.energy(q, v))
        assert run.changed[row] - sofar == pytest.approx(put_in, rel=1e-10)
        assert abs(put_in) > 0.1
    assert run.balance[0] == 0.0


def test_pushes_supply_work_in_smooth_ticks() -> None:
    """Which are not repeated."""
    scene = tunable_scene({"*": {"friction": {"viscous": 0.3}}}, tunable=["external"])
    sim = Simulator(scene, integrator="rk4")

    def control(state: State) -> list[float]:
        sim.set_parameter("external", [2.0 * np.sin(state.step), 1.0])
        return [0.0, 0.0]

    run = sim.run(0.1, control)
    assert np.abs(run.balance).max() < 1e-8 and not run.changed.any()
    assert run.supplied[-1] == pytest.approx(
        np.sum(run.p[:-1] * np.diff(run.q, axis=0)), rel=1e-12
    )


def test_multipliers_are_of_the_constraints_that_hold_at_each_time() -> None:
    """Let go in the middle of a run: the plane has borne the arm, and a push, until then."""
    plane = {"type": "plane", "frames": ["tip", "world"], "height": -0.3}
    scene = {
        "robot": models.scene("two_link").robot.model_dump(),
        "constraints": [plane | {"name": "table", "switchable": True}],
        "initial": {"position": {"shoulder": 0.3, "elbow": 0.1}}, "tunable": ["external"],
    }  # fmt: skip
    sim, push = Simulator(scene, backend="vm"), [2.0, -1.0]
    sim.set_parameter("external", push)
    start, held = sim.state, sim.run(0.02).multipliers
    expected = Dynamics(sim.model).constrained_forward(start.q, start.v, np.array(push))[1]
    assert_close(held[0], expected, PINOCCHIO)
    sim.reset()

    def control(state: State) -> list[float]:
        if state.step == 10:
            sim.set_constraint("table", False)
        return [0.0, 0.0]

    found = (run := sim.run(0.02, control)).multipliers
    assert abs(held).min() > 1.0
    assert_close(found[:10], held[:10], PINOCCHIO)
    assert not found[10:].any()
    assert run.part(run.time > 1.0).multipliers.shape == (0, 1)


# --- how much of it is unexplained ---------------------------------------------------------------


def test_unexplained_energy_is_relative_to_what_moved() -> None:
    run = Simulator(models.scene("two_link"), integrator="euler", dt=0.02).run(1.0)
    moved = sum(np.ptp(part) for part in (run.kinetic, run.potential, run.supplied, run.lost))
    share = abs(run.balance).max() / moved
    assert share > 1e-3
    assert run.energy_error == pytest.approx(share, rel=1e-6)
    assert Simulator(models.scene("two_link"), integrator="rk4").run(0.5).energy_error < 1e-6
