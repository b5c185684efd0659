# SPDX-License-Identifier: Apache-2.0
"""Impacts, compiled: Newton's rebound, Coulomb's friction, and never a gain of energy."""

from functools import cache
from typing import Any

import numpy as np
import pytest

import models
from arm_sim import Simulator
from models.engine import Engine
from models.touching import contact, rails
from tolerances import CLOSED_FORM, assert_close

INERTIA = {"rod": 1.0 / 12.0, "block": 0.1}
FEET = {"rod": [(-0.5, 0.0), (0.5, 0.0)], "block": [(-0.3, -0.4), (0.3, -0.4)]}


def body(name: str, mu: float, e: float) -> dict[str, Any]:
    """A slender rod, or a block on two feet, of 1 kg in the x-z plane."""
    feet = [contact("body", point=[x, 0, z], friction=mu, restitution=e) for x, z in FEET[name]]
    scene = rails("xz", 1.0, turns=True, iyy=INERTIA[name])
    start = {"initial": {"position": {"z": 1.0}}}
    return {**scene, **start, "constraints": feet}


@cache
def engine(name: str, mu: float, e: float) -> Engine:
    return Engine(body(name, mu, e))


def feet(name: str, turn: float) -> np.ndarray:
    """Places of both feet under the centre, rows (x, z), turned about y."""
    c, s = np.cos(turn), np.sin(turn)
    return np.array(FEET[name]) @ np.array([[c, -s], [s, c]])


def speeds(name: str, x: np.ndarray) -> np.ndarray:
    """Of both feet, rows (x, z)."""
    arm = feet(name, x[2])
    return np.stack([x[3] + x[5] * arm[:, 1], x[4] - x[5] * arm[:, 0]], axis=1)


def kinetic(name: str, x: np.ndarray) -> float:
    return float(0.5 * (x[3] ** 2 + x[4] ** 2 + INERTIA[name] * x[5] ** 2))


def on_the_floor(name: str, turn: float, rng: np.random.Generator) -> np.ndarray:
    """Any velocity, the lower foot on the floor."""
    return np.concatenate([[0.3, -feet(name, turn)[:, 1].min(), turn], rng.normal(size=3)])


@pytest.mark.parametrize(("name", "mu", "e"), [
    ("rod", 0.6, 0.9), ("rod", 1.5, 0.5),
])  # fmt: skip
def test_a_falling_rod(name: str, mu: float, e: float, rng: np.random.Generator) -> None:
    """One end strikes at random; the impulse is in its cone and acts at that end alone."""
    hits = full = less = 0
    for _ in range(300):
        x = on_the_floor(name, float(rng.uniform(-1.4, 1.4)), rng)
        low = int(np.argmin(feet(name, x[2])[:, 1]))
        before = speeds(name, x)[low]
        after, lost = engine(name, mu, e).impact(x)
        if before[1] > 0.0:
            assert lost == 0.0 and (after == x).all()
            continue
        hits += 1
        j_x, j_z, j_turn = (after - x)[3:] * [1.0, 1.0, INERTIA[name]]
        arm = feet(name, x[2])[low]
        assert (after[:3] == x[:3]).all()
        assert_close(j_turn, j_x * arm[1] - j_z * arm[0], CLOSED_FORM)
        assert j_z > 0.0 and abs(j_x) <= mu * j_z * (1 + 1e-12)
        slip, rebound = speeds(name, after)[low]
        if abs(j_x) < mu * j_z * (1 - 1e-9):
            assert_close(slip, 0.0, CLOSED_FORM)
        else:
            assert slip * j_x <= 1e-12
        assert_close(kinetic(name, x) - kinetic(name, after), lost, CLOSED_FORM)
        if rebound > -e * before[1] - 1e-12:
            full += 1
            assert_close(rebound, -e * before[1], CLOSED_FORM)
        else:  # the highest rebound that adds no energy
            less += 1
            assert lost < 1e-14 and 0.0 < rebound < -e * before[1]
    assert hits > 100 and full > 70
    assert less > 5 or e < 0.9


@pytest.mark.parametrize(("mu", "e"), [(0.6, 0.9), (0.3, 0.0)])
def test_a_block_falls_flat(mu: float, e: float, rng: np.random.Generator) -> None:
    """Both feet at once: none gains, none is pulled, a foot that carries rebounds by its law."""
    hits = 0
    for _ in range(300):
        x = on_the_floor("block", 0.0, rng)
        before = speeds("block", x)
        after, lost = engine("block", mu, e).impact(x)
        if (before[:, 1] >= 0.0).all():
            assert lost == 0.0 and (after == x).all()
            continue
        hits += 1
        jump = (after - x)[3:] * [1.0, 1.0, INERTIA["block"]]
        j_z = np.linalg.solve([[1.0, 1.0], [0.3, -0.3]], [jump[1], jump[2] + 0.4 * jump[0]])
        assert (j_z >= -1e-13).all() and abs(jump[0]) <= mu * j_z.sum() + 1e-13
        assert lost >= 0.0
        assert_close(kinetic("block", x) - kinetic("block", after), lost, CLOSED_FORM)
        rebound = speeds("block", after)[:, 1]
        expected = np.maximum(-e * before[:, 1], 0.0)
        carries = j_z > 1e-12
        if lost > 1e-12:
            assert_close(rebound[carries], expected[carries], CLOSED_FORM)
            assert (rebound >= expected - 1e-12).all()
        else:
            assert (rebound >= -1e-12).all()
    assert hits > 150


def test_a_foot_in_the_air_takes_no_part(rng: np.random.Generator) -> None:
    """A block on one edge, the other a micrometre above: as if that foot were not there."""
    for _ in range(50):
        x = on_the_floor("block", 1e-5, rng)
        x[4] = -abs(x[4]) - 3.0 * abs(x[5])
        after, _ = engine("block", 0.6, 0.9).impact(x)
        j_x, j_z, j_turn = (after - x)[3:] * [1.0, 1.0, INERTIA["block"]]
        arm = feet("block", x[2])[1]
        assert j_z > 0.0
        assert_close(j_turn, j_x * arm[1] - j_z * arm[0], CLOSED_FORM)


def test_without_rebounds_the_contact_closes(rng: np.random.Generator) -> None:
    x = on_the_floor("block", 0.0, rng)
    x[3:] = [0.2, -1.0, 0.1]
    after, lost = engine("block", 0.6, 0.9).impact(x, rebounds=False)
    assert_close(speeds("block", after)[:, 1], np.zeros(2), CLOSED_FORM)
    assert lost > 0.4


def test_a_rebound_under_rounding_is_none() -> None:
    """A hop of 64 roundings of the gap: at the size of a metre, a micrometre a second."""
    x = np.array([0.3, 0.4, 0.0, 0.0, 0.0, 0.0])
    for speed, hops in ((1e-4, True), (1e-7, False)):
        x[4] = -speed
        after, _ = engine("block", 0.6, 0.9).impact(x)
        assert_close(after[4] / speed, 0.9 if hops else 0.0, 1e-6)


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
