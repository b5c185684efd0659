# SPDX-License-Identifier: Apache-2.0
"""Modes of joints with dry friction and contacts at a state: the solution satisfies all laws."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest

import models
from arm_sim import SimulationDiverged, Simulator
from models.engine import Engine
from models.touching import contact, rails
from tolerances import CLOSED_FORM, assert_close

G = 9.81
TWO_LINK = {"robot": {"urdf": str(models.SCENES / "two_link.urdf")}}
LAW = 1e-8
"""What a force or acceleration may lack of the law, relative to the largest."""


def feet(mu: float) -> list[dict[str, Any]]:
    return [contact("body", point=[x, 0, -0.4], friction=mu) for x in (-0.3, 0.3)]


def block(*more: dict[str, Any], mu: float = 0.4, **settings: Any) -> dict[str, Any]:
    """A block of 2 kg in the x-z plane that stands on two feet."""
    start = {"initial": {"position": {"z": 0.4}}}
    scene = rails("xz", 2.0, turns=True, iyy=0.1, **settings)
    return {**scene, **start, "constraints": [*feet(mu), *more]}


def lying_arm() -> dict[str, Any]:
    """Two links with dry joints whose elbow and tip lie on a table."""
    shoulder = -float(np.arcsin(0.4))
    table = [
        contact(frame, plane={"point": [0, 0, -0.2]}, friction=0.5) for frame in ("forearm", "tip")
    ]
    dry = {"shoulder": 1.5, "elbow": 0.8}
    return {
        **TWO_LINK,
        "initial": {"position": {"shoulder": shoulder, "elbow": -shoulder}},
        "joints": {name: {"friction": {"coulomb": level}} for name, level in dry.items()},
        "constraints": table,
    }


WALL = contact("body", point=[0.3, 0, 0], friction=0.2,
               plane={"point": [0.3, 0, 0], "normal": [-1, 0, 0]})  # fmt: skip
CASES: dict[str, tuple[dict[str, Any], list[float], list[float]]] = {
    "block on two feet": (block(), [0, 0, 0], [30, 30, 12]),
    "block that slides back": (block(mu=0.2), [-0.7, 0, 0], [30, 30, 12]),
    "block in a corner": (block(WALL, mu=0.3), [0, 0, 0], [30, 30, 12]),
    "block without friction": (block(mu=0.0), [0, 0, 0], [30, 30, 12]),
    "block on dry rails": (block(friction={"coulomb": 3.0}), [0, 0, 0], [30, 30, 12]),
    "body in space": (
        {**rails("xyz", 2.0), "constraints": [contact("body", friction=0.5)]},
        [0, 0, 0], [15, 15, 20],
    ),
    "body that slides in space": (
        {**rails("xyz", 2.0), "constraints": [contact("body", friction=0.5)]},
        [0.3, -0.4, 0], [15, 15, 20],
    ),
    "arm on a table": (lying_arm(), [0, 0], [12, 6]),
}  # fmt: skip


@dataclass
class Found:
    """Modes at a state, and what follows from them by the scene's own equations."""

    direction: np.ndarray
    closed: np.ndarray
    sticks: np.ndarray
    along: np.ndarray
    load: np.ndarray
    force: np.ndarray
    rate: np.ndarray
    a: np.ndarray


def found(sim: Simulator, x: np.ndarray, u: np.ndarray) -> Found:
    stepper = sim.arm.compiled.stepper
    modes = stepper.modes_at(x, u)
    load, force, rate, *_ = (np.array(y) for y in stepper.kernel.call("loads")(x, u, modes.p))
    a = np.array(stepper.kernel.call("rhs")(x, u, modes.p)[0])[sim.n :]
    shares, torques = stepper.shared(x, u, modes)  # friction here is the same at rest and sliding
    change = shares.reshape(-1, 3)
    for k, mode in enumerate(modes.contact):
        slides = not mode["sticks"]
        change[k, 1:] -= slides * sim.arm.plant.points[k].friction * change[k, 0] * mode["along"]
    load, force = load + torques, force + change.ravel()
    c = modes.contact
    states = modes.direction.copy(), c["closed"].copy(), c["sticks"].copy(), c["along"].copy()
    return Found(*states, load, force.reshape(-1, 3), rate.reshape(-1, 3), a)


def assert_contact_obeys(f: Found, k: int, mu: float, slip: np.ndarray) -> None:
    (r_n, *r_t), (a_n, *a_t) = f.force[k], f.rate[k]
    scale, fastest = LAW * (1 + np.abs(f.force).max()), LAW * (1 + np.abs(f.rate).max())
    assert r_n >= -scale and a_n >= -fastest
    assert abs(r_n) <= scale or abs(a_n) <= fastest
    assert np.hypot(*r_t) <= mu * r_n + scale
    if not f.closed[k]:
        assert not f.force[k].any()
        return
    assert not (f.sticks[k] and mu == 0.0)
    if np.any(slip):
        assert not f.sticks[k]
        d = slip / np.hypot(*slip)
        assert_close(np.array(r_t), -mu * r_n * d, LAW)
    elif f.sticks[k]:
        assert np.hypot(*a_t) <= fastest
    elif mu > 0.0:
        d = f.along[k]
        assert_close(np.hypot(*d), 1.0, CLOSED_FORM)
        assert_close(np.array(r_t), -mu * r_n * d, LAW)
        assert d @ a_t >= -fastest and abs(d[0] * a_t[1] - d[1] * a_t[0]) <= fastest


def assert_joints_obey(f: Found, v: np.ndarray, level: np.ndarray) -> None:
    for d, load, a, speed, most in zip(f.direction, f.load, f.a, v, level, strict=True):
        if speed != 0.0 and most > 0.0:
            assert d == np.sign(speed)
        elif d == 0.0:
            assert abs(load) <= most * (1 + LAW) and abs(a) <= LAW
        elif most > 0.0:
            assert d * a >= -LAW * (1 + np.abs(f.a).max())


@pytest.mark.parametrize(("scene", "v", "push"), CASES.values(), ids=CASES)
def test_what_is_found_obeys(
    scene: dict[str, Any], v: list[float], push: list[float], rng: np.random.Generator
) -> None:
    """Under torques at random, which let some carry, stick, slide and lift off."""
    sim = Simulator(scene)
    sim.reset(v=v)
    friction = [point.friction for point in sim.arm.plant.points]
    x, level, seen, unanswered = sim.arm.x.copy(), sim.model.friction.level, set(), 0
    for _ in range(150):
        u = rng.normal(0.0, push)
        sim.set_state(x[: sim.n], x[sim.n :])
        try:
            sim.step(u)
        except SimulationDiverged:
            unanswered += 1
            continue
        f = found(sim, x, u)
        slips = np.array(sim.arm.plant.mechanics.contact.geometry(x)[1]).reshape(-1, 3)[:, 1:]  # type: ignore[union-attr]
        for k, mu in enumerate(friction):
            assert_contact_obeys(f, k, mu, slips[k])
            seen.add((k, float(f.closed[k]), float(f.sticks[k])))
        if len(f.direction):
            assert_joints_obey(f, x[sim.n :], level)
    assert unanswered <= (3 if len(friction) > 2 else 0)  # three contacts of three joints may jam
    kinds = {(closed, sticks) for _, closed, sticks in seen}
    assert kinds >= ({(0.0, 0.0), (1.0, 0.0)} if any(v) or not any(friction) else
                     {(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)})  # fmt: skip


def test_a_body_in_a_corner_seldom_has_no_answer(rng: np.random.Generator) -> None:
    """Three contacts for three joints: where one after the other goes in circles, all together."""
    scene, _, push = CASES["block in a corner"]
    sim = Simulator(scene)
    arms = 3000
    q, still = np.tile(sim.state.q, (arms, 1)), np.zeros((arms, 3))
    after = sim.rollout(q, still, rng.normal(0.0, push, (arms, 3)), 1, last_only=True)
    unanswered = np.isnan(after).any(axis=1).sum()
    assert unanswered <= 22


def test_at_the_very_edge_of_the_cone() -> None:
    """A pull of µ N give or take some roundings: always an answer, no speed to speak of."""
    sim = Simulator({**rails("xyz", 2.0), "constraints": [contact("body", friction=0.4)]})
    for angle in (0.0, 0.3, np.pi / 2, 2.1):
        edge = 0.4 * 2.0 * G * np.array([np.cos(angle), np.sin(angle), 0.0])
        for part in range(-6, 7):
            sim.reset()
            assert np.abs(sim.step(edge * (1 + part * 2.0**-52)).v).max() < 1e-14
        sim.reset()
        assert np.hypot(*sim.step(1.001 * edge).v[:2]) > 1e-6


def test_joints_at_the_very_edge_of_their_levels() -> None:
    """Both joints of an arm, each a rounding below, at or above its level, in all pairs."""
    level = np.array([1.5, 0.8])
    joints = {
        name: {"friction": {"coulomb": float(x)}}
        for name, x in zip(("shoulder", "elbow"), level, strict=True)
    }
    sim = Simulator({**TWO_LINK, "joints": joints, "gravity": [0, 0, 0]})
    for sign in (1.0, -1.0):
        for first in (-1, 0, 1):
            for second in (-1, 0, 1):
                sim.reset(v=[0, 0])
                tau = level * [1.0, sign] * (1 + np.array([first, second]) * 2.0**-52)
                assert np.abs(sim.step(tau).v).max() < 1e-12


@pytest.mark.parametrize(("gap", "speed", "closed"), [
    (2e-15, 0.0, True), (1e-13, 0.0, False), (0.0, 3e-7, True), (0.0, 1e-5, False),
])  # fmt: skip
def test_what_touches(gap: float, speed: float, closed: bool) -> None:
    """Gaps that are zero to rounding, unless they open faster than a hop of rounding would.

    Above a plane at a metre a hop of 64 roundings starts at a micrometre a second.
    """
    floor = contact("body", plane={"point": [0, 0, 1.0]})
    start = {"initial": {"position": {"z": 1.0}}}
    sim = Simulator({**rails("z"), **start, "constraints": [floor]})
    x = np.array([1.0 + gap, speed])
    assert bool(sim.arm.compiled.stepper.modes_at(x, np.zeros(1)).contact["closed"][0]) is closed


def test_rank_and_what_is_held() -> None:
    """The rank of what contacts hold, and that a block needs both feet and an arm one tip.

    Light and heavy bodies count alike; what is rounding beside both does not.
    """
    engine, rng = Engine(block()), np.random.default_rng(4)
    for rank in range(7):
        for scale in (1e-3, 1.0, 1e5):
            A = rng.normal(size=(6, rank))
            assert engine.rank(scale * A @ A.T) == rank
    assert engine.rank(np.diag([0, 0, 3.0, 0, 1e-9, 1e-24])) == 2
    still = np.array([0.0, 0.4, 0.0, 0.0, 0.0, 0.0])
    assert engine.is_held(still, np.zeros(3))
    assert not engine.is_held(still, np.array([9.0, 0.0, 0.0]))  # slides
    assert not engine.is_held(still, np.array([0.0, 0.0, 7.0]))  # tips
    assert not engine.is_held(still + [0, 0, 0, 1e-6, 0, 0], np.zeros(3))
    standing = still.copy()
    standing[1:3] = 0.4 * np.cos(0.3) + 0.3 * np.sin(0.3), 0.3
    assert not engine.is_held(standing, np.zeros(3))


@cache
def rubbing() -> Engine:
    """A body over a table, on rails of which the second has no friction."""
    friction = {"x": {"friction": {"coulomb": 0.5}}, "z": {"friction": {"coulomb": 0.5}}}
    return Engine({**rails("xyz"), "joints": friction, "constraints": [contact("body")]})


Q = [0.3, -7.0, 0.4]  # which has nothing to do with what stops
ROUNDING = 1e-13  # of speeds, relative to the fastest and to one


@pytest.mark.parametrize(
    ("v", "direction", "after"),
    [
        ([1.0, 2.0, 3.0], [1, 0, 1], [1.0, 2.0, 3.0]),
        ([-1e-9, 2.0, -3.0], [1, 0, -1], [0.0, 2.0, -3.0]),
        ([1.0, 2.0, -1e-9], [1, 0, 1], [1.0, 2.0, 0.0]),
        ([1e-9, 0.0, -1e-9], [0, 0, 0], [0.0, 0.0, 0.0]),
        ([1.0, -5.0, 1.0], [1, 1, 1], [1.0, -5.0, 1.0]),  # without friction none stops
    ],
)
def test_a_joint_stops_when_it_no_longer_moves_as_it_did(
    v: list[float], direction: list[int], after: list[float]
) -> None:
    stopped = rubbing().stop(np.array([*Q, *v]), np.array(direction, float))
    np.testing.assert_array_equal(stopped, [*Q, *after])


@pytest.mark.parametrize(("joint", "fastest"), [(0, 0.0), (2, 9.0), (0, -99.0)])
def test_no_joint_stops_suddenly(joint: int, fastest: float) -> None:
    """A millionth of the fastest one's speed, and of one, is rounding; more was no motion."""
    most, direction = 1e-6 * (1.0 + abs(fastest)), -np.eye(3)[joint]
    for speed, stops in ((most, True), (1.01 * most, False), (5.0, False)):
        for sign in (1.0, -1.0):
            x = np.array([*Q, 0.0, fastest, 0.0])
            x[3 + joint] = sign * speed
            after = rubbing().stop(x, sign * direction)
            assert (after is not None) is stops
            if stops:
                np.testing.assert_array_equal(after, [*Q, 0.0, fastest, 0.0])


@pytest.mark.parametrize(("fastest", "sign"), [(0.0, 1.0), (-99.0, -1.0)])
def test_beside_a_contact_joints_with_friction_rest_that_only_rounding_moves(
    fastest: float, sign: float
) -> None:
    most = ROUNDING * (1.0 + abs(fastest))
    for speed, rests in ((0.0, True), (0.9 * most, True), (1.1 * most, False), (0.5, False)):
        for joint in (0, 2):
            x = np.array([*Q, 0.0, fastest, 0.0])
            x[3 + joint] = sign * speed
            wanted = x.copy()
            wanted[3 + joint] = 0.0 if rests else sign * speed
            np.testing.assert_array_equal(rubbing().rounded(x), wanted)
    slow = np.array([*Q, 0.0, sign * 1e-13, 0.0])
    np.testing.assert_array_equal(rubbing().rounded(slow), slow)  # nothing holds the second
