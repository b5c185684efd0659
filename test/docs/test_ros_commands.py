# SPDX-License-Identifier: Apache-2.0
"""Commands of ROS 2 on the pages name executables, parameters, services and fields that exist.

The ros2 command line is not on PyPI, so they are held against what the packages declare.
"""

import re
from pathlib import Path

import pytest
import yaml
from ros2 import fill

from arm_dynamics.ros import interfaces
from arm_dynamics.ros.common.params import listed
from arm_sim.ros import interfaces as of_sim
from docs._extensions.node_parameters import kinds

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*/*.md"))]
TEXT = "\n".join(re.sub(r"\\\n\s*", " ", page.read_text()) for page in PAGES)
PARAMETERS = {node: {name for name, _, _ in listed(kind)} for node, kind in kinds().items()}
NAMES = {
    thing.name.replace("~/", "").lstrip("/")
    for module in (interfaces, of_sim)
    for thing in vars(module).values()
    if isinstance(thing, interfaces.Topic | interfaces.Service | interfaces.Action)
}
REQUESTS = re.findall(
    r"ros2 (?:service call|topic pub|action send_goal)(?: -+\w+(?: \d+)?)* (/\S+)"
    r'\s+(\w+/\w+/\w+)\s+"(\{.*?\})"',
    TEXT,
    re.S,
)


def test_executables_launch_files_and_their_arguments_exist() -> None:
    for package, executable in set(re.findall(r"ros2 run (arm_\w+) (\w+)", TEXT)):
        text = (ROOT / f"src/{package}/setup.py").read_text()
        assert f'"{executable} = ' in text, (package, executable)
    for file, arguments in re.findall(r"ros2 launch arm_sim (\S+\.xml)((?: \w+:=\S+)*)", TEXT):
        text = (ROOT / f"src/arm_sim/launch/{file}").read_text()
        for name in re.findall(r"(\w+):=", arguments):
            assert f'<arg name="{name}"' in text, (file, name)


def test_parameters_exist() -> None:
    for node, name in re.findall(r"ros2 param set /(\w+) (\w+)", TEXT):
        assert name in PARAMETERS[node]
    started = r"(?:\./arm|ros2 run \w+) (sim|dynamics|controller)\b([^\n]*)"
    for node, text in re.findall(started, TEXT):
        for name in re.findall(r"-p (\w+):=", text.split("ros2 run")[0]):
            assert name in PARAMETERS[node], (node, name)


@pytest.mark.parametrize(("name", "kind", "text"), REQUESTS, ids=lambda part: part[:40])
def test_requests_are_of_their_type(name: str, kind: str, text: str) -> None:
    package, folder, word = kind.split("/")
    module = pytest.importorskip(f"{package}.{folder}")
    found = getattr(module, word)
    request = {"srv": "Request", "action": "Goal"}.get(folder)
    fill((getattr(found, request) if request else found)(), yaml.safe_load(text))
    assert name.split("/")[-1] in NAMES or package == "simulation_interfaces"
