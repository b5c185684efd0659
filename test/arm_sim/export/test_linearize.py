# SPDX-License-Identifier: Apache-2.0
"""Derivatives of exported ticks against ``Simulator.linearize``, and against differences."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exported import BITS, CPP17, Library, Ticks, assert_portable, compilers, pointer
from samples import always

from arm_dynamics import Dynamics, load_scene
from arm_dynamics.arrays import Array
from arm_sim import NotDifferentiable, Simulator
from arm_sim.export import DERIVATIVES, export
from tolerances import EXPORT, assert_close

FIXED = {"sim": {"integrator": "rk4", "dt": 1e-4}}
DRY = {"joints": {"*": {"friction": {"coulomb": 1.0, "static": 1.5, "viscous": 0.1}}}}
SCENES: dict[str, tuple[str, dict[str, Any]]] = {
    "four_bar": ("four_bar", FIXED),
    "dry": ("two_link", DRY),
    "panda_table": ("panda_table", {}),
    "slider_crank_motor": ("slider_crank_motor", FIXED),
    "implicit": ("two_link", DRY | {"sim": {"integrator": "implicit", "dt": 2e-3}}),
    "limited": ("two_link", {"joints": {"*": {"limits": {"effort": 5.0}}}}),
    "hanging": ("two_link", FIXED | {"commands": {"gravity_compensated": True}}),
}
TICKS, HELD = 120, 20


class Case:
    """A scene, its simulator and its library, which has derivatives."""

    def __init__(self, name: str, folder: Path) -> None:
        scene, more = SCENES[name]
        self.simulator = Simulator(load_scene(scene).model_dump(exclude_unset=True) | more)
        self.name, self.folder, self.n = name, folder / name, self.simulator.n
        export(self.simulator.model, self.folder, name, DERIVATIVES)
        self.libraries = [Library(self.folder, name, BITS, compiler) for compiler in compilers()]

    def ticks(self, compiler: int = 0) -> Ticks:
        ticks = Ticks(self.libraries[compiler], self.n)
        assert ticks.init() == 0
        return ticks

    def slopes(self, ticks: Ticks, command: Array) -> tuple[int, Array, Array]:
        """Code, A and B; those are NaN where they are not set."""
        nx = self.simulator.arm.plant.nx
        A, B = np.full((nx, nx), np.nan), np.full((nx, self.n), np.nan)
        code = ticks.function("sim_linearize")(*map(pointer, (ticks.memory, command, A, B)))
        return int(code), A, B


SMALL = ("dry", "slider_crank_motor", "limited")  # others take long, or are like these


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Case]:
    """Cases by name, each made once."""
    folder = tmp_path_factory.mktemp("linearized")
    return cache(lambda name: Case(name, folder))


@pytest.fixture(params=always(SCENES, *SMALL))
def case(request: pytest.FixtureRequest, made: Callable[[str], Case]) -> Case:
    return made(request.param)


def test_derivatives_are_those_of_the_simulator_or_refused(
    case: Case, rng: np.random.Generator
) -> None:
    """Of every compiler; where there is no derivative, there is a code."""
    simulator, answered, differentiable = case.simulator, 0, 0
    every = [case.ticks(compiler) for compiler in range(len(case.libraries))]
    simulator.reset()
    limit = np.minimum(simulator.model.command_limit, 40.0)
    for k in range(TICKS):
        if k % HELD == 0:
            command = rng.uniform(-0.9, 0.9, case.n) * limit
        made = [case.slopes(ticks, command) for ticks in every]
        try:
            expected = simulator.linearize(simulator.state, command)
        except NotDifferentiable:
            expected = None
        differentiable += expected is not None
        for code, A, B in made:
            if code == 0:
                assert expected is not None
                assert_close(A, expected[0], EXPORT)
                assert_close(B, expected[1], EXPORT)
            else:
                assert np.isnan(A).all() and np.isnan(B).all()
        answered += made[0][0] == 0
        simulator.step(command)
        for ticks in every:
            assert ticks.step(command) == 0
    assert answered > 0.8 * differentiable > 0.5 * TICKS


@pytest.mark.parametrize("case", always(SCENES), indirect=True)
def test_it_is_as_portable_as_the_rest(case: Case) -> None:
    assert_portable(case.folder, case.name, ("-Os",), (CPP17,))
    assert "derivatives, A" in (case.folder / f"test_{case.name}.c").read_text()


def test_what_has_no_derivative_gets_a_code_with_a_text(made: Callable[[str], Case]) -> None:
    """A command at its limit, or that is no number; a joint that comes to rest in the tick."""
    dry, arm = made("dry"), made("limited")
    ticks = arm.ticks()
    before = ticks.memory.copy()
    tied = np.array([5.0, 0.0])
    code, *_ = arm.slopes(ticks, tied)
    assert "no derivative" in ticks.text(code)
    with pytest.raises(NotDifferentiable):
        arm.simulator.linearize(arm.simulator.state, tied)
    code, *_ = arm.slopes(ticks, np.full(2, np.nan))
    assert "not finite" in ticks.text(code)
    assert ticks.memory.tobytes() == before.tobytes()
    ticks = dry.ticks()
    assert ticks.init(np.zeros(2), np.array([1e-5, 0.0])) == 0
    weight = Dynamics(dry.simulator.model).gravity(np.zeros(2))
    code, *_ = dry.slopes(ticks, weight)
    assert "an event" in ticks.text(code)


def test_ticks_under_error_control_have_none_which_is_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    export("slider_crank_motor", tmp_path / "arm", "arm", DERIVATIVES)
    assert "linearize" not in (tmp_path / "arm/arm.h").read_text()
    assert "no derivatives of ticks" in (tmp_path / "arm/README.md").read_text()
    assert "the tick has no derivatives: its error is controlled" in caplog.text
