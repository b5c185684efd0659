# SPDX-License-Identifier: Apache-2.0
"""Scenes compiled elsewhere: a machine without a compiler runs them, and refuses by name what it
must not load.
"""

import hashlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from harness import reserve_domain, surroundings

from arm_dynamics import InvalidInput, KernelError
from arm_dynamics.codegen import compiler, processor
from arm_sim import Simulator
from arm_sim.stepping.rollouts.batch import Batch
from arm_studies.cli.main import main
from arm_studies.optimization import ILQR, Phase, QuadraticCost
from arm_studies.optimization.backward import library_of

URDF = """
<robot name="pendulum">
  <link name="world"/>
  <link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <joint name="hinge" type="revolute"><parent link="world"/><child link="rod"/>
    <axis xyz="0 1 0"/><limit effort="50" velocity="10" lower="-9" upper="9"/></joint>
</robot>"""
SCENE = """
robot: {urdf: rod.urdf}
joints: {hinge: {friction: {coulomb: 0.5, static: 0.8}}}
initial: {position: {hinge: 1.0}}
"""
NODES = """
import sys, time
import rclpy
from rclpy.context import Context
from arm_dynamics.ros import ControllerNode
from arm_dynamics.ros import DynamicsNode
from arm_sim.ros import SimNode

options = {"context": Context()}
rclpy.init(args=[], context=options["context"], domain_id=int(sys.argv[2]))
sim = SimNode(sys.argv[1], **options)
controller = ControllerNode(sys.argv[1], own_thread=True, **options)
dynamics = DynamicsNode(sys.argv[1], **options)
end = time.monotonic() + 30.0
while controller.answers.obstacle and time.monotonic() < end:
    time.sleep(0.05)
native = sim.simulator.arm.pointers is not None, dynamics._compiled is not None
print([*native, controller.answers.obstacle])
for node in dynamics, controller, sim:
    node.destroy_node()
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, hasty: dict[str, str]) -> Path:
    """A folder with a scene, a pendulum with dry friction, and ``compiled``, made from it."""
    folder = tmp_path_factory.mktemp("scene")
    (folder / "rod.urdf").write_text(URDF)
    (folder / "rod.yaml").write_text(SCENE)
    build(folder / "rod.yaml", folder / "compiled", **hasty)
    return folder


@pytest.fixture
def scene(made: Path) -> Path:
    return made / "rod.yaml"


@pytest.fixture
def compiled(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The compiled scene on a machine that has nothing else, and no compiler."""
    shutil.copytree(made / "compiled", tmp_path / "compiled")
    without_compiler(monkeypatch, tmp_path, tmp_path / "compiled")
    assert compiler.find_compiler() is None and compiler.find_compiler("c++") is None
    return tmp_path / "compiled"


def without_compiler(patch: pytest.MonkeyPatch, folder: Path, compiled: Path) -> None:
    """Hide compilers, and let code come from ``compiled``."""
    for variable in ("CC", "CXX"):
        patch.delenv(variable, raising=False)
    patch.setenv("PATH", str(folder))
    patch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
    patch.setenv("ARM_CACHE", str(compiled))


def build(scene: Path, out: Path, *options: str, **environment: str) -> None:
    words = ["build", str(scene), "--out", str(out), *options]
    done = CliRunner(env=environment).invoke(main, words)
    assert done.exit_code == 0, done.output


def step_in(folder: Path) -> Path:
    """The library with the simulator's step."""
    manifests = {path: json.loads(path.read_text()) for path in folder.glob("*.json")}
    (found,) = (path for path, said in manifests.items() if said["kernel"] == "simulator step")
    return found.with_suffix(".so")


def say(library: Path, **other: object) -> None:
    """Write something else into a manifest."""
    manifest = library.with_suffix(".json")
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | other))


def motion(scene: Path) -> np.ndarray:
    return Simulator(scene, backend="native").run(0.3).q


def test_without_a_compiler_a_scene_runs_to_the_bit_as_where_there_is_one(
    scene: Path, compiled: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    there = Simulator(scene, backend="native")
    assert str(compiled) in there.plan.backend
    assert not (compiled.parent / "cache").exists()
    monkeypatch.setenv("PATH", os.defpath)
    monkeypatch.delenv("ARM_CACHE")
    here = Simulator(scene, backend="native")
    assert str(compiled) not in here.plan.backend
    np.testing.assert_array_equal(there.run(0.3).x, here.run(0.3).x)


LEVEL = "x86-64-v2" if os.uname().machine == "x86_64" else "native"


def test_derivatives_are_compiled_on_request_for_a_level_of_processors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, hasty: dict[str, str]
) -> None:
    """A machine without a compiler then optimizes motions; arms side by side as far as fits."""
    (tmp_path / "rod.urdf").write_text(URDF)
    out = tmp_path / "compiled"
    options = "--derivatives", "--batches", "--integrator", "rk4", "--processor", LEVEL
    build(tmp_path / "rod.urdf", out, *options, **hasty)
    if LEVEL != "native":
        said = json.loads(step_in(out).with_suffix(".json").read_text())
        assert set(said["instructions"]) == processor.needed(LEVEL)
    without_compiler(monkeypatch, tmp_path, out)
    library_of.cache_clear()
    sim = Simulator(tmp_path / "rod.urdf", "rk4", backend="native")
    x, u = np.zeros((11, 2)), np.zeros((10, 1))
    optimizer = ILQR([Phase(sim, 10)], QuadraticCost(x, np.ones(x.shape), u, np.ones(u.shape)))
    assert optimizer.solve([0.1, 0.0], u).verdict == "converged"
    rollouts = sim.arm.compiled.rollouts
    batch = Batch.of(
        sim.arm.plant, np.zeros((3, 1)), np.ones((3, 1)), [0.0], 5, sim.arm.parameters, False
    )
    assert rollouts.run_in_lanes(batch) == []
    assert not list((tmp_path / "cache").rglob("*.so"))


@pytest.mark.ros
def test_loops_of_the_nodes_are_compiled_on_request(tmp_path: Path, hasty: dict[str, str]) -> None:
    """Without a compiler they then run in C."""
    out, nothing = tmp_path / "compiled", tmp_path / "nothing"
    nothing.mkdir()
    build(Path("pendulum"), out, "--nodes", **hasty)
    domain, reservation = reserve_domain()
    environment = surroundings(PATH=str(nothing), XDG_CACHE_HOME=str(nothing), ARM_CACHE=str(out),
                               ROS_LOG_DIR=str(tmp_path))  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-P", "-c", NODES, "pendulum", str(domain)], capture_output=True,
        text=True, timeout=120, env=environment, check=False,
    )  # fmt: skip
    reservation.close()
    assert done.stdout.splitlines() == ["[True, True, '']"], done.stderr
    assert "no C compiler" not in done.stderr
    assert not list(nothing.rglob("*.so"))


@pytest.mark.ros
def test_a_node_without_compiled_code_says_how_to_get_it(scene: Path, compiled: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-P", "-m", "arm_sim.cli", "controller", str(scene)], capture_output=True,
        text=True, timeout=60, env=surroundings(), check=False,
    )  # fmt: skip
    assert done.returncode == 2
    (said,) = (line for line in done.stderr.splitlines() if line.startswith("error: "))
    for word in ("nodes need compiled code", str(compiled), "apt install gcc", "--nodes"):
        assert word in said


def test_all_folders_of_the_list_are_searched_and_what_is_in_none_is_said_with_the_way_out(
    scene: Path, compiled: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("ARM_CACHE", os.pathsep.join([str(tmp_path / "none"), "", str(compiled)]))
    assert motion(scene)[-1, 0] != 1.0
    with pytest.raises(KernelError) as said:
        Simulator(scene, "euler", backend="native")
    for word in (str(compiled), "none: no such folder", "apt install gcc", "./arm build"):
        assert word in str(said.value)


def damaged(library: Path) -> None:
    content = bytearray(library.read_bytes())
    content[len(content) // 2] ^= 0xFF
    library.unlink()  # code that this process has loaded is not changed beneath it
    library.write_bytes(content)


def not_a_library(library: Path) -> None:
    library.write_bytes(b"rubbish")
    say(library, sha256=hashlib.sha256(b"rubbish").hexdigest())


REFUSED = {
    "damaged": (damaged, "is damaged"),
    "writable by the group": (lambda x: x.chmod(0o664), r"written by others \(mode 664\)"),
    "manifest writable by all": (
        lambda x: x.with_suffix(".json").chmod(0o646), r"json can be written by others"
    ),
    "folder writable by all": (lambda x: x.parent.chmod(0o777), "written by others"),
    "without a manifest": (lambda x: x.with_suffix(".json").unlink(), "json cannot be read"),
    "with a manifest of another version": (lambda x: say(x, more=1), "of another version"),
    "for another processor": (
        lambda x: say(x, instructions=["avx9000", "sse77"]), "processor lacks: avx9000, sse77"
    ),
    "for another machine": (lambda x: say(x, machine="vax"), "compiled for vax"),
    "not a library": (not_a_library, "cannot be loaded"),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_what_must_not_be_loaded_is_refused_by_name(
    scene: Path, compiled: Path, what: str
) -> None:
    """Without a compiler it is the end; all that is said is in one error."""
    change, reason = REFUSED[what]
    library = step_in(compiled)
    change(library)
    with pytest.raises(KernelError, match=reason) as said:
        motion(scene)
    name = compiled if what.startswith("folder") else compiled / library.stem
    assert str(name) in str(said.value)


def test_with_a_compiler_a_refusal_is_logged_and_the_code_compiled(
    scene: Path, compiled: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    before = motion(scene)
    library = step_in(compiled)
    damaged(library)
    monkeypatch.setenv("PATH", os.defpath)
    np.testing.assert_array_equal(motion(scene), before)
    assert f"{library} (rod.yaml: simulator step) is damaged" in caplog.text


def test_building_again_keeps_what_is_right_and_mends_the_rest(
    made: Path, scene: Path, tmp_path: Path
) -> None:
    out = tmp_path / "compiled"
    shutil.copytree(made / "compiled", out)
    damaged(step_in(out))
    kept = {path.name: path.stat().st_mtime_ns for path in out.iterdir()}
    build(scene, out)
    now = {path.name: path.stat().st_mtime_ns for path in out.iterdir()}
    step = step_in(out).stem
    assert {name for name in now if now[name] != kept.get(name)} == {f"{step}.so", f"{step}.json"}


def test_what_cannot_be_built_is_refused(scene: Path, tmp_path: Path) -> None:
    """For an unknown level of processors, or into a folder that others may write."""
    with pytest.raises(InvalidInput, match=r"x86-64-v9.*x86-64-v3"):
        processor.needed("x86-64-v9")
    tmp_path.chmod(0o777)
    done = CliRunner().invoke(main, ["build", str(scene), "--out", str(tmp_path)])
    assert done.exit_code == 1 and f"{tmp_path} can be written by others" in done.output
    assert list(tmp_path.glob("*.so")) == []
