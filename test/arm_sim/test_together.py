# SPDX-License-Identifier: Apache-2.0
"""Friction, drives, bilateral constraints and contact in one scene, against closed forms.

A sledge on a table is tied by a cord over a pulley to a weight: a coupling of two rails, a contact
with friction, and what else a test adds. All of it moves as one coordinate does.
"""

from typing import Any

import numpy as np

from arm_sim import Simulator
from models.touching import carrier, contact, rails
from tolerances import CLOSED_FORM, assert_close

G = 9.81
SLEDGE, WEIGHT = 2.0, 1.5
CORD = {"type": "coupling", "name": "cord", "joints": ["x", "drive"], "ratio": -1.0}


def sledge(*contacts: dict[str, Any], **scene: Any) -> dict[str, Any]:
    """The scene: joints ``drive`` (upwards, of the weight), ``x`` and ``z`` (of the sledge)."""
    plain = rails("xz", SLEDGE, branches=[carrier("prismatic", "z", WEIGHT)])
    return {**plain, "constraints": [CORD, *contacts], **scene}


def table(mu: float, **settings: Any) -> dict[str, Any]:
    return contact("body", name="table", friction=mu, **settings)


def test_dry_friction_in_the_rails_resists_too() -> None:
    """Loop, sliding contact and dry friction in both rails, thrown against gravity and back."""
    dry = {"friction": {"coulomb": 2.0, "static": 3.0}}
    sim = Simulator(sledge(table(0.2), joints={"x": dry, "drive": dry}))
    sim.reset(v=[3.0, -3.0, 0.0])
    mass, level = WEIGHT + SLEDGE, 4.0 + 0.2 * SLEDGE * G
    slow, fast = (WEIGHT * G + level) / mass, (WEIGHT * G - level) / mass
    turn = 3.0 / slow
    run = sim.run(1.5)
    t = run.time
    back = 0.5 * fast * np.maximum(t - turn, 0.0) ** 2
    wanted = np.where(t < turn, -3.0 * t + 0.5 * slow * t**2, -4.5 / slow + back)
    assert_close(run.q[:, 1], wanted, 1e-11)
    assert_close(run.balance, np.zeros(len(run)), 1e-8)


def test_what_friction_of_both_kinds_holds_does_not_move_by_a_bit() -> None:
    """The table holds a part of the weight, the rails the rest; neither could alone."""
    dry = {"friction": {"coulomb": 3.0}}
    sim = Simulator(sledge(table(0.5), joints={"x": dry, "drive": dry}))
    start = sim.state.q.copy()
    run = sim.run(2.0)
    assert (run.q == start).all() and (run.v == 0.0).all()
    assert abs(run.multipliers[-1, 0]) <= WEIGHT * G  # the rails hold a part of it
    assert Simulator(sledge(table(0.4), joints={"x": dry})).run(0.1).v[-1, 1] > 0.0


def test_a_blow_goes_through_the_cord() -> None:
    """The weight meets the ground with speed v: it and the sledge go on with -e v."""
    ground = contact("tray", name="ground", restitution=0.5, plane={"point": [0, 0, -0.5]})
    sim = Simulator(sledge(table(0.0), ground))
    hit = np.sqrt(2.0 * 0.5 * (WEIGHT + SLEDGE) / (WEIGHT * G))  # dropped from rest
    speed = WEIGHT * G / (WEIGHT + SLEDGE) * hit
    run = sim.run(hit + 0.05)
    after, a = run.time[-1] - hit, WEIGHT * G / (WEIGHT + SLEDGE)
    assert_close(run.q[-1, 1], 0.5 - 0.5 * speed * after + 0.5 * a * after**2, 1e-10)
    assert_close(-run.q[-1, 0], run.q[-1, 1], CLOSED_FORM)
    lost = 0.5 * (WEIGHT + SLEDGE) * speed**2 * (1 - 0.5**2)
    assert_close(run.lost[-1], lost, 1e-9)
    assert_close(run.balance, np.zeros(len(run)), 1e-9)
