# SPDX-License-Identifier: Apache-2.0
"""What the packages declare, to ROS and to pip, is what their code imports and is tested with."""

import ast
import re
import tomllib
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

SRC = Path(__file__).parents[2] / "src"
PACKAGES = sorted(path.parent.name for path in SRC.glob("*/package.xml"))
PYTHON = ("arm_dynamics", "arm_sim", "arm_studies")
# Names of Python modules that have another one in rosdep's list; casadi has none there.
KEYS = {name: f"python3-{name}" for name in ("click", "matplotlib", "numpy", "pydantic", "rich")}
KEYS |= {"yaml": "python3-yaml", "pinocchio": "pinocchio"}
OF_ROS = re.compile(r"rclpy|ament_index_python|arm_dynamics|\w+_(msgs|srvs|interfaces)")


def manifest(package: str) -> ElementTree.Element:
    return ElementTree.parse(SRC / package / "package.xml").getroot()


def declared(package: str) -> list[str]:
    return [part.text or "" for part in manifest(package) if part.tag.endswith("depend")]


@cache
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
    of_test = [part.text for part in root.iter("test_depend")]
    assert {"python3-pytest", "ament_cmake_pytest"} & set(of_test)
    assert list((SRC / package / "test").glob("test_*.py"))
    names = [(part.tag, part.text) for part in root if part.tag.endswith("depend")]
    assert len(set(names)) == len(names)


ROOT = SRC.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
# Groups that pip offers too, and what of a group pip has nothing to do with.
EXTRAS = sorted(PROJECT["dependency-groups"].keys() & PROJECT["project"]["optional-dependencies"])


def ranges(lines: Iterable[str]) -> dict[str, SpecifierSet]:
    """Versions that are allowed, by name."""
    wanted = [Requirement(line) for line in lines if line and not line.startswith("#")]
    return {canonicalize_name(one.name): one.specifier for one in wanted}


def pins(group: str) -> dict[str, str]:
    """Versions that are tested."""
    pinned = (line.split("==") for line in PROJECT["dependency-groups"][group])
    return {canonicalize_name(name): version for name, version in pinned}


def of_packages() -> dict[str, SpecifierSet]:
    files = (
        f.read_text() for package in PYTHON for f in (SRC / package).glob("requirements*.txt")
    )
    return ranges("\n".join(files).splitlines())


def test_pip_installs_what_the_suite_is_tested_with() -> None:
    wanted, tested = of_packages(), pins("run")
    assert wanted.keys() == tested.keys()
    assert [name for name, allowed in wanted.items() if tested[name] not in allowed] == []


@pytest.mark.parametrize("extra", EXTRAS)
def test_extras_admit_what_their_groups_pin(extra: str) -> None:
    wanted, tested = ranges(PROJECT["project"]["optional-dependencies"][extra]), pins(extra)
    assert wanted
    assert [n for n, allowed in wanted.items() if tested.get(n, "none") not in allowed] == []


# Names that NumPy has got since 1.26, the oldest that is allowed.
NEWER = re.compile(
    r"\bnp\.(acosh?|asinh?|astype|atan[2h]?|bitwise_(count|invert|left_shift|right_shift)|bool|concat|"
    r"cumulative_(prod|sum)|isdtype|long|matrix_transpose|matvec|permute_dims|pow|strings|trapezoid|"
    r"ulong|unique_\w+|unstack|vecdot|vecmat|"
    r"linalg\.(cross|diagonal|matmul|matrix_norm|matrix_transpose|outer|svdvals|tensordot|trace|"
    r"vecdot|vector_norm))\b|\blstsq\((?!.*rcond)"  # whose default is another one, with a warning
)


@pytest.mark.parametrize("folder", ["src", "examples", "docs", "benchmarks", "test"])
def test_code_uses_nothing_that_the_oldest_numpy_lacks(folder: str) -> None:
    assert "1.26" in of_packages()["numpy"] and "1.25" not in of_packages()["numpy"]
    files = [file for kind in ("py", "md") for file in (ROOT / folder).rglob(f"*.{kind}")]
    found = {f"{file}: {use[0]}" for file in files for use in NEWER.finditer(file.read_text())}
    assert files and sorted(found) == []


def test_all_name_one_version() -> None:
    said = {package: manifest(package).findtext("version") for package in PACKAGES}
    for package in PYTHON:
        text = (SRC / package / package / "__init__.py").read_text()
        said[f"{package}.__version__"] = re.findall(r'^__version__ = "(.*)"$', text, re.M)[0]
    assert len(set(said.values())) == 1, said
