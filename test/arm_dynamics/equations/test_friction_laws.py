# SPDX-License-Identifier: Apache-2.0
"""Friction that differs by direction, position and load: moving, at rest, inverted."""

from typing import Any

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

import models
from arm_dynamics.equations.interpolation import Curve
from arm_sim import Simulator
from models.rotor import rotor
from tolerances import ALGEBRA, INVERSE_PAIR, assert_close

J = 0.1
SIDES = {"positive": 0.6, "negative": 0.4}
HOLDS = {"positive": 0.9, "negative": 0.5}
BY_PLACE = {"at": [-1.0, 0.0, 2.0], "factor": [1.0, 2.0, 0.5]}
BY_LOAD = {"at": [0.0, 10.0], "factor": [1.0, 3.0]}


def wheel(**friction: Any) -> Simulator:
    return Simulator(rotor(J, **friction), integrator="rk4")


def test_viscous_friction_by_direction() -> None:
    """v = v0 e^(-b t / J), with the b of the direction."""
    sim = wheel(viscous={"positive": 0.2, "negative": 0.05}, coulomb=0.0)
    for v0, b in ((2.0, 0.2), (-2.0, 0.05)):
        sim.reset(v=[v0])
        assert_close(sim.run(1.0).v[-1], [v0 * np.exp(-b / J)], 1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_dry_friction_by_direction(sign: float) -> None:
    """It holds up to the level of that direction, and coasts to rest under the other one's."""
    sim = wheel(coulomb=SIDES, static=HOLDS)
    holds = HOLDS["positive" if sign > 0 else "negative"]
    slides = SIDES["positive" if sign > 0 else "negative"]
    assert not sim.run(0.1, [sign * holds * (1.0 - 1e-12)]).q.any()
    sim.step([sign * holds * (1.0 + 1e-9)])
    assert sign * sim.state.v[0] > 0.0
    sim.reset(v=[sign * 1.0])
    run = sim.run(1.0)
    assert_close(run.q[-1], [sign * J / (2.0 * slides)], 1e-9)
    assert run.v[-1, 0] == 0.0


def test_dry_friction_by_position() -> None:
    """A joint under a constant torque stops where it has done its work against the table."""
    sim = wheel(coulomb=0.5, position=BY_PLACE)
    curve = Curve.through(np.array(BY_PLACE["at"]), np.array(BY_PLACE["factor"]))
    sim.reset(q=[-1.0], v=[2.0])
    run = sim.run(1.0)
    assert run.v[-1, 0] == 0.0
    path = np.linspace(-1.0, run.q[-1, 0], 20001)
    force = 0.5 * curve(path)
    work = 0.5 * (force[1:] + force[:-1]) @ np.diff(path)
    assert_close(work, 0.5 * J * 2.0**2, 1e-7)


def test_break_away_under_load() -> None:
    """Where tau = Fs f(tau)."""
    sim = wheel(coulomb=0.5, static=0.5, load={"at": [0.0, 2.0], "factor": [1.0, 1.4]})
    curve = Curve.through(np.array([0.0, 2.0]), np.array([1.0, 1.4]))
    level = brentq(lambda tau: tau - 0.5 * float(curve(tau)), 0.5, 1.0, xtol=1e-14)
    for sign in (1.0, -1.0):
        sim.reset()
        assert not sim.run(0.1, [sign * level * (1.0 - 1e-9)]).q.any()
        assert sign * sim.step([sign * level * (1.0 + 1e-9)]).v[0] > 0.0


def test_inverse_dynamics_is_the_inverse(rng: np.random.Generator) -> None:
    """Torques that include friction by direction, place and load give the motion they were for."""
    scene = models.scene("two_link").model_dump(exclude_unset=True)
    friction = {"viscous": {"positive": 0.5, "negative": 0.2}, "coulomb": SIDES}
    scene["joints"] = {"*": {"friction": friction | {"position": BY_PLACE, "load": BY_LOAD}}}
    sim = Simulator(scene)
    dyn = sim.dynamics
    for _ in range(20):
        q, v, a = models.random_state(rng, 2)
        tau = dyn.inverse(q, v, a)
        assert_close(dyn.forward(q, v, tau), a, INVERSE_PAIR)
        p = np.r_[sim.arm.plant.parameters.nominal, np.sign(v)]
        found = np.array(sim.arm.plant.mechanics.acceleration(q, v, tau, p)).ravel()
        assert_close(found, a, INVERSE_PAIR)
        rigid = dyn.inverse(q, v, a, terms=7)
        assert_close(tau - rigid, dyn.friction(v, q=q, load=tau), ALGEBRA)


def test_curve_is_smooth_and_stays_between_its_points(rng: np.random.Generator) -> None:
    for period in (0.0, 6.0):
        at, values = np.sort(rng.uniform(0.0, 5.0, 7)), rng.uniform(0.5, 2.0, 7)
        curve = Curve.through(at, values, period)
        assert_close([float(curve(x)) for x in at], values, ALGEBRA)
        x = np.linspace(-8.0, 12.0, 40001)
        y = curve(x)
        assert y.min() >= values.min() - 1e-12 and y.max() <= values.max() + 1e-12
        slope = np.diff(y) / np.diff(x)
        assert np.abs(np.diff(slope)).max() < 0.05 * max(1.0, np.abs(slope).max())
        for a, b, low, high in zip(at, at[1:], values, values[1:], strict=False):
            between = curve(np.linspace(a, b, 100))
            assert (np.diff(between) * (high - low) >= -1e-12).all()
        if period:
            assert_close(curve(x + period), y, 1e-9)


def test_slopes_of_uneven_points_are_those_of_fritsch_and_butland() -> None:
    """The library SciPy has the same curve between inner points; at the ends it differs."""
    at, values = np.array([0.0, 1.0, 1.2, 4.0, 4.5, 6.0]), np.array([1.0, 1.1, 2.0, 2.2, 3.0, 3.5])
    x = np.linspace(1.0, 4.5, 200)
    wanted = PchipInterpolator(at, values)(x)
    assert_close(Curve.through(at, values)(x), wanted, ALGEBRA)


def test_the_direction_decides_where_a_joint_stands_still() -> None:
    """At rest the level that is about to act; in motion its sign is that of the direction."""
    dyn = wheel(coulomb=SIDES, static=HOLDS, stribeck_velocity=0.1, viscous=0.5).dynamics
    for way, level in ((0.3, HOLDS["positive"]), (-5.0, -HOLDS["negative"]), (0.0, 0.0)):
        assert_close(dyn.friction([0.0], direction=[way]), [level], ALGEBRA)
    assert_close(dyn.friction([0.0]), [0.0], ALGEBRA)
    slow = np.array([[0.01], [0.01]])
    both = dyn.friction(slow, direction=[[1.0], [-1.0]])
    fall = np.exp(-0.01)
    wanted = [0.6 + 0.3 * fall + 0.005, -(0.4 + 0.1 * fall) + 0.005]
    assert_close(both.ravel(), wanted, ALGEBRA)
