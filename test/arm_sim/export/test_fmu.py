# SPDX-License-Identifier: Apache-2.0
"""Functional mock-up units: to the bit the simulator, in FMPy and in fmuloader."""

import ctypes
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from ctypes import c_char_p, c_int, c_void_p
from itertools import product
from pathlib import Path
from tempfile import mkdtemp
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from exported import said_by
from samples import covering

import models
from arm_dynamics import Dynamics, InvalidInput
from arm_dynamics.exceptions import CompilerMissing
from arm_sim import Simulator
from arm_sim.export import DERIVATIVES, export
from arm_sim.export.fmu import archive
from tolerances import FINITE_DIFF

pytestmark = pytest.mark.group("fmu")

TICKS = 200
DRY = {"viscous": 0.1, "coulomb": 0.5, "static": 0.8, "stribeck_velocity": 0.1}
VOLTAGE = {"resistance": 1.0, "torque_constant": 0.05, "gear_ratio": 20.0,
           "rotor_inertia": 1e-5, "command": "voltage"}  # fmt: skip
SCENES: dict[str, dict[str, Any]] = {
    "dry": {"joints": {"*": {"friction": DRY}}},
    "framed": {"joints": {"*": {"friction": DRY}}},
    "tunable": {
        "payloads": [{"frame": "tip", "mass": 0.5, "com": [0, 0, 0.05]}],
        "tunable": ["payload"],
        "joints": {"*": {"actuator": VOLTAGE}},
    },
}
FRAMES = ("forearm", "tip")
_OWN = {"3": ("setFloat64", "getFloat64", "getFMUState", "setFMUState"),
        "2": ("setReal", "getReal", "getFMUstate", "setFMUstate")}  # fmt: skip
# A logger of FMI 2.0, which is given a format and one text; FMPy's takes the format alone.
_LOG = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, c_char_p)
SLOPED = ("tunable", "dry")


def scene(kind: str) -> dict[str, Any]:
    steps = {"sim": {"integrator": "rk4", "dt": 1e-3}}  # of fixed length: they have derivatives
    return models.scene("two_link").model_dump(exclude_unset=True) | SCENES[kind] | steps


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, hasty: dict[str, str]) -> dict[str, Path]:
    """Folders with units of the scenes: one with frames, the others with derivatives."""
    folder = tmp_path_factory.mktemp("fmu")
    for kind in SCENES:
        given = {"frames": FRAMES} if kind == "framed" else {"terms": DERIVATIVES}
        with pytest.MonkeyPatch.context() as patch:
            if kind == "tunable":  # the others are as users get them
                patch.setattr(archive, "find_compiler", lambda: (hasty["CC"],))
            export(scene(kind), folder / kind, "unit", fmu=True, **{"terms": (), **given})
    return {kind: folder / kind for kind in SCENES}


@pytest.fixture(params=["3", "2"])
def version(request: pytest.FixtureRequest) -> str:
    """Each version of FMI in turn."""
    return str(request.param)


def packed(folder: Path, version: str) -> Path:
    return folder / ("unit.fmu" if version == "3" else "unit_fmi2.fmu")


class Unit:
    """A unit in FMPy, with values by name."""

    def __init__(self, folder: Path, version: str) -> None:
        from fmpy import extract, fmi2, fmi3, read_model_description

        self.three, self.texts = version == "3", list[str]()
        about = read_model_description(packed(folder, version))
        self.token = about.guid
        self.reference = {one.name: one.valueReference for one in about.modelVariables}
        place = extract(packed(folder, version), mkdtemp(dir=folder))
        given = {"guid": about.guid, "modelIdentifier": "unit", "unzipDirectory": place}
        self.own = (fmi3.FMU3Slave if self.three else fmi2.FMU2Slave)(**given)
        functions = _OWN[version]
        self._set, self._get, self.saved, self.restore = (getattr(self.own, x) for x in functions)
        if self.three:
            self.own.instantiate(logMessage=self._note)
        else:
            self._log = _LOG(self._note)
            logger = ctypes.cast(self._log, fmi2.fmi2CallbackLoggerTYPE)
            self.own.instantiate(callbacks=fmi2.fmi2CallbackFunctions(logger))

    def _note(self, *given: Any) -> None:
        self.texts.append(given[-1].decode())

    def begin(self, start: float = 0.0) -> None:
        if self.three:
            self.own.enterInitializationMode(startTime=start)
        else:
            self.own.setupExperiment(startTime=start)
            self.own.enterInitializationMode()

    def start(self, start: float = 0.0) -> None:
        self.begin(start)
        self.own.exitInitializationMode()

    def _references(self, names: Sequence[str]) -> list[int]:
        return [self.reference[name] for name in names]

    def set(self, names: Sequence[str], values: Sequence[float]) -> None:
        self._set(self._references(names), values)

    def get(self, names: Sequence[str]) -> np.ndarray:
        return np.array(self._get(self._references(names)))

    def derivative(
        self, unknowns: Sequence[str], knowns: Sequence[str], seeds: Sequence[float]
    ) -> np.ndarray:
        places = self._references(unknowns), self._references(knowns)
        return np.array(self.own.getDirectionalDerivative(*places, seeds))

    @contextmanager
    def refuses(self, words: str, status: int = 3) -> Iterator[None]:
        """Within the block a call fails with a status, and with words in the log."""
        from fmpy.fmi1 import FMICallException

        with pytest.raises(FMICallException) as refused:
            yield
        assert refused.value.status == status and words in self.texts[-1]


def names(simulator: Simulator, kind: str) -> list[str]:
    return [f"{joint}.{kind}" for joint in simulator.joint_names]


def test_a_unit_is_the_simulator_to_the_bit(
    made: dict[str, Path], version: str, rng: np.random.Generator
) -> None:
    """Also when it is set back, and when several ticks are one step."""
    simulator, unit = Simulator(scene("dry")), Unit(made["dry"], version)
    dt, tau = simulator.dt, 5.0 * rng.normal(size=(TICKS, 2))
    run = simulator.run(TICKS * dt, tau)
    outputs = names(simulator, "position") + names(simulator, "velocity")
    unit.begin()
    np.testing.assert_array_equal(unit.get(outputs), run.x[0, :4])
    unit.own.exitInitializationMode()

    def advance(begin: int, end: int) -> None:
        for k in range(begin, end):
            unit.set(names(simulator, "command"), tau[k])
            unit.own.doStep(k * dt, dt)
            np.testing.assert_array_equal(unit.get(outputs), run.x[k + 1, :4])
            np.testing.assert_array_equal(unit.get(names(simulator, "effort")), run.tau[k])

    half = TICKS // 2
    advance(0, half)
    middle = unit.saved()
    advance(half, TICKS)
    unit.restore(middle)
    advance(half, TICKS)
    unit.own.doStep(TICKS * dt, 10 * dt)
    simulator.run(10 * dt, tau[-1])
    np.testing.assert_array_equal(unit.get(outputs), simulator.arm.x[:4])
    np.testing.assert_allclose(unit.get(["time"]), (TICKS + 10) * dt)
    unit.own.freeInstance()


def test_starting_values_and_parameters_are_the_simulators(
    made: dict[str, Path], version: str
) -> None:
    simulator, unit = Simulator(scene("tunable")), Unit(made["tunable"], version)
    q, v, outputs = [0.3, -0.4], [1.0, 0.5], names(simulator, "position")
    mass = next(name for name in unit.reference if name and name.startswith("payload"))
    unit.set(names(simulator, "initial_position"), q)
    unit.begin(start=5.0)
    unit.set(names(simulator, "initial_velocity"), v)
    unit.own.exitInitializationMode()
    still = Unit(made["tunable"], version)
    still.set([mass], [still.get([mass])[0] + 1.0])
    still.start()
    simulator.reset(q, v)
    for k in range(50):
        unit.own.doStep(5.0 + k * simulator.dt, simulator.dt)
        still.own.doStep(k * simulator.dt, simulator.dt)
        np.testing.assert_array_equal(unit.get(outputs), simulator.step(np.zeros(2)).q)
    assert abs(still.get(outputs) - simulator.state.q).max() > 1e-3


def test_a_unit_that_is_reset_is_as_new(made: dict[str, Path], version: str) -> None:
    """Time, state, command, parameters and starting values."""
    simulator, unit = Simulator(scene("tunable")), Unit(made["tunable"], version)
    mass = next(name for name in unit.reference if name and name.startswith("payload"))
    every, (before,) = [*unit.reference], unit.get([mass])
    unit.set([*names(simulator, "initial_position"), mass], [0.3, -0.4, before + 1.0])
    unit.start(start=5.0)
    unit.set(names(simulator, "command"), [3.0, 1.0])
    unit.own.doStep(5.0, 10 * simulator.dt)
    unit.own.reset()
    new = Unit(made["tunable"], version)
    for one in (unit, new):
        one.start()
        one.own.doStep(0.0, 10 * simulator.dt)
    np.testing.assert_array_equal(unit.get(every), new.get(every))


@pytest.mark.parametrize(("kind", "version", "ticks"), covering(SLOPED, ["3", "2"], [1, 4]))
def test_directional_derivatives_are_those_of_the_last_step(
    made: dict[str, Path], kind: str, version: str, ticks: int
) -> None:
    """Of positions and velocities as ``Simulator.linearize`` has them, also after a restore."""
    simulator, unit = Simulator(scene(kind)), Unit(made[kind], version)
    outputs = names(simulator, "position") + names(simulator, "velocity")
    efforts, commands, dt = names(simulator, "effort"), names(simulator, "command"), simulator.dt
    tau, begin, step = np.array([9.0, -5.0]), 20 * dt, ticks * dt
    unit.start()
    unit.set(commands, tau)
    assert unit.derivative(outputs, commands, [1.0, 1.0]).tolist() == [0.0] * 4
    unit.own.doStep(0.0, begin)
    simulator.run(begin, tau)
    before = unit.saved()
    unit.own.doStep(begin, step)
    after = unit.saved()
    unit.restore(before)
    unit.restore(after)
    _, B = simulator.linearize(simulator.state, tau, ticks)
    found = unit.derivative(outputs, commands, [0.3, -2.0])
    np.testing.assert_allclose(found, B @ [0.3, -2.0], rtol=0.0, atol=1e-14)
    if kind == "tunable":
        place = [n for n in unit.reference if n and n.startswith("payload")]
        *_, P = simulator.linearize(simulator.state, tau, ticks, by=["payload"])
        seeds = np.linspace(0.1, 1.0, len(place))
        found = unit.derivative(outputs, place, seeds)
        np.testing.assert_allclose(found, P["payload"] @ seeds, rtol=0.0, atol=1e-14)
    found, change = unit.derivative(efforts, commands, [1.0, 0.5]), []
    for sign in (1.0, -1.0):
        unit.restore(before)
        unit.set(commands, tau + sign * 1e-5 * np.array([1.0, 0.5]))
        unit.own.doStep(begin, step)
        change.append(unit.get(efforts))
    np.testing.assert_allclose(found, (change[0] - change[1]) / 2e-5, rtol=0.0, atol=FINITE_DIFF)


def test_derivatives_that_do_not_exist_are_refused(made: dict[str, Path], version: str) -> None:
    """An event in the step discards; starting values are knowns before the start alone."""
    unit = Unit(made["dry"], version)
    joints = [str(n).split(".")[0] for n in unit.reference if str(n).endswith(".command")]
    positions, commands = ([f"{j}.{what}" for j in joints] for what in ("position", "command"))
    starts = [f"{joint}.initial_position" for joint in joints]
    unit.begin()
    np.testing.assert_allclose(unit.derivative(positions, starts, [1.0, 2.0]), [1.0, 2.0])
    unit.own.exitInitializationMode()
    unit.set(commands, [9.0, -5.0])
    unit.own.doStep(0.0, 0.1)  # joints break away
    with unit.refuses("no derivative", 2):
        unit.derivative(positions, commands, [1.0, 0.0])
    for unknowns, knowns in ((positions, starts), (commands, commands)):
        with unit.refuses(""):
            unit.derivative(unknowns, knowns, [1.0, 0.0])
    plain = Unit(made["framed"], version)
    with plain.refuses(""):
        plain.derivative(positions, commands, [1.0, 0.0])
    for kind, provides in (("dry", True), ("framed", False)):
        file = zipfile.ZipFile(packed(made[kind], version))
        description = file.read("modelDescription.xml").decode()
        assert ("providesDirectionalDerivative" in description) == provides


def test_wrenches_act_on_the_frames_that_were_named(made: dict[str, Path], version: str) -> None:
    """Besides external torques; without any, the unit is the simulator to the bit."""
    given = scene("dry") | {"tunable": ["external"]}
    simulator, unit = Simulator(given), Unit(made["framed"], version)
    wrenches = {"forearm": 5.0 * np.arange(1.0, 7.0), "tip": -5.0 * np.arange(1.0, 7.0)}
    inputs = map(".wrench.".join, product(FRAMES, ("force", "torque")))
    inputs = [f"{one}.{axis}" for one in inputs for axis in "xyz"]
    outputs, dt = names(simulator, "position") + names(simulator, "velocity"), simulator.dt
    jacobian = simulator.dynamics.jacobian
    unit.start()
    for k in range(TICKS):
        if k == 20:
            unit.set(inputs, np.concatenate([*wrenches.values()]))
            unit.set(["external[1]"], [2.0])
        if k >= 20:
            q = simulator.state.q
            pushed = [jacobian(q, frame).T @ w for frame, w in wrenches.items()]
            simulator.set_parameter("external", [0.0, 2.0] + sum(pushed))
        unit.own.doStep(k * dt, dt)
        expected = simulator.step(np.zeros(2))
        if k < 20:
            np.testing.assert_array_equal(unit.get(outputs), [*expected.q, *expected.v])
    np.testing.assert_allclose(unit.get(outputs), [*expected.q, *expected.v], rtol=1e-10)
    assert abs(expected.v).max() > 0.1


def test_what_is_not_allowed_is_an_error_that_says_so(made: dict[str, Path], version: str) -> None:
    unit = Unit(made["framed"], version)
    command, position = [next(x for x in unit.reference if x and x.endswith(k))
                         for k in (".command", ".position")]  # fmt: skip
    with unit.refuses("initialization"):
        unit.own.doStep(0.0, 1e-3)
    unit.start()
    for point, time in ((0.0, 0.3e-3), (0.0, -1e-3), (0.0, 0.0), (0.04, 1e-3), (np.nan, 1e-3)):
        with unit.refuses("from 0 s, where"):
            unit.own.doStep(point, time)
    for name, value, said in (
        (command, np.nan, "not finite"), (position, 0.0, "computed"),
        (f"{position[:-9]}.initial_position", 0.1, "until initialization is over"),
    ):  # fmt: skip
        with unit.refuses(said):
            unit.set([name], [value])
    unit.own.doStep(0.0, 1e-3)


def test_importers_may_add_up_times_and_begin_at_any_date(
    made: dict[str, Path], version: str
) -> None:
    """Sums of ticks are off by 1e-6 of one after 300 s, differences of dates by 1e-4 at once."""
    simulator, date = Simulator(scene("framed")), 1.7e9
    unit, dated = (Unit(made["framed"], version) for _ in range(2))
    for one, start in ((unit, 0.0), (dated, date)):
        one.start(start)
    for k in range(50):
        late, now = 0.3 * simulator.dt, date + k * simulator.dt
        unit.own.doStep(k * simulator.dt + late, simulator.dt)
        dated.own.doStep(now, (date + (k + 1) * simulator.dt) - now)
        q = simulator.step(np.zeros(2)).q
        for one in (unit, dated):
            np.testing.assert_array_equal(one.get(names(simulator, "position")), q)


def test_an_export_that_cannot_have_units_writes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(InvalidInput, match="fmu = True with tick = False"):
        export(scene("framed"), tmp_path / "no", tick=False, fmu=True)
    monkeypatch.setattr(archive, "find_compiler", lambda: None)
    with pytest.raises(CompilerMissing, match="no C compiler"):
        export(scene("framed"), tmp_path / "no", terms=(), fmu=True)
    assert not list(tmp_path.iterdir())


def test_the_same_scene_gives_the_same_bytes(made: dict[str, Path], tmp_path: Path) -> None:
    export(scene("framed"), tmp_path / "again", "unit", terms=(), fmu=True, frames=FRAMES)
    for file in ("unit.fmu", "unit_fmi2.fmu"):
        assert (tmp_path / "again" / file).read_bytes() == (made["framed"] / file).read_bytes()


def test_importers_may_compile_the_sources_without_a_warning(
    made: dict[str, Path], version: str, tmp_path: Path
) -> None:
    zipfile.ZipFile(packed(made["dry"], version)).extractall(tmp_path)
    for source in (tmp_path / "sources").glob("*.c"):
        said_by("cc", "-std=c11", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", source)


def test_fmpy_finds_nothing_wrong(made: dict[str, Path], version: str) -> None:
    from fmpy.validation import validate_fmu

    for kind in ("dry", "framed"):
        assert not validate_fmu(str(packed(made[kind], version)))


def test_another_importer_runs_it_to_the_bit(made: dict[str, Path]) -> None:
    """By FMI 3.0; by FMI 2.0 fmuloader asks co-simulation for functions of model exchange."""
    from fmuloader.fmi3 import Fmi3Slave

    simulator, own = Simulator(scene("dry")), Unit(made["dry"], "3")
    unit = Fmi3Slave(made["dry"] / "unit.fmu", model_identifier="unit")
    unit.instantiate_co_simulation("one", instantiation_token=own.token)
    unit.enter_initialization_mode(start_time=0.0)
    unit.exit_initialization_mode()
    position = [own.reference[name] for name in names(simulator, "position")]
    for k in range(TICKS):
        unit.do_step(k * simulator.dt, simulator.dt)
        expected = simulator.step(np.zeros(2)).q
        np.testing.assert_array_equal(unit.get_float64(position), expected)
    unit.terminate()
    unit.free_instance()


def test_commands_have_the_limits_of_the_scene(made: dict[str, Path], version: str) -> None:
    file = zipfile.ZipFile(packed(made["framed"], version))
    root = ElementTree.fromstring(file.read("modelDescription.xml"))
    model = Dynamics(scene("framed")).model
    for joint, limit in zip(model.joint_names, model.command_limit, strict=True):
        (one,) = (x for x in root.iter() if x.get("name") == f"{joint}.command")
        about = one if version == "3" else one[0]
        assert (float(about.get("min", "")), float(about.get("max", ""))) == (-limit, limit)
