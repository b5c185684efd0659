# SPDX-License-Identifier: Apache-2.0
"""Impacts: Newton's rebound, Coulomb's friction, and never a gain of energy."""

from typing import Any

import numpy as np
import pytest

import models
from arm_sim import Simulator
from models.touching import contact, rails
from tolerances import assert_close

SHORT = 1e-8  # [s] of a tick without weight, which an impact begins
NEAR = 1e-6
INERTIA = {"rod": 1.0 / 12.0, "block": 0.1}
FEET = {"rod": [(-0.5, 0.0), (0.5, 0.0)], "block": [(-0.3, -0.4), (0.3, -0.4)]}


def body(name: str, mu: float, e: float) -> dict[str, Any]:
    """A slender rod, or a block on two feet, of 1 kg in the x-z plane."""
    feet = [contact("body", point=[x, 0, z], friction=mu, restitution=e) for x, z in FEET[name]]
    scene = rails("xz", 1.0, turns=True, iyy=INERTIA[name]) | {"gravity": [0, 0, 0]}
    start = {"initial": {"position": {"z": 1.0}}}
    return {**scene, **start, "constraints": feet}


def struck(name: str, mu: float, e: float, x: np.ndarray) -> np.ndarray:
    """Velocities after the impacts of bodies that touch the floor, (k, 3)."""
    sim = Simulator(body(name, mu, e), integrator="rk4", dt=SHORT)
    return sim.rollout(x[:, :3], x[:, 3:], np.zeros(3), 1, last_only=True)[:, 3:]


def feet(name: str, turn: float) -> np.ndarray:
    """Places of both feet under the centre, rows (x, z), turned about y."""
    c, s = np.cos(turn), np.sin(turn)
    return np.array(FEET[name]) @ np.array([[c, -s], [s, c]])


def speeds(name: str, turn: float, v: np.ndarray) -> np.ndarray:
    """Of both feet, rows (x, z)."""
    arm = feet(name, turn)
    return np.stack([v[0] + v[2] * arm[:, 1], v[1] - v[2] * arm[:, 0]], axis=1)


def kinetic(name: str, v: np.ndarray) -> float:
    return float(0.5 * (v[0] ** 2 + v[1] ** 2 + INERTIA[name] * v[2] ** 2))


def on_the_floor(name: str, turn: float, rng: np.random.Generator) -> np.ndarray:
    """Any velocity, the lower foot on the floor."""
    return np.concatenate([[0.3, -feet(name, turn)[:, 1].min(), turn], rng.normal(size=3)])


@pytest.mark.parametrize(("mu", "e"), [(0.6, 0.9), (1.5, 0.5)])
def test_a_falling_rod(mu: float, e: float, rng: np.random.Generator) -> None:
    """One end strikes at random; the impulse is in its cone and acts at that end alone."""
    states = np.array([on_the_floor("rod", rng.uniform(-1.4, 1.4), rng) for _ in range(300)])
    hits = full = less = 0
    for x, after in zip(states, struck("rod", mu, e, states), strict=True):
        turn, v = x[2], x[3:]
        arms = feet("rod", turn)
        low = int(np.argmin(arms[:, 1]))
        (_, falls), (slip, rebound) = speeds("rod", turn, v)[low], speeds("rod", turn, after)[low]
        if falls > 0.0:
            assert (after == v).all()
            continue
        hits += 1
        j_x, j_z, j_turn = (after - v) * [1.0, 1.0, INERTIA["rod"]]
        assert_close(j_turn, j_x * arms[low, 1] - j_z * arms[low, 0], NEAR)
        assert j_z > 0.0 and abs(j_x) <= mu * j_z * (1 + NEAR)
        if abs(j_x) < mu * j_z * (1 - NEAR):
            assert_close(slip, 0.0, NEAR)
        else:
            assert slip * j_x <= NEAR
        lost = kinetic("rod", v) - kinetic("rod", after)
        assert lost > -NEAR
        if rebound > -e * falls - NEAR:
            full += 1
            assert_close(rebound, -e * falls, NEAR)
        else:  # the highest rebound that adds no energy
            less += 1
            assert lost < NEAR and 0.0 < rebound < -e * falls
    assert hits > 100 and full > 70
    assert less > 5 or e < 0.9


@pytest.mark.parametrize(("mu", "e"), [(0.6, 0.9), (0.3, 0.0)])
def test_a_block_falls_flat(mu: float, e: float, rng: np.random.Generator) -> None:
    """Both feet at once: none gains, none is pulled, a foot that carries rebounds by its law."""
    states = np.array([on_the_floor("block", 0.0, rng) for _ in range(300)])
    hits = 0
    for x, after in zip(states, struck("block", mu, e, states), strict=True):
        falls, rebounds = speeds("block", 0.0, x[3:])[:, 1], speeds("block", 0.0, after)[:, 1]
        if (falls >= 0.0).all():
            assert (after == x[3:]).all()
            continue
        hits += 1
        jump = (after - x[3:]) * [1.0, 1.0, INERTIA["block"]]
        j_z = np.linalg.solve([[1.0, 1.0], [0.3, -0.3]], [jump[1], jump[2] + 0.4 * jump[0]])
        assert (j_z >= -NEAR).all() and abs(jump[0]) <= mu * j_z.sum() + NEAR
        lost = kinetic("block", x[3:]) - kinetic("block", after)
        assert lost >= -NEAR and (rebounds >= -NEAR).all()
        if lost > NEAR:
            expected, carries = np.maximum(-e * falls, 0.0), j_z > NEAR
            assert_close(rebounds[carries], expected[carries], NEAR)
            assert (rebounds >= expected - NEAR).all()
    assert hits > 150


def test_a_rebound_under_rounding_is_none() -> None:
    """A hop of 64 roundings of the gap: at the size of a metre, half a micrometre a second."""
    heavy = body("block", 0.6, 0.9) | {"gravity": [0, 0, -9.81]}
    sim = Simulator(heavy, integrator="rk4", dt=SHORT)
    for speed, rebounds in ((1e-4, 0.9), (1e-7, 0.0)):
        sim.reset([0.3, 0.4, 0.0], [0.0, -speed, 0.0])
        assert_close(sim.step(np.zeros(3)).v[1] / speed, rebounds, 1e-2)


@pytest.mark.parametrize("tilt", [0.2, 1.3])
def test_a_contact_that_jams_does_not_rebound_and_loses_all_energy(tilt: float) -> None:
    """A pendulum whose bob meets a rough plane: along its one motion no rebound is possible."""
    scene = models.scene("pendulum").model_dump(exclude_unset=True)
    stop, bob = 0.5, models.dynamics("pendulum").model.pin.inertias[1].lever
    at = np.array([np.sin(stop), 0.0, -np.cos(stop)])
    along, across = np.array([np.cos(stop), 0.0, np.sin(stop)]), -at
    normal = np.cos(tilt) * along + np.sin(tilt) * across
    plane = {"point": at.tolist(), "normal": normal.tolist()}
    wall = contact("bob", point=bob.tolist(), friction=3.0, restitution=0.2, plane=plane)
    run = Simulator(scene | {"constraints": [wall]}).run(1.5)
    assert_close(run.q[-1], [stop], 1e-9)
    assert not run.v[-1].any()
    assert_close(run.lost[-1], 9.81 * np.cos(stop), 1e-9)
    assert abs(run.balance).max() < 1e-10
