# SPDX-License-Identifier: Apache-2.0
"""Compiled controllers: the same torques, built once, and refused if they differ."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from samples import sampled

import models
from arm_dynamics import ArmModel, Dynamics, load_scene
from arm_dynamics.control import (
    NAMES,
    ComputedTorque,
    Measured,
    Settings,
    compiled_law,
    make_controller,
)
from arm_dynamics.control.compiled_law import Compiled, build, preparation
from arm_dynamics.control.controller import Restartable
from arm_dynamics.control.factory import IN_TASK_SPACE
from arm_dynamics.trajectory import Reference
from models.linkages import scene
from models.rotor import rotor
from tolerances import ALGEBRA, INVERSE_PAIR, assert_close

DRY = {
    "viscous": 0.3, "coulomb": {"positive": 2.0, "negative": 1.5},
    "static": {"positive": 2.5, "negative": 2.0}, "stribeck_velocity": 0.1,
}  # fmt: skip


def new() -> Dynamics:
    """A model for which nothing has been built yet."""
    return Dynamics(ArmModel(models.scene("two_link")))


def built(model: ArmModel) -> bool:
    """Whether there is code of computed torque for a model, which is built if need be."""
    return build(ComputedTorque(Dynamics(model)), model) is not None


def states(rng: np.random.Generator, n: int) -> list[tuple[Measured, Reference]]:
    """A moving arm, one at rest that is to move, and one at rest that is to stay."""
    q, v, a = models.random_state(rng, n)
    there, speed, _ = models.random_state(rng, n)
    still = np.zeros(n)
    return [
        (Measured(q, v), Reference(there, speed, a)),
        (Measured(q, still), Reference(there, speed, a)),
        (Measured(q, still), Reference(there, still, still)),
    ]


def agree(dynamics: Dynamics, rng: np.random.Generator, *gains: Any) -> None:
    plain = ComputedTorque(dynamics, *gains)
    fast = Compiled(ComputedTorque(dynamics, *gains), dynamics.model)
    for state, reference in states(rng, dynamics.n):
        assert_close(fast.torque(state, reference), plain.torque(state, reference), ALGEBRA)


@pytest.mark.parametrize("robot", sampled((*models.ROBOTS, *models.DRIVEN, *models.BALANCED), 4))
def test_it_is_the_plain_law(robot: str, rng: np.random.Generator) -> None:
    dynamics = models.dynamics(robot)
    agree(dynamics, rng, rng.uniform(0.0, 40.0, dynamics.n), 0.7, 4e-3)
    agree(dynamics, rng, 10.0, 1.0, 0.0)
    assert built(dynamics.model)


def test_it_is_built_once_for_all_gains(monkeypatch: pytest.MonkeyPatch) -> None:
    dynamics = new()
    job = preparation(make_controller("computed_torque", dynamics))
    assert job is not None
    job()
    assert preparation(make_controller("computed_torque", dynamics)) is None
    monkeypatch.setattr(compiled_law, "Kernel", None)
    for bandwidth in (5.0, 50.0):
        control = ComputedTorque(dynamics, bandwidth)
        fast = make_controller("computed_torque", dynamics, Settings(bandwidth=bandwidth))
        state = Measured(np.ones(2), np.ones(2))
        still = Reference(*np.zeros((3, 2)))
        assert_close(fast.torque(state, still), control.torque(state, still), ALGEBRA)


def test_without_a_compiler_it_is_still_right(
    monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    monkeypatch.setenv("CC", "/no/such/compiler")
    dynamics = new()
    agree(dynamics, rng)
    assert not built(dynamics.model)


def disturbed(monkeypatch: pytest.MonkeyPatch, change: Callable[[ca.SX], ca.SX]) -> None:
    """Change inverse dynamics as an expression, which numbers do not use."""

    class Disturbed(compiled_law.RigidExpressions):
        def frictionless(self, *motion: ca.SX) -> ca.SX:
            return change(super().frictionless(*motion))

    monkeypatch.setattr(compiled_law, "RigidExpressions", Disturbed)


def test_small_torques_are_compared_as_torques_of_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """[N m]; of a motor's rotor on its own, which takes a thousandth."""
    disturbed(monkeypatch, lambda tau: tau + 5e-11)
    assert built(ArmModel(load_scene(rotor(1e-7, viscous=0.0, coulomb=0.0))))


def test_a_law_that_differs_is_not_used(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, rng: np.random.Generator
) -> None:
    disturbed(monkeypatch, lambda tau: tau * (1.0 + 1e-9))
    dynamics = new()
    agree(dynamics, rng)
    assert not built(dynamics.model)
    assert "differs" in caplog.text


@pytest.mark.parametrize("more", sampled([{"friction": True, "observer": 10.0}, {}], 1), ids=str)
@pytest.mark.parametrize("name", NAMES)
def test_every_controller_is_the_plain_one(
    name: str, more: dict[str, Any], rng: np.random.Generator
) -> None:
    """With its memory, and with torques that are cut."""
    dynamics = Dynamics(scene("two_link", joints={"*": {"friction": DRY}}))
    settings = Settings(frame="tip", axes="position", force=3.0, limit=40.0, **more)
    if name in IN_TASK_SPACE:
        settings = replace(settings, axes=("x", "z"), direction=(1.0, 0.0, 0.0))
    control = make_controller(name, dynamics, settings)
    plain = make_controller(name, dynamics, settings).law
    law = compiled_law.compiled_law(control)
    assert law is not None and law.call.entry is not None
    assert isinstance(control, Restartable) == bool(plain.memory)
    for _ in range(2):
        for state, reference in states(rng, dynamics.n):
            expected = plain.torque(state, reference)
            assert_close(control.torque(state, reference), expected, INVERSE_PAIR)
            remembered = np.hstack((np.zeros(0), *plain.memory))
            assert_close(law.call.inputs[2], remembered, INVERSE_PAIR)
    if plain.memory:
        start = make_controller(name, dynamics, settings).law.memory
        control.restart()
        np.testing.assert_array_equal(law.call.inputs[2], np.hstack(start))


def test_where_code_has_no_answer_numbers_have(rng: np.random.Generator) -> None:
    """Near a singularity, and for a pose off by half a turn; both share their memory."""
    dynamics = models.dynamics("panda")
    settings = Settings(frame="panda_hand_tcp", observer=10.0)
    control = make_controller("operational_space", dynamics, settings)
    plain = make_controller("operational_space", dynamics, settings).law
    law, still, bent = compiled_law.compiled_law(control), np.zeros(7), dynamics.model.q0
    turned = bent + np.eye(7)[6] * 3.0
    assert law is not None
    for q, goal, answers in (bent, bent, True), (still, still, False), (bent, turned, False):
        state, reference = Measured(q, still + 0.1), Reference(goal, still, still)
        tau = control.torque(state, reference)
        assert np.isfinite(law.call.outputs[0]).all() == answers
        assert_close(tau, plain.torque(state, reference), 1e-6)
        assert_close(law.call.inputs[2], np.hstack(plain.memory), 1e-6)


def test_a_task_that_is_singular_everywhere_is_not_compiled(
    caplog: pytest.LogCaptureFixture,
) -> None:
    control = make_controller("operational_space", new(), Settings(frame="tip"))
    assert compiled_law.compiled_law(control) is None
    assert "singular wherever it was compared" in caplog.text
