# SPDX-License-Identifier: Apache-2.0
"""Command lines of the executables, each in a separate process."""

import subprocess
import sys

import pytest
from samples import sampled

from arm_dynamics import InvalidInput
from arm_dynamics.ros.common.executable import split_words

pytestmark = pytest.mark.ros

MODULES = {
    "sim": "arm_sim.ros.sim_node",
    "controller": "arm_dynamics.ros.controller_node",
    "dynamics": "arm_dynamics.ros.dynamics_node",
}


def called(node: str, *words: str) -> subprocess.CompletedProcess[str]:
    start = f"import sys; from {MODULES[node]} import main; main(sys.argv[1:] or None)"
    command = [sys.executable, "-c", start, *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize("node", sampled(MODULES, 1))
def test_help_lists_the_scene_and_every_parameter(node: str) -> None:
    told = called(node, "--help")
    assert told.returncode == 0
    assert told.stdout.startswith(f"usage: {node} [SCENE] [--ros-args -p NAME:=VALUE")
    assert "\n  scene = ''\n" in told.stdout
    assert told.stderr == ""


@pytest.mark.parametrize(
    ("words", "said"),
    sampled([
        (("nowhere",), "error: scene: no file 'nowhere' in "),
        (("pnda", "--ros-args", "-r", "__ns:=/x"), "did you mean 'panda'?"),
        (("panda", "again"), "error: 'again' is neither the scene nor behind --ros-args"),
        (("--verbose",), "error: '--verbose' is neither the scene nor behind --ros-args"),
    ], 1),
)  # fmt: skip
def test_a_scene_is_given_by_position_and_refused_by_name(
    words: tuple[str, ...], said: str
) -> None:
    told = called("sim", *words)
    assert told.returncode == 2
    assert said in told.stderr
    assert "Traceback" not in told.stderr


def test_help_behind_ros_arguments_is_theirs() -> None:
    assert split_words(("panda", "--ros-args", "--help")) == ("panda", ("--ros-args", "--help"))
    with pytest.raises(InvalidInput, match="neither the scene"):
        split_words(("panda", "--help"))
