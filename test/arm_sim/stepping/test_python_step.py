# SPDX-License-Identifier: Apache-2.0
"""A step from Python by compiled code is the step by Python, to the bit and to the word."""

import dataclasses
import sysconfig
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import InvalidInput
from arm_dynamics.codegen import python_call
from arm_sim import SimulationDiverged, Simulator, State
from arm_sim.stepping.python_function import unanswered

ARM = {"robot": {"urdf": str(models.FOLDER / "planar_3r.urdf"), "lock": ["joint3"]}}
MOTOR = {"resistance": 0.8, "inductance": 1e-3, "torque_constant": 0.1}
SCENES: dict[str, dict[str, Any]] = {
    "smooth": {},
    "internal states": {"joints": {"*": {"actuator": MOTOR}}},
    "error control": {"sim": {"integrator": "dopri5", "tolerance": 1e-6}},
    "events": {"joints": {"*": {"friction": {"coulomb": 0.5}}}},
    "limits": {"joints": {"*": {"limits": {"effort": 1.0}}}},
    "sensors": {"sensors": {"position": {"noise": 1e-3}}},
    "delays": {"commands": {"delay": 2e-3}},
}
BAD: dict[str, Any] = {
    "short": np.zeros(1), "rows": np.zeros((1, 2)), "NaN": np.array([0.0, np.nan]),
    "none": None, "complex": np.zeros(2, complex), "truth": np.zeros(2, bool),
    "long list": [1.0, 2.0, 3.0], "infinite, in a list": [0.0, np.inf],
    "truth in a list": [1.0, True], "list in a list": [1.0, [2.0]],
}  # fmt: skip
USUAL: dict[str, Any] = {
    "tuple": (0.3, -0.2), "mixed": [1, -0.2], "whole": np.array([1, -2]),
    "apart": np.array([0.3, 9.0, -0.2])[::2], "other order": np.array([0.3, -0.2], ">f8"),
    "huge": np.array([1e308, 1e308]), "negative zero": np.array([-0.0, 0.0]),
}  # fmt: skip


def pair(scene: dict[str, Any]) -> tuple[Simulator, Simulator]:
    """Two simulators: one that steps by compiled code, one by Python."""
    both = Simulator(ARM | scene), Simulator(ARM | scene)
    both[1].arm._step = unanswered
    return both


def assert_same(one: State, other: State) -> None:
    for field in dataclasses.fields(State):
        a, b = getattr(one, field.name), getattr(other, field.name)
        assert type(a) is type(b), field.name
        np.testing.assert_array_equal(a, b, field.name)


@pytest.mark.parametrize("name", SCENES)
def test_states_are_the_same(name: str, rng: np.random.Generator) -> None:
    by_code, by_python = pair(SCENES[name])
    for tau in rng.normal(0.0, 2.0, (40, 2)):
        state = by_code.step(tau)
        assert_same(state, by_python.step(tau))
        assert state is by_code.state
        assert_same(by_code.measured, by_python.measured)
        np.testing.assert_array_equal(by_code.effort, by_python.effort)
    assert by_code.arm._step is not unanswered
    assert (by_code.arm.step_count, by_code.impacts) == (40, by_python.impacts)
    assert not any(array.flags.writeable for array in (state.q, state.v, state.z))


@pytest.mark.parametrize("name", USUAL)
def test_usual_commands(name: str) -> None:
    by_code, by_python = pair({})
    assert_same(by_code.step(USUAL[name]), by_python.step(USUAL[name]))


@pytest.mark.parametrize("name", BAD)
def test_bad_commands(name: str) -> None:
    by_code, by_python = pair({})
    before, said = by_code.step(np.ones(2)), list[str]()
    for sim in (by_code, by_python):
        with pytest.raises(InvalidInput) as raised:
            sim.step(BAD[name])
        said.append(str(raised.value))
    assert said[0] == said[1]
    assert by_code.state is before and by_code.effort[0] == 1.0


def test_the_state_is_kept_where_a_tick_cannot_be_computed() -> None:
    by_code, by_python = pair({})
    for sim in (by_code, by_python):
        sim.set_state(v=np.array([1e160, 1e160]))
    before, said = by_code.state, list[str]()
    for sim in (by_code, by_python):
        with pytest.raises(SimulationDiverged) as raised:
            sim.step(np.zeros(2))
        said.append(str(raised.value))
    assert said[0] == said[1]
    assert_same(by_code.state, before)


def test_another_scene_takes_over() -> None:
    """Compiled ticks are those of the scene in use."""
    sim, other = pair({})
    sim.step(np.ones(2))
    arm = sim.arm
    arm.use(arm.compiled.with_external_torques())
    sim.set_parameter("external", [0.5, 0.0])
    other.step(np.ones(2))
    assert_same(sim.step(np.ones(2)), other.step(np.array([1.5, 1.0])))


def test_without_the_headers_of_python(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> None:
    python_call.python_function.cache_clear()
    monkeypatch.setattr(sysconfig, "get_path", lambda name: str(tmp_path))
    sim, other = Simulator(ARM), Simulator(ARM)
    assert_same(sim.step(np.ones(2)), other.step([1.0, 1.0]))
    assert sim.arm._step is unanswered
    python_call.python_function.cache_clear()
