# SPDX-License-Identifier: Apache-2.0
"""The plugins for ros2_control, on stand-ins of its interfaces: to the bit the simulator."""

import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from exported import said_by
from launch_files import Launch, by_python
from samples import sampled

from arm_dynamics import Dynamics
from arm_dynamics.arrays import Array
from arm_dynamics.control import ComputedTorque
from arm_dynamics.trajectory import Reference
from arm_sim import JointCommand, Simulator, State
from arm_sim.export import export

HERE = Path(__file__).parent
PACKAGE = HERE.parents[1] / "src/arm_ros2_control"
URDF = PACKAGE.parent / "arm_sim/arm_sim/scenes/two_link.urdf"
SCENE = {
    "robot": {"urdf": str(URDF)},
    "joints": {"*": {"friction": {"coulomb": 0.3, "viscous": 0.1}}},
    "initial": {"position": {"shoulder": 0.4, "elbow": -0.2}},
}
STRICT = ("-Wall", "-Wextra", "-Wconversion", "-Wno-sign-conversion", "-pedantic", "-Werror")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with libraries of the arm, and the program that drives the plugins."""
    made = tmp_path_factory.mktemp("ros2_control")
    for name, servo in (("arm", True), ("bare", False)):
        export(SCENE, made / name, name, terms=("inverse_dynamics",), servo=servo)
        library = "-O1", "-fPIC", "-shared", made / name / f"{name}.c"
        said_by("cc", *library, "-o", made / f"lib{name}.so", "-lm")
    include = (f"-I{PACKAGE / 'include'}", f"-I{HERE / 'standins'}")
    sources = (*(PACKAGE / "src").glob("*.cpp"), HERE / "drive.cpp")
    said_by("c++", "-std=c++17", *STRICT, *include, *sources, "-o", made / "drive", "-ldl")
    return made


def driven(folder: Path, kinds: str, commands: Array, rate: int = 1000) -> Array:
    """Positions, velocities and efforts after each period under commands."""
    given = "\n".join(" ".join(float(x).hex() for x in row) for row in commands)
    said = subprocess.run(
        [folder / "drive", folder / "libarm.so", str(rate), kinds],
        input=given, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert said.returncode == 0, said.stderr
    return np.array([[float.fromhex(x) for x in row.split()] for row in said.stdout.splitlines()])


def simulated(commands: Sequence[Array | JointCommand], each: int = 1) -> Array:
    simulator, rows = Simulator(SCENE), []
    for command in commands:
        for _ in range(each):
            state = simulator.step(command)
        rows.append(np.concatenate([state.q, state.v, simulator.effort]))
    return np.array(rows)


@pytest.mark.parametrize("each", sampled([2, 1], 1))
def test_efforts_move_the_arm_as_the_simulator_to_the_bit(
    folder: Path, each: int, rng: np.random.Generator
) -> None:
    """In the library's order of joints, which the description turns round.

    Nothing allocates, and nothing waits for a lock.
    """
    efforts = 10.0 * rng.normal(size=(300, 2))
    made = driven(folder, "effort", efforts, 1000 // each)
    np.testing.assert_array_equal(made, simulated(efforts, each))


def test_positions_and_velocities_are_tracked_as_by_the_simulator(
    folder: Path, rng: np.random.Generator
) -> None:
    """A position alone has the velocity of the stream of positions."""
    steps = np.cumsum(1e-3 * rng.normal(size=(300, 2)), axis=0) + [0.4, -0.2]
    both = np.hstack([steps, rng.normal(size=(300, 2))])
    alone = simulated([JointCommand(q) for q in steps])
    np.testing.assert_array_equal(driven(folder, "position", steps), alone)
    expected = simulated([JointCommand(row[:2], row[2:]) for row in both])
    np.testing.assert_array_equal(driven(folder, "position,velocity", both), expected)


def test_a_joint_without_a_command_stays_where_it_is(folder: Path) -> None:
    made = driven(folder, "effort", np.full((500, 2), np.nan))
    np.testing.assert_allclose(made[:, :2], np.tile([0.4, -0.2], (500, 1)), atol=1e-9)


def test_the_controller_follows_a_motion_by_computed_torque(folder: Path) -> None:
    t, size, w = 1e-3 * np.arange(1000)[:, None], np.array([0.3, 0.5]), 4.0
    q = [0.4, -0.2] + size * (1.0 - np.cos(w * t))
    v, a = size * w * np.sin(w * t), size * w**2 * np.cos(w * t)
    made = driven(folder, "controller", np.hstack([q, v, a]))
    assert abs(made[:-1, :2] - q[1:]).max() < 2e-5
    law, before = ComputedTorque(Dynamics(SCENE), 50.0), made[-2]
    state = State(0.0, 0, before[:2], before[2:4], np.zeros(0))
    expected = law.torque(state, Reference(q[-1], v[-1], a[-1]))
    np.testing.assert_allclose(made[-1, 4:], expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "row", "said"),
    [
        ("libarm.so 1000 effort", "1 inf", "joint 'elbow': effort command inf; a finite number"),
        ("libarm.so 1000 position", "-inf 0", "joint 'shoulder': position command -inf; a finite"),
        ("libarm.so 1000 controller", "0 0 0 0 0 inf", "'elbow': position 0, velocity 0 and acc"),
        ("libarm.so 1000 effort 3.5", "", "'elbow': position 3.5; -2.8 to 2.8 is allowed"),
        ("libarm.so 1000 effort 0.5m", "", "'elbow': position '0.5m'; a finite number"),
        ("libarm.so 1000 effort nan", "", "'elbow': position 'nan'; a finite number is expected"),
        ("libarm.so 300 effort", "", "the rate is 300 Hz; a period of one or more ticks of 0.001"),
        ("libarm.so 1000 torque", "", "command interface 'torque'; position, velocity and effort"),
        ("libbare.so 1000 position", "", "needs a library exported by ./arm export --servo"),
        ("libarm.so 1000 effort,sensor", "", "'wrist': the library has no sensors"),
    ],
)
def test_what_is_not_allowed_or_cannot_be_computed_is_an_error_that_names_it(
    folder: Path, arguments: str, row: str, said: str
) -> None:
    """Within a period a row of commands; else at the start, as with a place beyond the limits."""
    library, *words = arguments.split()
    command = [folder / "drive", folder / library, *words]
    made = subprocess.run(command, input=row, capture_output=True, text=True, check=False)
    assert made.returncode == 1 and said in made.stderr
    assert ("a period failed" in made.stderr) == bool(row)


def test_the_launch_file_starts_controllers_on_the_library(folder: Path) -> None:
    library = folder / "libarm.so"
    launch = Launch({"arm_ros2_control": PACKAGE}, by_python)
    given = {"scene": "two_link", "library": str(library), "command": "effort"}
    starts = launch.read(PACKAGE / "launch/arm.launch.xml", given)
    found = {start.executable: start for start in starts}
    text = str(found["robot_state_publisher"].parameters["robot_description"])
    tag = ElementTree.fromstring(text).find("ros2_control")
    assert tag is not None and tag.findtext("hardware/plugin") == "arm_ros2_control/ArmSystem"
    assert {p.get("name"): p.text for p in tag.iter("param")}["library"] == str(library)
    assert {c.get("name") for c in tag.iter("command_interface")} == {"effort"}
    listed = yaml.safe_load(found["ros2_control_node"].files[0].read_text())
    manager = listed["controller_manager"]["ros__parameters"]
    assert set(found["spawner"].words) & set(manager) == set(manager) - {"update_rate"}
    joints = listed["joint_trajectory_controller"]["ros__parameters"]["joints"]
    assert joints == list(Simulator("panda").joint_names)


def test_it_is_left_out_where_ros2_control_is_not(tmp_path: Path) -> None:
    if not shutil.which("cmake") or "AMENT_PREFIX_PATH" not in os.environ:
        pytest.skip("without CMake and ament")
    path = os.environ["AMENT_PREFIX_PATH"].replace(":", ";")
    said = said_by("cmake", "-S", PACKAGE, "-B", tmp_path, f"-DCMAKE_PREFIX_PATH={path}")
    if (
        "controller_interface_DIR:PATH=controller_interface_DIR-NOTFOUND"
        not in (tmp_path / "CMakeCache.txt").read_text()
    ):
        pytest.skip("ros2_control is here")
    assert "arm_ros2_control is left out: there is no controller_interface" in said
