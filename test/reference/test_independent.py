# SPDX-License-Identifier: Apache-2.0
"""The independent simulator itself: what it is held against beside ``features_together``."""

from typing import Any

import numpy as np

from models.touching import contact, rails
from reference.independent import Motion, simulate

NEAR = 1e-10
TIMES = np.linspace(0.0, 1.0, 21)
G = 9.81


def moved(axes: str, command: dict[str, float] | None = None, **scene: Any) -> Motion:
    """The motion of a body of 2 kg on rails; its account must close."""
    joints = {"*": {"limits": {"stop": False}}, **scene.pop("joints", {})}
    motion = simulate({**rails(axes, 2.0), "joints": joints, **scene}, command or {}, TIMES)
    assert abs(motion.balance).max() < NEAR
    return motion


def close(actual: np.ndarray, wanted: np.ndarray, near: float = NEAR) -> None:
    np.testing.assert_allclose(actual, wanted, rtol=0.0, atol=near)


def test_dry_friction_stops_a_body_and_holds_it() -> None:
    """From 1 m/s with 3 N on 2 kg: 1.5 m/s² until 2/3 s, then at rest under less than static."""
    friction = {"coulomb": 3.5, "static": 4.0}
    start = {"velocity": {"x": 1.0}}
    run = moved("x", {"x": 0.5}, joints={"x": {"friction": friction}}, initial=start)
    t = np.minimum(TIMES, 2 / 3)
    close(run.q[:, 0], t - 0.75 * t**2)
    assert (run.v[TIMES > 0.7] == 0.0).all()
    assert [kind for _, kind, _ in run.log] == ["slides", "sticks"]


def test_a_ball_bounces_to_rest() -> None:
    """From h with restitution e it rests after (1 + e)/(1 - e) √(2h/g), having rebounded e² h."""
    ball = contact("body", restitution=0.5)
    run = moved("z", constraints=[ball], initial={"position": {"z": 0.2}})
    first = np.sqrt(0.4 / G)
    t = TIMES[(first < TIMES) & (2 * first > TIMES)] - first
    rebound = 0.5 * np.sqrt(2 * G * 0.2)
    close(run.q[(first < TIMES) & (2 * first > TIMES), 0], rebound * t - 0.5 * G * t**2)
    hits = [at for at, kind, _ in run.log if kind == "impact"]
    close(np.array(hits[-1]), np.array(3.0 * first), 1e-6)
    close(run.q[3.0 * first < TIMES, 0], 0.0)


def test_the_range_of_the_urdf_has_stops_by_default() -> None:
    run = moved("x", {"x": 4.0}, joints={"*": {}}, initial={"position": {"x": 8.9}})
    close(run.q[np.sqrt(0.1) < TIMES, 0], 9.0)
    assert [kind for _, kind, _ in run.log] == ["leaves", "leaves", "hit", "holds"]


def test_what_it_does_not_know_it_refuses() -> None:
    for joint in ({"backlash": 1}, {"friction": {"load": {}}}, {"limits": {"stop": {"give": 1}}}):
        try:
            moved("x", joints={"x": joint})
        except NotImplementedError:
            continue
        raise AssertionError(joint)
