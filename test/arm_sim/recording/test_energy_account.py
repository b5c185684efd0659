# SPDX-License-Identifier: Apache-2.0
"""The energy account of a recording and of a running simulation, with and without laws' states."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.polynomial import Polynomial

import models
from arm_dynamics import Dynamics
from arm_sim import Simulator
from arm_sim.recording.energy_account import dissipated_work
from arm_sim.ros.energy_meter import EnergyMeter
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
    "command": "voltage",
    "resistance": 1.0,
    "inductance": 1e-3,
    "torque_constant": 0.05,
    "rotor_inertia": 5e-5,
    "gear_ratio": 100,
}
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


@pytest.fixture(scope="module", params=SCENES.values(), ids=SCENES)
def sim(request: pytest.FixtureRequest) -> Simulator:
    return arm(*request.param)


def test_the_balance_closes(sim: Simulator) -> None:
    sim.reset()
    run = sim.run(0.1, U)
    moved = np.abs(run.kinetic).max() + np.abs(run.supplied).max()
    assert np.abs(run.balance).max() < 1e-7 * moved
    assert (np.diff(run.lost) >= 0.0).all() and run.lost[-1] > 0.0
    assert run.stored.max() > 0.0
    assert_close(run.energy, run.kinetic + run.potential + run.stored, 1e-12)
    assert run.supplied[0] == run.lost[0] == run.balance[0] == 0.0


def test_nothing_is_built_before_it_is_asked_for(
    sim: Simulator, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise RuntimeError("the account is being built")

    fresh = Simulator(sim.model)
    monkeypatch.setattr("arm_sim.recording.energy_account.Stepper", refuse)
    run = fresh.run(0.01, U)
    with pytest.raises(RuntimeError, match="being built"):
        run.balance  # noqa: B018 - asking is what builds it
    monkeypatch.undo()
    assert run.balance.shape == (11,)


def test_the_account_does_not_disturb_the_motion(sim: Simulator) -> None:
    sim.reset()
    alone = sim.run(0.05, U)
    sim.reset()
    watched = sim.run(0.025, U)
    assert watched.balance.any()
    rest = sim.run(0.025, U)
    assert np.array_equal(rest.q[-1], alone.q[-1])


def test_without_laws_it_is_the_work_of_torques() -> None:
    sim = arm(*[{"friction": {"viscous": 0.4, "coulomb": 0.0}}] * 3)
    run = sim.run(0.1, U)
    work = np.cumsum(np.sum(run.tau[:-1] * np.diff(run.q, axis=0), axis=1))
    assert_close(run.supplied[1:], work, 1e-12)
    assert not run.stored.any()
    assert np.abs(run.balance).max() < 1e-6
    assert sim.energy_account.makes_ticks_again is False


def test_tunable_quantities_are_those_of_the_run() -> None:
    scene = models.scene("two_link").model_dump(exclude_unset=True)
    law = {"viscous": 0.2, "coulomb": 0.3, "lugre": {"sigma0": 1e4, "sigma1": 20.0}}
    scene |= {"joints": {"*": {"friction": law}}, "tunable": ["gravity"]}
    sim = Simulator(scene)
    sim.set_parameter("gravity", [0.0, 0.0, -1.62])
    run = sim.run(0.1, [0.5, 0.1])
    sim.set_parameter("gravity", [0.0, 0.0, -9.81])
    kept = run.kinetic + run.stored + run.potential * 1.62 / 9.81
    assert_close(kept - kept[0] - run.supplied + run.lost, np.zeros(101), 1e-7)


def test_the_meter_of_a_running_simulation_says_the_same(sim: Simulator) -> None:
    sim.reset()
    recorded = sim.run(0.02, U)
    sim.reset()
    meter = EnergyMeter(sim)
    for _ in range(20):
        sim.step(U)
        meter.note()
    account = meter.account()
    assert_close(account.total, recorded.energy[-1], 1e-12)
    assert_close(account.input, recorded.supplied[-1], 1e-7)
    assert_close(account.dissipated, recorded.lost[-1], 1e-7)
    assert_close(account.balance, recorded.balance[-1], 1e-7)


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
    assert_close(dissipated_work(dyn, dt, q, v, tau), wanted, PINOCCHIO)
