# SPDX-License-Identifier: Apache-2.0
"""The mistakes that users make most, each with its error message, word for word.

The table is ``mistakes.yaml``: scenes, robot descriptions, commands and calls from Python. Every
key of a scene is checked in ``arm_dynamics/scene``, every option in ``arm_studies/cli``.
"""

import pickle
import re
import shlex
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

import models
from arm_dynamics import ArmError
from arm_dynamics.control import ComputedTorque, Settings, make_controller
from arm_dynamics.task_space import TaskSpace
from arm_sim import ClosedLoop, Recording, Simulator
from arm_studies.cli.main import main
from arm_studies.identification import identify
from arm_studies.sweeps import sweep

TABLE: dict[str, list[dict[str, str]]] = yaml.safe_load(
    Path(__file__).with_name("mistakes.yaml").read_text()
)
ROBOT = "robot: {urdf: two_link.urdf}\n"
URDF = (models.SCENES / "two_link.urdf").read_text()
STARTS_ROS = ("sim", "dynamics", "controller", "record some")
LEAKS = re.compile(
    r"pydantic|Input should|valid (tuple|dict|list|string)|broadcast|ufunc|could not convert|"
    r"ndarray|Traceback|\[Errno|<unicode string>|lexer|NoneType' object|"
    r"positional argument|function-"
)


@pytest.fixture(scope="module")
def at_home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what a user has: a robot, a scene and a recording."""
    folder = tmp_path_factory.mktemp("home")
    with pytest.MonkeyPatch.context() as here:
        here.chdir(folder)
        Path("two_link.urdf").write_text(URDF)
        Path("scene.yaml").write_text(ROBOT)
        Simulator("scene.yaml", backend="vm").run(0.01).save("run.mcap")
    return folder


@pytest.fixture(autouse=True)
def there(at_home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Each mistake is made in a copy of it; nodes take over the signals of their process."""
    shutil.copytree(at_home, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def told(error: Exception) -> str:
    return str(error).replace(f"{Path.cwd()}/", "").replace(str(Path.cwd()), "FOLDER")


def of_scene(text: str) -> str:
    """What is said of a scene file."""
    Path("my.yaml").write_text(text)
    with pytest.raises(ArmError) as caught:
        Simulator("my.yaml", backend="vm")
    return told(caught.value)


def of_robot(before: str, after: str) -> str:
    """What is said of a description in which a part is another one."""
    assert before == "WHOLE" or before in URDF
    text = after if before == "WHOLE" else URDF.replace(before, after, 1)
    Path("my.urdf").write_text(text)
    with pytest.raises(ArmError) as caught:
        Simulator("my.urdf", backend="vm")
    return told(caught.value)


def of_command(line: str) -> str:
    """The last thing that a command says, which must not succeed."""
    done = CliRunner().invoke(main, shlex.split(line), prog_name="./arm")
    assert done.exit_code in (1, 2), done.output
    assert isinstance(done.exception, SystemExit)
    said = re.split(r"^(?:Error|error): ", done.output, flags=re.MULTILINE)
    assert len(said) == 2, done.output
    return said[1].strip().replace(str(Path.cwd()), "FOLDER")


def of_python(call: str) -> str:
    """What is said of a call."""
    sim = Simulator("two_link", backend="vm")
    names: dict[str, Any] = {
        "ClosedLoop": ClosedLoop, "ComputedTorque": ComputedTorque, "Recording": Recording,
        "Settings": Settings, "Simulator": Simulator, "TaskSpace": TaskSpace, "np": np, "sim": sim,
        "make_controller": make_controller, "dynamics": sim.dynamics, "pickle": pickle,
        "identify": identify, "sweep": sweep,
    }  # fmt: skip
    if "motion" in call:
        names["motion"] = sim.run(0.005)
    with pytest.raises((ArmError, OSError, AttributeError)) as caught:
        eval(call, names)
    return told(caught.value)


def agrees(said: str, wanted: str) -> None:
    """Word for word, but for what … leaves open; and in our words, not those of libraries."""
    if said.startswith("Python cannot find the module"):  # of a group of packages
        pytest.skip(said)
    assert re.fullmatch(".*".join(map(re.escape, wanted.strip().split("…"))), said.strip()), said
    assert not LEAKS.search(said), said


def cases() -> Iterator[Any]:
    """Each row of the table, named by its first key, with its kind."""
    for kind, rows in TABLE.items():
        for row in rows:
            name = next(iter(row.values()))
            starts = kind == "commands" and name.startswith(STARTS_ROS)
            yield pytest.param(kind, row, id=name, marks=[pytest.mark.ros] if starts else [])


@pytest.mark.parametrize(("kind", "case"), list(cases()))
def test_a_mistake_is_told_in_plain_words(kind: str, case: dict[str, str]) -> None:
    what = {"scenes": of_scene, "robots": of_robot, "commands": of_command, "python": of_python}
    given = [text for key, text in case.items() if key not in ("mistake", "said")]
    agrees(what[kind](*given), case["said"])
