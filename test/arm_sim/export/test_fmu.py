# SPDX-License-Identifier: Apache-2.0
"""Functional mock-up units: to the bit the simulator, by a small importer and by FMPy."""

import ctypes
import zipfile
from collections.abc import Sequence
from ctypes import byref, c_bool, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
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
SLOPED = ("tunable", "dry")
_LOG = {
    "3": ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p),
    "2": ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, c_char_p),
}


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


class Importer:
    """As much of an importer as the tests need, by FMI 3.0 or 2.0."""

    def __init__(self, folder: Path, version: str) -> None:
        self.version, self.texts, self.statuses = version, list[str](), list[int]()
        place = Path(mkdtemp(dir=folder))
        zipfile.ZipFile(packed(folder, version)).extractall(place)
        self._library = ctypes.CDLL(str(next(place.glob("binaries/*/unit.so"))))
        root = ElementTree.parse(place / "modelDescription.xml").getroot()
        tag = "Float64" if version == "3" else "ScalarVariable"
        self.reference = {x.get("name"): int(x.get("valueReference", "")) for x in root.iter(tag)}
        self.token = root.get("instantiationToken") or root.get("guid") or ""
        self._logger = _LOG[version](self._note)
        self.unit = c_void_p(self._instance(self.token.encode()))

    def _note(self, *given: Any) -> None:
        self.statuses.append(given[1 if self.version == "3" else 2])
        self.texts.append(given[-1].decode())

    def _instance(self, token: bytes) -> int:
        if self.version == "3":
            make = self._library.fmi3InstantiateCoSimulation
            make.restype = c_void_p
            off, none = c_bool(False), c_void_p(None)
            return int(make(b"one", token, b"", off, off, off, off, none, c_size_t(0), none,
                            self._logger, none) or 0)  # fmt: skip
        make = self._library.fmi2Instantiate
        make.restype = c_void_p
        self._callbacks = (c_void_p * 5)(ctypes.cast(self._logger, c_void_p).value)
        return int(make(b"one", 1, token, b"", self._callbacks, 0, 0) or 0)

    def __call__(self, name: str, *arguments: Any) -> int:
        """Status of a function of the standard, named without its prefix."""
        return int(getattr(self._library, f"fmi{self.version}{name}")(self.unit, *arguments))

    def begin(self, start: float = 0.0) -> None:
        if self.version == "3":
            time = c_double(start)
            given = c_bool(False), c_double(), time, c_bool(False), c_double()
            assert self("EnterInitializationMode", *given) == 0
        else:
            given = 0, c_double(), c_double(start), 0, c_double()
            assert self("SetupExperiment", *given) == 0
            assert self("EnterInitializationMode") == 0

    def start(self, start: float = 0.0) -> None:
        self.begin(start)
        assert self("ExitInitializationMode") == 0

    def step(self, point: float, time: float) -> int:
        if self.version == "2":
            return self("DoStep", c_double(point), c_double(time), 1)
        flags = [byref(c_bool()) for _ in range(3)]
        return self("DoStep", c_double(point), c_double(time), c_bool(True), *flags,
                    byref(c_double()))  # fmt: skip

    def set(self, names: Sequence[str], values: Sequence[float]) -> int:
        return self._exchange("Set", names, (c_double * len(values))(*values))

    def get(self, names: Sequence[str]) -> np.ndarray:
        found = (c_double * len(names))()
        assert self._exchange("Get", names, found) == 0
        return np.array(found)

    def _exchange(self, way: str, names: Sequence[str], values: Any) -> int:
        count = c_size_t(len(names))
        places = (c_uint * len(names))(*(self.reference[name] for name in names))
        if self.version == "3":
            return self(f"{way}Float64", places, count, values, count)
        return self(f"{way}Real", places, count, values)

    def derivative(
        self, unknowns: Sequence[str], knowns: Sequence[str], seeds: Sequence[float]
    ) -> tuple[int, np.ndarray]:
        """Status, and the directional derivative."""
        lengths = c_size_t(len(unknowns)), c_size_t(len(knowns))
        places = [(c_uint * len(of))(*map(self.reference.__getitem__, of))
                  for of in (unknowns, knowns)]  # fmt: skip
        given, found = (c_double * len(seeds))(*seeds), (c_double * len(unknowns))()
        arguments = places[0], lengths[0], places[1], lengths[1]
        more = (lengths[1], found, lengths[0]) if self.version == "3" else (found,)
        status = self("GetDirectionalDerivative", *arguments, given, *more)
        return status, np.array(found)

    def saved(self) -> c_void_p:
        state = c_void_p(None)
        assert self("GetFMUState" if self.version == "3" else "GetFMUstate", byref(state)) == 0
        return state

    def restore(self, state: c_void_p) -> None:
        assert self("SetFMUState" if self.version == "3" else "SetFMUstate", state) == 0

    def close(self) -> None:
        free = getattr(self._library, f"fmi{self.version}FreeInstance")
        free.restype = None
        free(self.unit)


def names(simulator: Simulator, kind: str) -> list[str]:
    return [f"{joint}.{kind}" for joint in simulator.joint_names]


def test_a_unit_is_the_simulator_to_the_bit(
    made: dict[str, Path], version: str, rng: np.random.Generator
) -> None:
    """Also when it is set back, and when several ticks are one step."""
    simulator, unit = Simulator(scene("dry")), Importer(made["dry"], version)
    dt, tau = simulator.dt, 5.0 * rng.normal(size=(TICKS, 2))
    run = simulator.run(TICKS * dt, tau)
    outputs = names(simulator, "position") + names(simulator, "velocity")
    unit.begin()
    np.testing.assert_array_equal(unit.get(outputs), run.x[0, :4])
    unit("ExitInitializationMode")
    half, state = TICKS // 2, c_void_p(None)
    for again in (False, True):
        for k in range(half if again else 0, TICKS):
            if k == half:
                unit.restore(state) if again else None
                state = state if again else unit.saved()
            assert unit.set(names(simulator, "command"), tau[k]) == 0
            assert unit.step(k * dt, dt) == 0
            np.testing.assert_array_equal(unit.get(outputs), run.x[k + 1, :4])
            np.testing.assert_array_equal(unit.get(names(simulator, "effort")), run.tau[k])
    assert unit.step(TICKS * dt, 10 * dt) == 0
    simulator.run(10 * dt, tau[-1])
    np.testing.assert_array_equal(unit.get(outputs), simulator.arm.x[:4])
    np.testing.assert_allclose(unit.get(["time"]), (TICKS + 10) * dt)
    unit.close()


def test_starting_values_and_parameters_are_the_simulators(
    made: dict[str, Path], version: str
) -> None:
    simulator, unit = Simulator(scene("tunable")), Importer(made["tunable"], version)
    q, v, outputs = [0.3, -0.4], [1.0, 0.5], names(simulator, "position")
    mass = next(name for name in unit.reference if name and name.startswith("payload"))
    assert unit.set(names(simulator, "initial_position"), q) == 0
    unit.begin(start=5.0)
    assert unit.set(names(simulator, "initial_velocity"), v) == 0
    assert unit("ExitInitializationMode") == 0
    still = Importer(made["tunable"], version)
    assert still.set([mass], [still.get([mass])[0] + 1.0]) == 0
    still.start()
    simulator.reset(q, v)
    for k in range(50):
        assert unit.step(5.0 + k * simulator.dt, simulator.dt) == 0
        assert still.step(k * simulator.dt, simulator.dt) == 0
        np.testing.assert_array_equal(unit.get(outputs), simulator.step(np.zeros(2)).q)
    assert abs(still.get(outputs) - simulator.state.q).max() > 1e-3


def test_a_unit_that_is_reset_is_as_new(made: dict[str, Path], version: str) -> None:
    """Time, state, command, parameters and starting values."""
    simulator, unit = Simulator(scene("tunable")), Importer(made["tunable"], version)
    mass = next(name for name in unit.reference if name and name.startswith("payload"))
    every, (before,) = [*unit.reference], unit.get([mass])
    assert unit.set([*names(simulator, "initial_position"), mass], [0.3, -0.4, before + 1.0]) == 0
    unit.start(start=5.0)
    assert unit.set(names(simulator, "command"), [3.0, 1.0]) == 0
    assert unit.step(5.0, 10 * simulator.dt) == 0
    assert unit("Reset") == 0
    new = Importer(made["tunable"], version)
    for one in (unit, new):
        one.start()
        assert one.step(0.0, 10 * simulator.dt) == 0
    np.testing.assert_array_equal(unit.get(every), new.get(every))


@pytest.mark.parametrize(("kind", "version", "ticks"), covering(SLOPED, ["3", "2"], [1, 4]))
def test_directional_derivatives_are_those_of_the_last_step(
    made: dict[str, Path], kind: str, version: str, ticks: int
) -> None:
    """Of positions and velocities as ``Simulator.linearize`` has them, also after a restore."""
    simulator, unit = Simulator(scene(kind)), Importer(made[kind], version)
    outputs = names(simulator, "position") + names(simulator, "velocity")
    efforts, commands, dt = names(simulator, "effort"), names(simulator, "command"), simulator.dt
    tau, begin, step = np.array([9.0, -5.0]), 20 * dt, ticks * dt
    unit.start()
    assert unit.set(commands, tau) == 0
    assert unit.derivative(outputs, commands, [1.0, 1.0])[1].tolist() == [0.0] * 4
    assert unit.step(0.0, begin) == 0
    simulator.run(begin, tau)
    before = unit.saved()
    assert unit.step(begin, step) == 0
    after = unit.saved()
    _, B = simulator.linearize(simulator.state, tau, ticks)
    for _ in range(2):
        status, found = unit.derivative(outputs, commands, [0.3, -2.0])
        assert status == 0
        np.testing.assert_allclose(found, B @ [0.3, -2.0], rtol=0.0, atol=1e-14)
        unit.restore(before)
        assert unit.derivative(outputs, commands, [1.0, 0.0])[1].tolist() != found.tolist()
        unit.restore(after)
    if kind == "tunable":
        place = [n for n in unit.reference if n and n.startswith("payload")]
        *_, P = simulator.linearize(simulator.state, tau, ticks, by=["payload"])
        seeds = np.linspace(0.1, 1.0, len(place))
        found = unit.derivative(outputs, place, seeds)[1]
        np.testing.assert_allclose(found, P["payload"] @ seeds, rtol=0.0, atol=1e-14)
    found, change = unit.derivative(efforts, commands, [1.0, 0.5])[1], []
    for sign in (1.0, -1.0):
        unit.restore(before)
        assert unit.set(commands, tau + sign * 1e-5 * np.array([1.0, 0.5])) == 0
        assert unit.step(begin, step) == 0
        change.append(unit.get(efforts))
    np.testing.assert_allclose(found, (change[0] - change[1]) / 2e-5, rtol=0.0, atol=FINITE_DIFF)


def test_derivatives_that_do_not_exist_are_refused(made: dict[str, Path], version: str) -> None:
    """An event in the step discards; starting values are knowns before the start alone."""
    unit = Importer(made["dry"], version)
    joints = [str(n).split(".")[0] for n in unit.reference if str(n).endswith(".command")]
    positions, commands = ([f"{j}.{what}" for j in joints] for what in ("position", "command"))
    starts = [f"{joint}.initial_position" for joint in joints]
    unit.begin()
    assert unit.derivative(positions, starts, [1.0, 2.0]) == (0, pytest.approx([1.0, 2.0]))
    assert unit("ExitInitializationMode") == 0
    assert unit.set(commands, [9.0, -5.0]) == 0
    assert unit.step(0.0, 0.1) == 0  # joints break away
    assert unit.derivative(positions, commands, [1.0, 0.0])[0] == 2
    assert "no derivative" in unit.texts[-1] and unit.statuses[-1] == 2
    assert unit.derivative(positions, starts, [1.0, 0.0])[0] == 3
    assert unit.derivative(commands, commands, [1.0, 0.0])[0] == 3
    plain = Importer(made["framed"], version)
    assert plain("GetDirectionalDerivative") == 3
    for kind, provides in (("dry", True), ("framed", False)):
        file = zipfile.ZipFile(packed(made[kind], version))
        description = file.read("modelDescription.xml").decode()
        assert ("providesDirectionalDerivative" in description) == provides


def test_wrenches_act_on_the_frames_that_were_named(made: dict[str, Path], version: str) -> None:
    """Besides external torques; without any, the unit is the simulator to the bit."""
    given = scene("dry") | {"tunable": ["external"]}
    simulator, dynamics, unit = (
        Simulator(given),
        Dynamics(given),
        Importer(made["framed"], version),
    )
    wrenches = {"forearm": 5.0 * np.arange(1.0, 7.0), "tip": -5.0 * np.arange(1.0, 7.0)}
    inputs = [f"{frame}.wrench.{kind}.{axis}"
              for frame in FRAMES for kind in ("force", "torque") for axis in "xyz"]  # fmt: skip
    outputs, dt = names(simulator, "position") + names(simulator, "velocity"), simulator.dt
    unit.start()
    for k in range(TICKS):
        if k == 20:
            assert unit.set(inputs, np.concatenate([*wrenches.values()])) == 0
            assert unit.set(["external[1]"], [2.0]) == 0
        if k >= 20:
            q = simulator.state.q
            pushed = [dynamics.jacobian(q, frame).T @ w for frame, w in wrenches.items()]
            simulator.set_parameter("external", [0.0, 2.0] + sum(pushed))
        assert unit.step(k * dt, dt) == 0
        expected = simulator.step(np.zeros(2))
        if k < 20:
            np.testing.assert_array_equal(unit.get(outputs), [*expected.q, *expected.v])
    np.testing.assert_allclose(unit.get(outputs), [*expected.q, *expected.v], rtol=1e-10)
    assert abs(expected.v).max() > 0.1


def test_what_is_not_allowed_is_an_error_that_says_so(made: dict[str, Path], version: str) -> None:
    unit = Importer(made["framed"], version)
    command, position = [next(x for x in unit.reference if x and x.endswith(k))
                         for k in (".command", ".position")]  # fmt: skip
    assert unit.step(0.0, 1e-3) == 3 and "initialization" in unit.texts[-1]
    assert unit.statuses[-1] == 3
    unit.start()
    for point, time in ((0.0, 0.3e-3), (0.0, -1e-3), (0.0, 0.0), (0.04, 1e-3), (np.nan, 1e-3)):
        assert unit.step(point, time) == 3 and "from 0 s, where" in unit.texts[-1]
    assert unit.set([command], [np.nan]) == 3 and "not finite" in unit.texts[-1]
    assert unit.set([position], [0.0]) == 3 and "computed" in unit.texts[-1]
    assert unit.set([f"{position[:-9]}.initial_position"], [0.1]) == 3
    assert "until initialization is over" in unit.texts[-1]
    assert unit.step(0.0, 1e-3) == 0
    assert Importer(made["framed"], version)._instance(b"another") == 0


def test_importers_may_add_up_times_and_begin_at_any_date(
    made: dict[str, Path], version: str
) -> None:
    """Sums of ticks are off by 1e-6 of one after 300 s, differences of dates by 1e-4 at once."""
    simulator, date = Simulator(scene("framed")), 1.7e9
    unit, dated = (Importer(made["framed"], version) for _ in range(2))
    for one, start in ((unit, 0.0), (dated, date)):
        one.start(start)
    for k in range(50):
        late, now = 0.3 * simulator.dt, date + k * simulator.dt
        assert unit.step(k * simulator.dt + late, simulator.dt) == 0
        assert dated.step(now, (date + (k + 1) * simulator.dt) - now) == 0
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


@pytest.mark.group("fmu")
def test_fmpy_finds_nothing_wrong_and_simulates_it(made: dict[str, Path], version: str) -> None:
    from fmpy import simulate_fmu
    from fmpy.validation import validate_fmu

    simulator, path = Simulator(scene("dry")), str(packed(made["dry"], version))
    assert not validate_fmu(path) and not validate_fmu(str(packed(made["framed"], version)))
    position = names(simulator, "position")
    found = simulate_fmu(path, stop_time=0.2, output_interval=1e-3, output=position)
    run = simulator.run(0.2, np.zeros(2))
    for joint, name in enumerate(position):
        np.testing.assert_array_equal(found[name], run.q[:, joint])


@pytest.mark.group("fmu")
def test_another_importer_runs_it_to_the_bit(made: dict[str, Path]) -> None:
    """By FMI 3.0; by FMI 2.0 fmuloader asks co-simulation for functions of model exchange."""
    from fmuloader.fmi3 import Fmi3Slave

    simulator, own = Simulator(scene("dry")), Importer(made["dry"], "3")
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
