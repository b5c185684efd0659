# SPDX-License-Identifier: Apache-2.0
"""What the manifests of the packages declare is what their code imports."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

SRC = Path(__file__).parents[2] / "src"
PACKAGES = sorted(path.parent.name for path in SRC.glob("*/package.xml"))
PYTHON = ("arm_dynamics", "arm_sim")
# Names of Python modules that have another one in rosdep's list; casadi has none there.
KEYS = {name: f"python3-{name}" for name in ("click", "matplotlib", "numpy", "pydantic", "rich")}
KEYS |= {"yaml": "python3-yaml", "pinocchio": "pinocchio"}
OF_ROS = re.compile(r"rclpy|ament_index_python|arm_dynamics|\w+_(msgs|srvs|interfaces)")


def manifest(package: str) -> ElementTree.Element:
    return ElementTree.parse(SRC / package / "package.xml").getroot()


def declared(package: str) -> list[str]:
    return [part.text or "" for part in manifest(package) if part.tag.endswith("depend")]


def imported(package: str) -> set[str]:
    found = set()
    for path in (SRC / package / package).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                found |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                found.add(node.module.split(".")[0])
    return found - {package}


@pytest.mark.parametrize("package", PYTHON)
def test_what_is_imported_is_declared(package: str) -> None:
    wanted = {KEYS[name] for name in imported(package) & KEYS.keys()}
    wanted |= {name for name in imported(package) if OF_ROS.fullmatch(name)}
    assert sorted(wanted - set(declared(package))) == []


@pytest.mark.parametrize("package", PACKAGES)
def test_a_manifest_is_complete(package: str) -> None:
    root = manifest(package)
    assert root.findtext("name") == package
    for part in ("version", "description", "maintainer", "license", "author"):
        assert root.findtext(part), part
    of_test = [part.text for part in root.iter("test_depend")]
    assert {"python3-pytest", "ament_cmake_pytest"} & set(of_test)
    assert list((SRC / package / "test").glob("test_*.py"))
    names = [(part.tag, part.text) for part in root if part.tag.endswith("depend")]
    assert len(set(names)) == len(names)
