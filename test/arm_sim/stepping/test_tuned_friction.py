# SPDX-License-Identifier: Apache-2.0
"""Levels of dry friction as inputs of the equations, against scenes that have these levels."""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import SceneError
from arm_sim import Simulator
from tolerances import assert_close

CURVE = {"at": [-1.0, 1.0], "factor": [0.8, 1.4]}
KINDS: dict[str, dict[str, Any]] = {
    "rest and position": {"static": 1.5, "stribeck_velocity": 0.2, "position": CURVE},
    "sides": {"coulomb": {"positive": 0.7, "negative": 1.3}},
}
LEVELS = np.array([0.3, 1.7])  # of shoulder and elbow, where the scene has 1 for both


def scene(friction: dict[str, Any], **more: Any) -> dict[str, Any]:
    joints = {"*": {"friction": {"coulomb": 1.0} | friction}}
    start = {"position": {"shoulder": 0.4, "elbow": -0.2}, "velocity": {"shoulder": 0.5}}
    robot = models.scene("two_link").robot.model_dump()
    weightless = {"gravity": [0.0, 0.0, 0.0]}
    return {"robot": robot, "joints": joints, "initial": start, **weightless, **more}


def with_levels(friction: dict[str, Any], levels: np.ndarray) -> dict[str, Any]:
    """The scene with these levels, and those at rest in proportion."""
    joints = {}
    for name, level in zip(("shoulder", "elbow"), levels.tolist(), strict=True):
        own = {"coulomb": 1.0} | friction
        for key in {"coulomb", "static"} & own.keys():
            value = own[key]
            sided = isinstance(value, dict)
            own[key] = {k: v * level for k, v in value.items()} if sided else value * level
        joints[name] = {"friction": own}
    return scene({}) | {"joints": joints}


def push(ticks: int) -> np.ndarray:
    """Torques under which the elbow sticks, slips and turns back."""
    time = 1e-3 * np.arange(ticks)[:, None]
    return np.array([1.0, 2.5]) * np.sin(np.array([9.0, 14.0]) * time)


@pytest.mark.parametrize("kind", KINDS)
def test_a_level_that_is_set_is_that_of_a_scene_that_has_it(kind: str) -> None:
    tuned = Simulator(scene(KINDS[kind], tunable=["coulomb"]))
    tuned.set_parameter("coulomb", LEVELS)
    ours = tuned.run(0.6, push(600))
    theirs = Simulator(with_levels(KINDS[kind], LEVELS)).run(0.6, push(600))
    assert_close(np.hstack([ours.q, ours.v]), np.hstack([theirs.q, theirs.v]), 1e-9)
    rests = ours.v[:, 1] == 0.0
    assert rests.any() and not rests.all()
    assert_close(ours.lost[-1], theirs.lost[-1], 1e-9)
    assert abs(ours.balance).max() < 1e-6


def test_levels_of_the_scene_give_its_bits_and_without_levels_nothing_holds() -> None:
    fixed, tuned = Simulator(scene({})), Simulator(scene({}, tunable=["coulomb"]))
    np.testing.assert_array_equal(tuned.run(0.3, push(300)).q, fixed.run(0.3, push(300)).q)
    tuned.reset()
    tuned.set_parameter("coulomb", [0.0, 0.0])
    free = Simulator(scene({}) | {"joints": {}}).run(0.5, push(500))
    assert_close(tuned.run(0.5, push(500)).q, free.q, 1e-7)


def test_arms_of_a_rollout_have_levels_of_their_own(rng: np.random.Generator) -> None:
    levels, q, v = rng.uniform(0.1, 2.0, (9, 2)), rng.normal(size=(9, 2)), rng.normal(size=(9, 2))
    sim = Simulator(scene({}, tunable=["coulomb"]))
    tau, given = np.broadcast_to(push(200), (9, 200, 2)), {"coulomb": levels}
    together = sim.rollout(q, v, tau, 200, parameters=given, last_only=True)
    for k in (0, 4, 8):
        alone = Simulator(with_levels({}, levels[k]))
        alone.reset(q[k], v[k])
        run = alone.run(0.2, push(200))
        assert_close(together[k], np.concatenate([run.q[-1], run.v[-1]]), 1e-9)


def test_derivatives_by_levels_are_those_of_differences() -> None:
    """The shoulder slides; the elbow rests, and its level changes nothing."""
    sim = Simulator(scene({}, tunable=["coulomb"]))
    sim.run(0.1, [0.5, 0.2])
    state, tau = sim.state, [0.5, 0.2]
    (*_, by) = sim.linearize(state, tau, by=["coulomb"])

    def after(levels: list[float]) -> np.ndarray:
        sim.set_parameter("coulomb", levels)
        sim.set_state(state.q, state.v)
        end = sim.step(tau)
        return np.concatenate([end.q, end.v])

    h = 1e-4
    expected = (after([1.0 + h, 1.0]) - after([1.0 - h, 1.0])) / (2 * h)
    assert_close(by["coulomb"][:, 0], expected, 1e-8)
    assert abs(expected).max() > 1e-4


def test_a_scene_without_dry_friction_has_none_to_tune() -> None:
    with pytest.raises(SceneError, match="'coulomb' is tunable, but no joint has dry friction"):
        Simulator(scene({}, tunable=["coulomb"]) | {"joints": {}})
