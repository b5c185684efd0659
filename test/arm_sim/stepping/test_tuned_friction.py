# SPDX-License-Identifier: Apache-2.0
"""Levels of dry friction as inputs of the equations, against scenes that have these levels."""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import SceneError
from arm_sim import Simulator
from tolerances import assert_close

LEVELS = np.array([0.3, 1.7])  # of shoulder and elbow, where the scene has 1 for both


def law(level: float) -> dict[str, Any]:
    """Friction by direction, position and speed whose mean level is this."""
    return {
        "coulomb": {"positive": 0.7 * level, "negative": 1.3 * level}, "static": 1.5 * level,
        "stribeck_velocity": 0.2, "position": {"at": [-1.0, 1.0], "factor": [0.8, 1.4]},
    }  # fmt: skip


def scene(levels: Any = (1.0, 1.0), **more: Any) -> dict[str, Any]:
    names = ("shoulder", "elbow")
    joints = {name: {"friction": law(x)} for name, x in zip(names, levels, strict=True)}
    start = {"position": {"shoulder": 0.4, "elbow": -0.2}, "velocity": {"shoulder": 0.5}}
    robot = models.scene("two_link").robot.model_dump()
    weightless = {"gravity": [0.0, 0.0, 0.0]}
    return {"robot": robot, "joints": joints, "initial": start, **weightless, **more}


def push(ticks: int) -> np.ndarray:
    """Torques under which the elbow sticks, slips and turns back."""
    time = 1e-3 * np.arange(ticks)[:, None]
    return np.array([1.0, 2.5]) * np.sin(np.array([9.0, 14.0]) * time)


def test_a_level_that_is_set_is_that_of_a_scene_that_has_it() -> None:
    tuned = Simulator(scene(tunable=["coulomb"]))
    tuned.set_parameter("coulomb", LEVELS)
    ours = tuned.run(0.6, push(600))
    theirs = Simulator(scene(LEVELS.tolist())).run(0.6, push(600))
    assert_close(np.hstack([ours.q, ours.v]), np.hstack([theirs.q, theirs.v]), 1e-9)
    rests = ours.v[:, 1] == 0.0
    assert rests.any() and not rests.all()
    assert_close(ours.lost[-1], theirs.lost[-1], 1e-9)
    assert abs(ours.balance).max() < 1e-6


def test_levels_of_the_scene_give_its_bits_and_without_levels_nothing_holds() -> None:
    fixed, tuned = Simulator(scene()), Simulator(scene(tunable=["coulomb"]))
    np.testing.assert_array_equal(tuned.run(0.3, push(300)).q, fixed.run(0.3, push(300)).q)
    tuned.reset()
    tuned.set_parameter("coulomb", [0.0, 0.0])
    free = Simulator(scene() | {"joints": {}}).run(0.5, push(500))
    assert_close(tuned.run(0.5, push(500)).q, free.q, 1e-7)


def test_derivatives_by_levels_are_those_of_differences() -> None:
    """The shoulder slides; the elbow rests, and its level changes nothing."""
    sim = Simulator(scene(tunable=["coulomb"]))
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
        Simulator(scene(tunable=["coulomb"]) | {"joints": {}})
