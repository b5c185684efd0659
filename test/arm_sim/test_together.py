# SPDX-License-Identifier: Apache-2.0
"""Friction, drives, bilateral constraints and contact in one scene, against closed forms.

A sledge on a table is tied by a cord over a pulley to a weight: a coupling of two rails, a contact
with friction, and what else a test adds. All of it moves as one coordinate does.
"""

from typing import Any

import numpy as np

import models
from arm_sim import Simulator
from models.touching import contact
from tolerances import CLOSED_FORM, assert_close

G = 9.81
SLEDGE, WEIGHT = 2.0, 1.5


def link(name: str, mass: float = 0.0) -> str:
    inertia = 'ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"'
    body = f'<inertial><mass value="{mass}"/><inertia {inertia}/></inertial>' if mass else ""
    return f'<link name="{name}">{body}</link>'


def rail(name: str, parent: str, child: str, axis: str) -> str:
    return f"""<joint name="{name}" type="prismatic"><parent link="{parent}"/>
      <child link="{child}"/><axis xyz="{axis}"/>
      <limit lower="-9" upper="9" effort="1e9" velocity="1e9"/></joint>"""


URDF = f"""<robot name="sledge">{link("base")}{link("runner")}{link("sledge", SLEDGE)}
  {link("weight", WEIGHT)}{rail("along", "base", "runner", "1 0 0")}
  {rail("up", "runner", "sledge", "0 0 1")}{rail("drop", "base", "weight", "0 0 -1")}</robot>"""
CORD = {"type": "coupling", "name": "cord", "joints": ["along", "drop"], "ratio": 1.0}


def sledge(*contacts: dict[str, Any], **scene: Any) -> dict[str, Any]:
    """The scene: joints ``along``, ``up`` (both of the sledge) and ``drop`` (of the weight)."""
    return {"robot": {"urdf": URDF}, "constraints": [CORD, *contacts], **scene}


def table(mu: float, **settings: Any) -> dict[str, Any]:
    return contact("sledge", name="table", friction=mu, **settings)


def test_dry_friction_in_the_rails_resists_too() -> None:
    """Loop, sliding contact and dry friction in both rails, thrown against gravity and back."""
    rails = {name: {"friction": {"coulomb": 2.0, "static": 3.0}} for name in ("along", "drop")}
    sim = Simulator(sledge(table(0.2), joints=rails))
    sim.reset(v=[-3.0, 0.0, -3.0])
    mass, dry = WEIGHT + SLEDGE, 4.0 + 0.2 * SLEDGE * G
    slow, fast = (WEIGHT * G + dry) / mass, (WEIGHT * G - dry) / mass
    turn = 3.0 / slow
    run = sim.run(1.5)
    t = run.time
    back = 0.5 * fast * np.maximum(t - turn, 0.0) ** 2
    wanted = np.where(t < turn, -3.0 * t + 0.5 * slow * t**2, -4.5 / slow + back)
    assert_close(run.q[:, 0], wanted, 1e-11)
    assert_close(run.balance, np.zeros(len(run)), 1e-8)


def test_what_friction_of_both_kinds_holds_does_not_move_by_a_bit() -> None:
    """The table holds a part of the weight, the rails the rest; neither could alone."""
    rails = {name: {"friction": {"coulomb": 3.0}} for name in ("along", "drop")}
    sim = Simulator(sledge(table(0.5), joints=rails))
    start = sim.state.q.copy()
    run = sim.run(2.0)
    assert (run.q == start).all() and (run.v == 0.0).all()
    assert abs(run.multipliers[-1, 0]) <= WEIGHT * G  # the rails hold a part of it
    moves = Simulator(sledge(table(0.4), joints={"along": {"friction": {"coulomb": 3.0}}})).run(
        0.1
    )
    assert moves.v[-1, 0] > 0.0


def test_a_blow_goes_through_the_cord() -> None:
    """The weight meets the ground with speed v: it and the sledge go on with -e v."""
    ground = contact(
        "weight",
        name="ground",
        restitution=0.5,
        plane={"point": [0, 0, -0.5], "normal": [0, 0, 1]},
    )
    sim = Simulator(sledge(table(0.0), ground))
    hit = np.sqrt(2.0 * 0.5 * (WEIGHT + SLEDGE) / (WEIGHT * G))  # dropped from rest
    speed = WEIGHT * G / (WEIGHT + SLEDGE) * hit
    run = sim.run(hit + 0.05)
    after, a = run.time[-1] - hit, WEIGHT * G / (WEIGHT + SLEDGE)
    assert_close(run.q[-1, 0], 0.5 - 0.5 * speed * after + 0.5 * a * after**2, 1e-10)
    assert_close(run.q[-1, 2], run.q[-1, 0], CLOSED_FORM)
    lost = 0.5 * (WEIGHT + SLEDGE) * speed**2 * (1 - 0.5**2)
    assert_close(run.lost[-1], lost, 1e-9)
    assert_close(run.balance, np.zeros(len(run)), 1e-9)


def test_many_sledges_with_loads_of_their_own_move_as_one_does() -> None:
    """Rollouts: a loop, a contact, dry friction and a tunable payload, bit for bit."""
    load = {"payloads": [{"frame": "weight", "mass": 0.5}], "tunable": ["payload"]}
    rails = {"along": {"friction": {"coulomb": 1.0}}}
    sim = Simulator(sledge(table(0.2), joints=rails, **load))
    loads = np.zeros((3, 10))
    loads[:, 0] = [0.0, 0.5, 1.0]
    start = np.zeros((3, 3))
    ends = sim.rollout(start, start, np.zeros(3), 200, parameters={"payload": loads})[:, -1]
    run = sim.run(0.2)
    assert ends[1].tolist() == [*run.q[-1], *run.v[-1]]
    assert ends[0, 0] < ends[1, 0] < ends[2, 0]


def test_a_four_bar_comes_to_rest_on_the_floor() -> None:
    """Hinges with dry friction, a loop and a contact: it falls, bounces, and rests to the bit."""
    floor = contact(
        "coupler", name="floor", point=[0.3, 0, 0], friction=0.4, restitution=0.3,
        plane={"point": [0, 0, 0.2], "normal": [0, 0, 1]},
    )  # fmt: skip
    data = models.scene("four_bar").model_dump(mode="json", exclude_none=True)
    data |= {
        "constraints": [*data["constraints"], floor],
        "joints": {"*": {"friction": {"coulomb": 0.02}}},
        "initial": {"position": {"crank_pivot": 0.5, "knee": 0.3, "rocker_pivot": 1.6}},
    }
    sim = Simulator(data)
    run = sim.run(3.0)
    rest = np.flatnonzero((run.v == 0.0).all(axis=1))[-1]
    moving = np.flatnonzero((run.v != 0.0).any(axis=1))[-1]
    assert moving < 2500 < rest
    assert (run.q[moving + 5 :] == run.q[-1]).all()  # soon: rounding is brought back first
    assert abs(sim.contact_forces()[0].gap) < 1e-14
    assert_close(run.balance / run.lost[-1], np.zeros(len(run)), 1e-8)
