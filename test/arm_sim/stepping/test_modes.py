# SPDX-License-Identifier: Apache-2.0
"""Joints with dry friction and contacts: what is found at a state satisfies all laws."""

from typing import Any

import numpy as np
import pytest

import models
from arm_sim import SimulationDiverged, Simulator
from arm_sim.stepping.contact_forces import contact_forces
from models.touching import contact, rails

G = 9.81
SHORT = 1e-6  # [s] of a tick: what speeds gain in it are accelerations
LAW = 1e-5
"""What a force or acceleration may lack of the law, relative to the largest."""
TWO_LINK = {"robot": {"urdf": str(models.SCENES / "two_link.urdf")}}


def block(*more: dict[str, Any], mu: float = 0.4, **settings: Any) -> dict[str, Any]:
    """A block of 2 kg in the x-z plane that stands on two feet."""
    feet = [contact("body", point=[x, 0, -0.4], friction=mu) for x in (-0.3, 0.3)]
    start = {"initial": {"position": {"z": 0.4}}}
    scene = rails("xz", 2.0, turns=True, iyy=0.1, **settings)
    return {**scene, **start, "constraints": [*feet, *more]}


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
CORNER = block(WALL, mu=0.3)
CASES: dict[str, tuple[dict[str, Any], list[float], list[float]]] = {
    "block in a corner": (CORNER, [0, 0, 0], [30, 30, 12]),
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


def jacobian(sim: Simulator, touching: dict[str, Any]) -> np.ndarray:
    """Velocity of a contact's point by joint velocity, (3, n)."""
    frame = touching["frame"]
    J, pose = sim.dynamics.jacobian(sim.state.q, frame), sim.dynamics.pose(sim.state.q, frame)
    arm = pose[:3, :3] @ touching.get("point", np.zeros(3))
    return J[:3] + np.cross(J[3:], arm, axisa=0, axisc=0)


@pytest.mark.parametrize(("scene", "v", "push"), CASES.values(), ids=CASES)
def test_what_is_found_obeys(
    scene: dict[str, Any], v: list[float], push: list[float], rng: np.random.Generator
) -> None:
    """Signorini's law and Coulomb's, under torques at random: points carry, stick, slide, open."""
    sim, seen, unanswered = Simulator(scene, integrator="rk4", dt=SHORT), set(), 0
    for _ in range(150):
        u, before = rng.normal(0.0, push), sim.reset(v=v).v
        forces = contact_forces(sim.arm.plant, sim.arm.compiled.stepper, sim.arm.x, u)
        try:
            after = sim.step(u)
        except SimulationDiverged:
            unanswered += 1
            continue
        a, given = (after.v - before) / SHORT, u.copy()
        allowed = LAW * (1.0 + abs(a).max())
        strongest = LAW * (1.0 + max(np.linalg.norm(f.force) for f in forces))
        for touching, force in zip(scene["constraints"], forces, strict=True):
            J, mu = jacobian(sim, touching), touching["friction"]
            n = np.array(touching.get("plane", {}).get("normal", [0, 0, 1]))
            opens, slip = n @ J @ a, J @ (before if any(v) else a)
            slip = slip - n * (n @ slip)
            given += J.T @ force.force
            assert force.normal >= -strongest and opens >= -allowed
            assert force.normal < strongest or opens < allowed
            assert np.linalg.norm(force.tangential) <= mu * force.normal + strongest
            works, speed = force.tangential @ slip, np.linalg.norm(slip)
            assert abs(works + mu * force.normal * speed) <= strongest * (1.0 + speed)
            seen.add(force.state)
        resists, level = (
            given - sim.dynamics.inverse(after.q, before, a, 7),
            sim.model.friction.level,
        )
        assert (abs(resists) <= level + strongest).all()
        assert (abs(resists * a - level * abs(a)) <= strongest * (1.0 + abs(a))).all()
    assert unanswered <= (3 if scene is CORNER else 0)  # three contacts of three joints may jam
    assert seen == {"apart", "slides"} | (set() if any(v) else {"sticks"})


def test_a_body_in_a_corner_seldom_has_no_answer(rng: np.random.Generator) -> None:
    """Three contacts for three joints: where one after the other goes in circles, all together."""
    sim, arms = Simulator(CORNER), 3000
    q, still = np.tile(sim.state.q, (arms, 1)), np.zeros((arms, 3))
    after = sim.rollout(q, still, rng.normal(0.0, [30, 30, 12], (arms, 3)), 1, last_only=True)
    assert np.isnan(after).any(axis=1).sum() <= 22


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


@pytest.mark.parametrize("fastest", [0.0, -99.0])
def test_beside_a_contact_joints_with_friction_rest_that_only_rounding_moves(
    fastest: float,
) -> None:
    """That is 1e-13 of the fastest joint's speed, and of one."""
    dry = {"joints": {"x": {"friction": {"coulomb": 1e-20}}}, "gravity": [0, 0, 0]}
    sim = Simulator({**rails("xyz"), **dry, "constraints": [contact("body")]})
    rounding = 1e-13 * (1.0 + abs(fastest))
    for speed, rests in ((0.9 * rounding, True), (1.1 * rounding, False)):
        sim.reset([0.0, 0.0, 0.4], [speed, fastest, 0.0])
        assert (sim.step(np.zeros(3)).v[0] == 0.0) == rests


@pytest.mark.parametrize(("gap", "speed", "touches"), [
    (2e-15, 0.0, True), (1e-13, 0.0, False), (0.0, 3e-7, True), (0.0, 1e-5, False),
])  # fmt: skip
def test_what_touches(gap: float, speed: float, touches: bool) -> None:
    """Gaps that are zero to rounding, unless they open faster than a hop of rounding would.

    Above a plane at a metre a hop of 64 roundings starts at a micrometre a second.
    """
    floor = contact("body", plane={"point": [0, 0, 1.0]})
    start = {"initial": {"position": {"z": 1.0}}}
    sim = Simulator({**rails("z"), **start, "constraints": [floor]})
    sim.reset([1.0 + gap], [speed])
    assert (sim.contact_forces()[0].state != "apart") is touches
