# SPDX-License-Identifier: Apache-2.0
"""Computed torque in compiled code: the plain law, built once, and never a wrong one."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, Dynamics, InvalidInput, load_scene
from arm_dynamics.control import (
    CompiledComputedTorque,
    ComputedTorque,
    Measured,
    Saturated,
    Settings,
    computed_torque,
    make_controller,
    preparation,
)
from arm_dynamics.control.compiled_law import compiled_law
from arm_dynamics.trajectory import Reference
from models.rotor import rotor
from tolerances import ALGEBRA, assert_close

DRY = {
    "viscous": 0.3,
    "coulomb": {"positive": 2.0, "negative": 1.5},
    "static": {"positive": 2.5, "negative": 2.0},
    "stribeck_velocity": 0.1,
}


def new(name: str) -> Dynamics:
    """A model for which nothing has been built yet."""
    return Dynamics(ArmModel(models.scene(name)))


def rubbing() -> Dynamics:
    """A two-link arm with dry friction in both joints."""
    scene = models.scene("two_link")
    return Dynamics(scene.model_dump(exclude_unset=True) | {"joints": {"*": {"friction": DRY}}})


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
    plain, fast = ComputedTorque(dynamics, *gains), CompiledComputedTorque(dynamics, *gains)
    for state, reference in states(rng, dynamics.n):
        assert_close(fast.torque(state, reference), plain.torque(state, reference), ALGEBRA)


def test_it_is_the_plain_law(robot: str, rng: np.random.Generator) -> None:
    dynamics = models.dynamics(robot)
    agree(dynamics, rng)
    agree(dynamics, rng, rng.uniform(0.0, 40.0, dynamics.n), 0.7, 4e-3)
    agree(dynamics, rng, 10.0, 1.0, 0.0)
    assert computed_torque.build(dynamics.model) is not None


@pytest.mark.parametrize("name", models.DRIVEN)
def test_it_is_the_plain_law_for_arms_with_motors(name: str, rng: np.random.Generator) -> None:
    agree(models.dynamics(name), rng)


def test_joints_at_rest_are_helped_to_where_they_are_to_slide(rng: np.random.Generator) -> None:
    dynamics = rubbing()
    assert dynamics.steady_friction.has_dry
    agree(dynamics, rng)
    assert computed_torque.build(dynamics.model) is not None


def test_it_is_built_once_for_all_gains(monkeypatch: pytest.MonkeyPatch) -> None:
    dynamics = new("two_link")
    job = preparation("computed_torque", dynamics, Settings())
    assert job is not None
    job()
    assert preparation("computed_torque", dynamics, Settings()) is None
    monkeypatch.setattr(computed_torque, "Kernel", None)
    for bandwidth in (5.0, 50.0):
        control = ComputedTorque(dynamics, bandwidth)
        fast = make_controller("computed_torque", dynamics, Settings(bandwidth=bandwidth))
        state = Measured(np.ones(2), np.ones(2))
        still = Reference(*np.zeros((3, 2)))
        assert_close(fast.torque(state, still), control.torque(state, still), ALGEBRA)


def test_nothing_is_built_unless_it_is_asked_for() -> None:
    dynamics = new("two_link")
    assert preparation("pd", dynamics, Settings()) is None
    assert preparation("operational_space", dynamics, Settings(frame="tip")) is not None
    make_controller("computed_torque", dynamics)
    assert not computed_torque.is_built(dynamics.model)


def test_without_a_compiler_it_is_still_right(
    monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    monkeypatch.setenv("CC", "/no/such/compiler")
    dynamics = new("two_link")
    agree(dynamics, rng)
    assert computed_torque.build(dynamics.model) is None


def test_a_law_that_differs_is_not_used(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, rng: np.random.Generator
) -> None:
    right = computed_torque.expression

    def wrong(*arguments: Any) -> ca.SX:
        return right(*arguments) * (1.0 + 1e-9)

    monkeypatch.setattr(computed_torque, "expression", wrong)
    dynamics = new("two_link")
    agree(dynamics, rng)
    assert computed_torque.build(dynamics.model) is None
    assert "differs" in caplog.text
    assert "slower" in caplog.text


@pytest.mark.parametrize(("off", "used"), [(5e-11, True), (2e-10, False)])
def test_small_torques_are_compared_as_torques_of_one(
    off: float, used: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """[N m]; of a motor's rotor on its own, which takes a thousandth of that."""
    right = computed_torque.expression
    monkeypatch.setattr(computed_torque, "expression", lambda *given: right(*given) + off)
    model = ArmModel(load_scene(rotor(1e-7, viscous=0.0, coulomb=0.0)))
    assert (computed_torque.build(model) is not None) == used


@pytest.mark.parametrize(("off", "used"), [(5e-11, True), (2e-10, False)])
def test_large_torques_are_compared_by_their_size(
    off: float, used: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a heavy wheel, in either direction."""
    right = computed_torque.expression
    monkeypatch.setattr(computed_torque, "expression", lambda *given: right(*given) * (1 + off))
    model = ArmModel(load_scene(rotor(1e3, viscous=0.0, coulomb=0.0)))
    assert (computed_torque.build(model) is not None) == used


def test_its_answer_is_the_callers_own(rng: np.random.Generator) -> None:
    law = CompiledComputedTorque(models.dynamics("two_link"))
    (state, reference), (other, goal), _ = states(rng, 2)
    first = law.torque(state, reference)
    kept = first.copy()
    law.torque(other, goal)
    np.testing.assert_array_equal(first, kept)


@pytest.mark.parametrize("bad", [np.ones(3), np.array([1.0, np.nan]), np.ones((1, 2))])
def test_bad_states_are_refused_as_by_the_plain_law(bad: np.ndarray) -> None:
    law, still = CompiledComputedTorque(models.dynamics("two_link")), Reference(*np.zeros((3, 2)))
    with pytest.raises(InvalidInput, match=r"state\.q"):
        law.torque(Measured(bad, np.zeros(2)), still)


@pytest.mark.parametrize("gains", [(-1.0,), (20.0, np.nan), (20.0, 1.0, -1e-3)])
def test_bad_gains_are_refused_as_by_the_plain_law(gains: tuple[float, ...]) -> None:
    with pytest.raises(InvalidInput):
        CompiledComputedTorque(models.dynamics("two_link"), *gains)


def test_for_other_compiled_code_it_is_the_same_to_the_bit(rng: np.random.Generator) -> None:
    dynamics = rubbing()
    control = CompiledComputedTorque(dynamics, 12.0, 0.8)
    law = compiled_law(control)
    assert law is not None and law.limit is None and law.call.entry is not None
    for state, reference in states(rng, dynamics.n):
        moving = np.concatenate((state.q, state.v, reference.q, reference.v, reference.a))
        law.call.inputs[0][:] = moving
        law.call.run()
        assert law.call.outputs[0].tobytes() == control.torque(state, reference).tobytes()


def test_limits_around_it_are_told_and_others_are_not_compiled() -> None:
    dynamics = models.dynamics("two_link")
    control = make_controller("computed_torque", dynamics, Settings(saturate=True, limit=7.0))
    law = compiled_law(control)
    assert law is not None and law.limit is not None and law.limit.tolist() == [7.0, 7.0]
    for settings in Settings(observer=10.0), Settings(observer=10.0, saturate=True):
        assert compiled_law(make_controller("computed_torque", dynamics, settings)) is None
    assert compiled_law(make_controller("pd", dynamics)) is None
    assert compiled_law(Saturated(make_controller("pid", dynamics), 1.0, 2)) is None


def test_without_a_compiler_there_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(computed_torque.compiler, "may_build", lambda: False)
    assert compiled_law(CompiledComputedTorque(new("two_link"))) is None
