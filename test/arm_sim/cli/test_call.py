# SPDX-License-Identifier: Apache-2.0
"""``./arm call`` against nodes that were started by ``./arm dynamics`` and ``./arm sim``."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from forging import running
from typist import answer

import models
from arm_dynamics.ros.common.caller import Caller, Silence
from arm_dynamics.task_space import TaskSpace

pytestmark = pytest.mark.ros

SCENE = str(models.SCENES / "two_link.yaml")
NAMES = ["shoulder", "elbow"]


@pytest.fixture(scope="module")
def domain(tmp_path_factory: pytest.TempPathFactory, forge: Path) -> Iterator[int]:
    """A domain in which a dynamics and a sim node run."""
    logs = tmp_path_factory.mktemp("log")
    with running(forge, logs, ("dynamics", SCENE), ("sim", SCENE)) as number:
        yield number


def test_inverse_dynamics(arm: Any) -> None:
    """Numbers in order or by joint; several points, joints in another order, some terms alone."""
    dynamics = models.dynamics("two_link")
    q, v, a = [-0.3, 0.7], [1.0, 0.5], [0.0, 2.0]
    words = ("--position", "-0.3 0.7", "--velocity", "[1, 0.5]", "--acceleration", "elbow=2")
    said = answer(arm("inverse-dynamics", *words, "--json"))
    assert said["joint_names"] == NAMES
    np.testing.assert_allclose(said["effort"], dynamics.inverse(q, v, a), atol=1e-12)
    assert re.search(r"elbow +0\.7 +0\.5 +2 ", arm("inverse-dynamics", *words).output)
    said = answer(arm("inverse-dynamics", "--position", "[[0.3, -0.7], [0, 1]]",
                      "--joints", "elbow,shoulder", "--terms", "gravity", "--json"))  # fmt: skip
    expected = dynamics.gravity([[-0.7, 0.3], [1.0, 0.0]])[:, ::-1]
    np.testing.assert_allclose(said["effort"], expected, atol=1e-12)


def test_the_model_is_a_table(arm: Any) -> None:
    assert answer(arm("model-info", "--json"))["effort_limits"] == [60.0, 25.0]
    assert re.search(r"shoulder +revolute +-3\.1 +3\.1 +6 +60", arm("model-info").output)


def test_task_space(arm: Any) -> None:
    task = TaskSpace(models.dynamics("two_link"), "tip", "local", ("x", "z"))
    q = [[0.3, -0.7], [0.3, 0.0]]
    words = ("task-space", "--frame", "tip", "--reference", "local", "--axes", "x,z")
    given = (*words, "--position", json.dumps(q), "--direction", "1 0")
    said = answer(arm(*given, "--json"))
    np.testing.assert_allclose(said["inertia"], task.terms(q).inertia, rtol=1e-12, atol=1e-12)
    assert said["axes"] == ["x", "z"] and said["damped"] == [False, True]
    shown = arm(*given).output
    assert ["near a singularity" in point for point in shown.split("point 1")] == [False, True]
    mass = task.effective_mass(q[0], [1, 0]).mass
    assert f"effective mass [kg, kg m²]: {mass:.6g}" in shown


@pytest.mark.parametrize(("line", "said"), [
    ("inverse-dynamics --position 1,2,3", "refused: position has 3 numbers"),
    ("inverse-dynamics --position wrist=1", "unknown joint 'wrist'; allowed: "),
    ("task-space --frame tip --direction x=1 --position 1,2", "--direction: numbers without "),
    ("step", "refused: the simulation is running"),
])  # fmt: skip
def test_refusals(arm: Any, line: str, said: str) -> None:
    result = arm(*line.split())
    assert result.exit_code == 1 and said in result.output and "Traceback" not in result.output


def test_simulation_is_paused_stepped_set_and_reset(arm: Any) -> None:
    assert arm("pause").output == "/sim: paused\n"
    before = answer(arm("step", "--json"))["time"]
    assert answer(arm("step", "10", "--json"))["time"] == pytest.approx(before + 0.01)
    assert arm("set-joint-state", "--position", "elbow=1.0").output == "/sim: elbow set\n"
    words = ("set-joint-state", "--joints", ",", "--position", "elbow=1 shoulder=2")
    assert arm(*words).output == "/sim: elbow, shoulder set\n"
    assert arm("reset").exit_code == 0
    assert answer(arm("step", "--json"))["time"] == pytest.approx(0.001)
    assert arm("resume").output == "/sim: running\n"


def test_nobody_there(arm: Any, domain: int) -> None:
    for timeout in (2, 8, 30):  # to see who else is there may take a while on a busy machine
        result = arm("reset", "--node", "left/sim", timeout=float(timeout))
        if "/dynamics, /sim" in result.output and "offered as" in result.output:
            break
    assert result.exit_code == 1
    for words in (
        f"no node offers /left/sim/reset (waited {timeout} s)", "offered as /sim/reset",
        "--node selects another node", "nodes seen: /dynamics, /sim", "./arm sim SCENE",
        f"ROS_DOMAIN_ID; here it is {domain}",
    ):  # fmt: skip
        assert words in result.output


def test_a_node_that_is_there_but_silent_need_not_be_started(
    arm: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    silence = Silence("/sim/reset exists but did not answer")
    monkeypatch.setattr(Caller, "ask", Mock(side_effect=silence))
    said = arm("reset").output
    assert "did not answer\n  --node selects another node" in said and "SCENE" not in said
