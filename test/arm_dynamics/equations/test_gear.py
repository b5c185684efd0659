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


def pendulum(**drive: Any) -> dict[str, Any]:
    """One kilogram on one metre, held out horizontally: a load of 9.81 N m."""
    urdf = models.scene("pendulum").robot.urdf
    joints = {"swing": {"actuator": GEAR | drive}}
    return {
        "robot": {"urdf": urdf},
        "joints": joints,
        "initial": {"position": {"swing": np.pi / 2}},
    }


@pytest.mark.parametrize("speed", [3.0, -3.0])
@pytest.mark.parametrize("torque", [0.8, -0.8])
def test_four_quadrants(speed: float, torque: float) -> None:
    """Driving, η of the torque arrives; braking, the link feels 1/η of it."""
    sim = Simulator(wheel(LINK, **GEAR))
    sim.reset([0.0], [speed])
    sim.run(0.1, [torque])
    arrives = torque * (ETA if torque * speed > 0.0 else 1.0 / ETA)
    assert_close(sim.state.v, [speed + arrives / LINK * 0.1], 1e-12)
    acceleration = Dynamics(sim.model).forward([0.0], [speed], [torque])
    assert_close(acceleration, [arrives / LINK], PINOCCHIO)


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


def test_falling_with_the_motor_as_a_brake_takes_energy_out() -> None:
    """What the motor absorbs is η of what the weight gives."""
    sim = Simulator(pendulum())
    recording = sim.run(0.6, [9.81 * 0.5])
    energy = recording.energy
    travelled = recording.q[:, 0] - recording.q[0, 0]
    assert travelled[-1] < -0.3
    assert_close(energy - energy[0], 9.81 * 0.5 / ETA * travelled, 1e-8)


@pytest.mark.parametrize(("share", "way"), [(0.999, -1.0), (1.001, 0.0)])
def test_going_down_the_friction_of_that_direction_holds_too(share: float, way: float) -> None:
    """The arm falls where η of the load less its friction downwards exceeds the motor's torque."""
    scene = pendulum()
    sides = {"coulomb": {"positive": 3.0, "negative": 0.5}}
    scene["joints"]["swing"]["friction"] = {**sides, "static": {"positive": 4.0, "negative": 1.0}}
    sim = Simulator(scene)
    sim.run(1.0, [(9.81 - 1.0) * ETA * share])
    assert (sim.state.q[0] == np.pi / 2) == (way == 0.0)
    assert way * sim.state.v[0] >= 0.0
    up = Simulator(scene)
    up.run(1.0, [(9.81 + 4.0) / ETA * 0.999])
    assert up.state.q[0] == np.pi / 2
    up.run(1.0, [(9.81 + 4.0) / ETA * 1.001])
    assert up.state.v[0] > 0.5


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


# --- what the loss does not see: the torque that turns the rotor faster or slower ---------------

ROTOR = 4e-5  # [kg m²]; at the joint 0.1, as much as the link has


def by_power_flow(torque: float, load: float, way: float) -> float:
    """Acceleration of a wheel if the loss is that of what passes the teeth, τ - J N² q̈.

    Link: M q̈ + h = g(τ - J N² q̈), with g(x) = η x where the rotor drives, x s > 0, else x / η:
    rising in q̈ on the left, falling on the right, so that one of the two is the answer.
    """
    J = ROTOR * GEAR["gear_ratio"] ** 2
    answers = []
    for share in (ETA, 1.0 / ETA):
        a = (share * torque - load) / (LINK + share * J)
        passes = (torque - J * a) * way
        answers += [a] if (passes >= 0.0) == (share < 1.0) else []
    assert len(answers) == 1
    return answers[0]


CASES = [(3.0, 1.0, 1.0), (3.0, -1.0, -1.0), (-0.4, 1.0, 1.0), (0.4, 0.0, -1.0)]


@pytest.mark.parametrize(("torque", "load", "way"), CASES)
def test_the_rotors_inertia_makes_at_most_this_difference(
    torque: float, load: float, way: float
) -> None:
    """The loss is 1/η - 1 of what passes at most, and J N² |q̈| of that is not seen; see
    docs/concepts/drives.md.
    """
    scene = wheel(LINK, rotor_inertia=ROTOR, **GEAR) | {"tunable": ["external"]}
    sim = Simulator(scene)
    sim.set_parameter("external", [-load])
    sim.reset([0.0], [2.0 * way])
    found = (sim.step([torque]).v[0] - 2.0 * way) / sim.dt
    J, exact = ROTOR * GEAR["gear_ratio"] ** 2, by_power_flow(torque, load, way)
    difference = (LINK + J) * abs(found - exact)
    assert difference <= (1.0 / ETA - 1.0) * J * abs(exact) + 1e-9
    driving = min(torque * way, (torque - J * exact) * way) > 0.0
    if driving:  # and then the difference is this one
        assert_close(difference, (1.0 - ETA) * J * abs(exact), 1e-9)


def test_behind_a_spring_it_holds() -> None:
    """A load that the gear can hold does not move, however the rotor moves."""
    scene = pendulum(rotor_inertia=1e-4)
    scene["joints"]["swing"]["transmission"] = {"stiffness": 2e3, "damping": 20.0}
    sim = Simulator(scene)
    sim.set_state(z=[np.pi / 2 + 9.81 / 2e3, 0.0])
    sim.run(1.0, [9.81 * 1.2])
    assert sim.state.v[0] == 0.0 and sim.state.q[0] == np.pi / 2
    assert abs(sim.state.z[0] - np.pi / 2 - 9.81 * 1.2 / 2e3) < 1e-4


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
