# SPDX-License-Identifier: Apache-2.0
"""A gear that loses power: every direction of power flow, standing still, and the energy."""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import Dynamics, Term
from arm_dynamics.control.friction_compensation import friction_feed_forward
from arm_sim import Simulator
from models.driven import wheel
from tolerances import PINOCCHIO, assert_close

ETA, LINK = 0.7, 0.1
GEAR = {"gear_ratio": 50.0, "efficiency": ETA}


def pendulum() -> dict[str, Any]:
    """One kilogram on one metre, held out horizontally: a load of 9.81 N m."""
    urdf = models.scene("pendulum").robot.urdf
    joints = {"swing": {"actuator": GEAR}}
    return {
        "robot": {"urdf": urdf},
        "joints": joints,
        "initial": {"position": {"swing": np.pi / 2}},
    }


@pytest.mark.parametrize("speed", [3.0, -3.0])
@pytest.mark.parametrize("torque", [0.8, -0.8])
def test_four_quadrants(speed: float, torque: float) -> None:
    """Driving, η of the torque arrives; braking, the link feels 1/η of it.

    The loss does not see the torque that turns the rotor faster or slower.
    """
    sim = Simulator(wheel(LINK, rotor_inertia=4e-5, **GEAR))
    sim.reset([0.0], [speed])
    sim.run(0.1, [torque])
    inertia = LINK + 4e-5 * 50.0**2
    arrives = torque * (ETA if torque * speed > 0.0 else 1.0 / ETA)
    assert_close(sim.state.v, [speed + arrives / inertia * 0.1], 1e-12)
    acceleration = Dynamics(sim.model).forward([0.0], [speed], [torque])
    assert_close(acceleration, [arrives / inertia], PINOCCHIO)


def test_at_rest_the_gear_holds() -> None:
    """Between η and 1/η of the load the arm stands, to the bit; beyond, it moves."""
    sim = Simulator(pendulum())
    for share in (ETA * 1.001, 1.0, 0.999 / ETA):
        sim.reset()
        sim.run(1.0, [9.81 * share])
        assert sim.state.q[0] == np.pi / 2 and sim.state.v[0] == 0.0
    for share, way in ((ETA * 0.999, -1.0), (1.001 / ETA, 1.0)):
        sim.reset()
        sim.run(0.5, [9.81 * share])
        assert way * sim.state.v[0] > 1e-3


@pytest.mark.parametrize("kind", ["position", "load"])
@pytest.mark.parametrize(("part", "moves"), [(0.999, False), (1.001, True)])
def test_beside_dry_friction_that_its_table_triples(kind: str, part: float, moves: bool) -> None:
    """1.5 N m at this place, or under any load, beside what the teeth hold."""
    scene = pendulum()
    tripled = {"at": [0.0, np.pi / 2], "factor": [1.0, 3.0]} if kind == "position" else {
        "at": [0.0, 0.1], "factor": [2.99, 3.0]}  # fmt: skip
    scene["joints"]["swing"]["friction"] = {"coulomb": 0.5, kind: tripled}
    sim = Simulator(scene)
    limits = ETA * (9.81 - 1.5), (9.81 + 1.5) / ETA
    for torque, way in ((limits[0] * (2.0 - part), -1.0), (limits[1] * part, 1.0)):
        sim.reset()
        sim.run(0.2, [torque])
        assert way * sim.state.v[0] > 1e-4 if moves else sim.state.v[0] == 0.0


def test_feed_forward_of_friction_overcomes_the_gear(rng: np.random.Generator) -> None:
    """At a brisk speed the reference's friction, the gear's included, is what is added."""
    scene = models.scene("two_link").model_dump(exclude_unset=True)
    scene["joints"] = {"*": {"actuator": GEAR, "friction": {"viscous": 0.2, "coulomb": 0.5}}}
    dyn = Dynamics(scene)
    q, v, a = models.random_state(rng, 2)
    v += 0.5 * np.sign(v)  # where the smoothed sign of the feed-forward is one
    rigid = dyn.inverse(q, v, a, terms=Term.ALL & ~Term.FRICTION)
    added, still = (friction_feed_forward(dyn.steady_friction, x, q, rigid) for x in (v, 0.0 * v))
    assert_close(rigid + added, dyn.inverse(q, v, a), 1e-9)
    assert_close(still, np.zeros(2), PINOCCHIO)


def test_behind_a_spring_its_torque_arrives_in_part() -> None:
    """Turning steadily against viscous friction: b v = η τ, with the balance of energy."""
    scene = wheel(LINK, {"stiffness": 500.0, "damping": 5.0}, rotor_inertia=1e-5, **GEAR)
    scene["joints"]["axle"]["friction"] = {"viscous": 0.5}
    sim = Simulator(scene)
    recording = sim.run(4.0, [-2.0])
    assert_close(sim.state.v, [-ETA * 2.0 / 0.5], 1e-6)
    assert abs(recording.balance).max() < 1e-7


@pytest.mark.parametrize(("speed", "torque"), [(3.0, 0.8), (-3.0, 0.8)])
def test_beside_friction_that_grows_with_the_load(speed: float, torque: float) -> None:
    """Bearings, whose table says 1.2 at this torque, and teeth, both loaded by the motor."""
    friction = {"coulomb": 0.1, "load": {"at": [0, 0.8, 8], "factor": [1, 1.2, 3]}}
    scene = wheel(LINK, **GEAR)
    (joint,) = scene["joints"].values()
    joint["friction"] = friction
    dyn = Dynamics(scene)
    arrives = torque * (ETA if torque * speed > 0.0 else 1.0 / ETA)
    known = (arrives - np.sign(speed) * 0.1 * 1.2) / LINK
    assert_close(dyn.forward([0.0], [speed], [torque]), [known], PINOCCHIO)
    assert_close(dyn.inverse([0.0], [speed], [known]), [torque], PINOCCHIO)
