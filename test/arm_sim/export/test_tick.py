# SPDX-License-Identifier: Apache-2.0
"""Exported ticks, compiled by the system's compilers, against ``Simulator``, to the bit.

Their derivatives against ``Simulator.linearize``.
"""

import ctypes
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exported import (
    BITS,
    C11,
    CPP17,
    LEVELS,
    Library,
    Ticks,
    assert_portable,
    compilers,
    pointer,
    run_test_program,
)
from samples import always

from arm_dynamics import Dynamics, load_scene
from arm_dynamics.arrays import Array
from arm_sim import JointCommand, NotDifferentiable, Simulator
from arm_sim.export import DERIVATIVES, export
from tolerances import EXPORT, assert_close

URDF = Path(__file__).parents[3] / "src/arm_sim/arm_sim/scenes/two_link.urdf"
STUCK = {
    "robot": {"urdf": str(URDF)},
    "joints": {"*": {"friction": {"coulomb": 1.0, "static": 1.5, "stribeck_velocity": 0.1}}},
    "sim": {"tolerance": 1e-8},
    "tunable": ["gravity", "friction", "coulomb"],
}
LUGRE = {"sigma0": 1e4, "sigma1": 100.0, "sigma1_velocity": 0.02}
ROWS = {"speed": [0, 0.5, 3], "torque": [[1, 0.5, 2], [0.5, 0.7, 1]], "position": [-1, 1]}
SPRING = {"deflection": [-1, 0, 1], "torque": [-3, 0, 5]}
LAWS = {
    "robot": {"urdf": str(URDF)},
    "joints": {
        "shoulder": {"friction": {"coulomb": 1.0, "static": 1.5, "stribeck_velocity": 0.01,
                                  "viscous": 0.4, "lugre": LUGRE}},
        "elbow": {"friction": {"table": ROWS}, "spring": {"table": SPRING}},
    },
    "initial": {"position": {"shoulder": 0.3, "elbow": 0.5}},
}  # fmt: skip
BUNDLED = ("four_bar", "table_arm", "slider_crank_motor", "panda", "panda_table", "ur10")
SCENES: dict[str, Any] = {"stuck": STUCK, "laws": LAWS} | {name: name for name in BUNDLED}
TICKS, HELD = 1000, 50
SMALL = ("stuck", "four_bar")  # what is compiled in many ways

FIXED = {"sim": {"integrator": "rk4", "dt": 1e-4}}
DRY = {"joints": {"*": {"friction": {"coulomb": 1.0, "static": 1.5, "viscous": 0.1}}}}
SLOPED: dict[str, tuple[str, dict[str, Any]]] = {  # with derivatives
    "linkage": ("four_bar", FIXED),
    "dry": ("two_link", DRY),
    "in_contact": ("panda_table", {}),
    "motor": ("slider_crank_motor", FIXED),
    "implicit": ("two_link", DRY | {"sim": {"integrator": "implicit", "dt": 2e-3}}),
    "limited": ("two_link", {"joints": {"*": {"limits": {"effort": 5.0}}}}),
    "hanging": ("two_link", FIXED | {"commands": {"gravity_compensated": True}}),
}


class Case:
    """A scene, its simulator and its library, by each compiler."""

    def __init__(self, name: str, folder: Path) -> None:
        scene = SCENES.get(name)
        if scene is None:
            bundled, more = SLOPED[name]
            scene = load_scene(bundled).model_dump(exclude_unset=True) | more
        self.simulator, self.folder, self.name = Simulator(scene), folder / name, name
        export(self.simulator.model, self.folder, name, DERIVATIVES if name in SLOPED else ())
        self.libraries = [Library(self.folder, name, BITS, one) for one in compilers()]
        self.library = self.libraries[0]

    def ticks(self, compiler: int = 0) -> Ticks:
        return Ticks(self.libraries[compiler], self.simulator.n)

    def slopes(self, ticks: Ticks, command: Array) -> tuple[int, Array, Array]:
        """Code, A and B; those are NaN where they are not set."""
        nx, n = self.simulator.arm.plant.nx, self.simulator.n
        A, B = np.full((nx, nx), np.nan), np.full((nx, n), np.nan)
        code = ticks.function("sim_linearize")(*map(pointer, (ticks.memory, command, A, B)))
        return int(code), A, B

    def commands(self, count: int = TICKS) -> Array:
        n, limit = self.simulator.n, self.simulator.model.command_limit
        limit = np.where(np.isfinite(limit), np.minimum(limit, 60.0), 2.0)
        ways = np.random.default_rng(2).uniform(-0.6, 0.6, (count // HELD, n))
        return np.repeat(ways * limit, HELD, axis=0)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Case]:
    """Cases by name, each made once."""
    folder = tmp_path_factory.mktemp("exported")
    return cache(lambda name: Case(name, folder))


@pytest.fixture(params=always(SCENES, *(set(SCENES) - {"panda", "panda_table", "ur10"})))
def case(request: pytest.FixtureRequest, made: Callable[[str], Case]) -> Case:
    return made(request.param)


def test_ticks_are_those_of_the_simulator_to_the_bit(case: Case) -> None:
    simulator, ticks, commands = case.simulator, case.ticks(), case.commands()
    simulator.reset()
    assert ticks.init() == 0
    expected = simulator.run(TICKS * simulator.dt, commands)
    made = ticks.run(commands)
    assert made.tobytes() == np.hstack([expected.q, expected.v])[1:].tobytes()
    assert np.array_equal(ticks.state()[2], simulator.effort)
    for compiler in range(1, len(case.libraries)):
        other = case.ticks(compiler)
        assert other.init() == 0
        assert other.run(commands).tobytes() == made.tobytes()
    first, copy = case.ticks(), case.ticks()
    assert first.init() == 0
    first.run(commands[:77])
    copy.memory[:] = first.memory  # in the middle
    assert copy.run(commands[77:]).tobytes() == made[77:].tobytes()
    period = ticks.function("sim_period")
    period.restype = ctypes.c_double
    assert (ticks.function("sim_joints")(), period()) == (simulator.n, simulator.dt)
    lower, upper = np.zeros((2, simulator.n))
    ticks.function("sim_range")(pointer(lower), pointer(upper))
    np.testing.assert_array_equal([lower, upper], simulator.model.stops.bounds)


def test_it_begins_at_any_state_that_the_simulator_allows(case: Case) -> None:
    simulator, ticks = case.simulator, case.ticks()
    simulator.reset(simulator.model.q0, 0.01 * np.ones(simulator.n))
    state = simulator.state
    assert ticks.init(state.q, state.v) == 0
    commands = case.commands(200)
    expected = simulator.run(200 * simulator.dt, commands)
    made = ticks.run(commands)
    assert made.tobytes() == np.hstack([expected.q, expected.v])[1:].tobytes()


def test_wrong_numbers_get_codes_with_texts_and_change_nothing(case: Case) -> None:
    ticks, n = case.ticks(), case.simulator.n
    assert ticks.init() == 0
    before = ticks.memory.copy()
    assert "not finite" in ticks.text(ticks.step(np.full(n, np.nan)))
    assert "no such parameter" in ticks.text(ticks.set("nonsense", 1.0))
    assert ticks.memory.tobytes() == before.tobytes()
    assert "not finite" in ticks.text(ticks.init(np.full(n, np.inf), np.zeros(n)))
    assert (ticks.text(0), ticks.text(99)) == ("no error", "unknown code")


@pytest.mark.parametrize("case", always([*SCENES, *SLOPED], *SMALL), indirect=True)
def test_code_is_portable(case: Case, request: pytest.FixtureRequest) -> None:
    """Whatever the level and the language: no loop that sets zeros becomes ``memset``."""
    levels = LEVELS if request.config.getoption("--nightly") else ("-O0", "-Os")
    assert_portable(case.folder, case.name, levels, (C11, CPP17))


def test_the_test_program_passes(case: Case, tmp_path: Path) -> None:
    source = case.folder / f"test_{case.name}.c"
    status, said = run_test_program(case.library, source, tmp_path / "program")
    assert status == 0 and "all results are right" in said


def test_tunable_numbers_act_as_in_the_simulator(tmp_path: Path) -> None:
    case = Case("stuck", tmp_path)
    ticks, simulator, commands = case.ticks(), case.simulator, case.commands(200)
    assert ticks.init() == 0
    assert ticks.set("gravity[2]", -1.6) == 0
    assert ticks.set("friction[1]", 0.7) == ticks.set("coulomb[1]", 0.4) == 0
    assert "cannot have this value" in ticks.text(ticks.set("coulomb[1]", -0.4))
    assert "cannot have this value" in ticks.text(ticks.set("friction[1]", -0.7))
    assert "cannot have this value" in ticks.text(ticks.set("gravity[0]", np.nan))
    simulator.reset()
    simulator.set_parameter("gravity", [0.0, 0.0, -1.6])
    simulator.set_parameter("friction", [simulator.model.viscous[0], 0.7])
    simulator.set_parameter("coulomb", [1.0, 0.4])
    expected = simulator.run(200 * simulator.dt, commands)
    assert ticks.run(commands).tobytes() == np.hstack([expected.q, expected.v])[1:].tobytes()


def test_servos_track_as_those_of_the_simulator_to_the_bit(tmp_path: Path) -> None:
    """Positions with velocities, velocities, efforts alone and beside them."""
    export(STUCK, tmp_path / "arm", "arm", terms=(), servo=True)
    ticks, simulator, n = Ticks(Library(tmp_path / "arm", "arm"), 2), Simulator(STUCK), 2
    rng, command, none = np.random.default_rng(3), np.zeros(n), np.full(n, np.nan)
    assert ticks.init() == 0
    for k in range(200):
        position, velocity, effort = rng.uniform(-0.5, 0.5, (3, n))
        given = [(position, velocity, effort), (none, velocity, none), (none, none, effort),
                 (np.where([1, 0], position, np.nan), velocity, none)][k % 4]  # fmt: skip
        ticks.function("sim_servo")(*map(pointer, (ticks.memory, *given, command)))
        assert ticks.step(command) == 0
        state = simulator.step(JointCommand(*given))
        assert np.array_equal(np.concatenate(ticks.state()[:2]), [*state.q, *state.v])
    ticks.function("sim_servo")(pointer(ticks.memory), None, None, None, pointer(command))
    assert not command.any()


def test_bodies_and_friction_that_cannot_be_are_refused(tmp_path: Path) -> None:
    export(STUCK | {
        "payloads": [{"frame": "tip", "mass": 0.5, "inertia": [1e-3, 0, 0, 1e-3, 0, 1e-3]}] * 2,
        "tunable": ["payload", "coulomb"],
        "joints": {"elbow": {"friction": {"coulomb": 1.0}}},
    }, tmp_path / "arm", "arm", terms=())  # fmt: skip
    ticks = Ticks(Library(tmp_path / "arm", "arm"), 2)
    assert ticks.init() == 0
    for place in (0, 10, 4, 7, 19):  # masses and moments of inertia
        assert "cannot have this value" in ticks.text(ticks.set(f"payload[{place}]", -1e-3))
    for place in (1, 5, 18):  # centres of mass and products of inertia
        assert ticks.set(f"payload[{place}]", -1e-4) == 0
    assert ticks.set("coulomb[0]", 0.0) == ticks.set("coulomb[1]", 3.0) == 0
    assert "cannot have this value" in ticks.text(ticks.set("coulomb[0]", 0.1))  # it has none


@pytest.mark.parametrize(("name", "away", "said"), [
    ("four_bar", 0.1, "loops are open"),
    ("stuck", 4.0, "beyond its stop"),
    ("table_arm", np.array([-0.1, 0.0]), "inside its plane"),
])  # fmt: skip
def test_states_that_are_impossible_are_refused(
    made: Callable[[str], Case], name: str, away: Any, said: str
) -> None:
    case = made(name)
    ticks = case.ticks()
    code = ticks.init(case.simulator.model.q0 + away, np.zeros(case.simulator.n))
    assert said in ticks.text(code)


# --- derivatives ---------------------------------------------------------------------------------


@pytest.mark.parametrize("case", always(SLOPED, "dry", "motor", "limited"), indirect=True)
def test_derivatives_are_those_of_the_simulator_or_refused(
    case: Case, rng: np.random.Generator
) -> None:
    """Of every compiler; where there is no derivative, there is a code."""
    simulator, answered, differentiable = case.simulator, 0, 0
    every = [case.ticks(compiler) for compiler in range(len(case.libraries))]
    assert {ticks.init() for ticks in every} == {0}
    simulator.reset()
    limit = np.minimum(simulator.model.command_limit, 40.0)
    for k in range(120):
        if k % 20 == 0:
            command = rng.uniform(-0.9, 0.9, simulator.n) * limit
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
    assert answered > 0.8 * differentiable > 60


def test_what_has_no_derivative_gets_a_code_with_a_text(made: Callable[[str], Case]) -> None:
    """A command at its limit, or that is no number; a joint that comes to rest in the tick."""
    dry, arm = made("dry"), made("limited")
    ticks = arm.ticks()
    assert ticks.init() == 0
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
