# SPDX-License-Identifier: Apache-2.0
"""The standard interfaces are those of the published packages.

A type hash (RIHS01, REP 2016) covers the names, the types and the order of all fields, those of
the fields' types included, but neither constants nor defaults.
"""

import json
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import yaml
from ament_index_python.packages import get_package_share_directory

PUBLISHED = yaml.safe_load((Path(__file__).parent / "published.yaml").read_text())
INTERFACES = Path(__file__).parents[2] / "interfaces"
TYPES = {"uint8": 3, "uint64": 9, "string": 17}  # of type_description_interfaces/FieldType
NESTED = 1
PARTS = {
    "msg": [""],
    "srv": [".Request", ".Response"],
    "action": [".Goal", ".Result", ".Feedback"],
}


def built(package: str) -> Iterator[Any]:
    """What rosidl wrote beside the definitions of a package."""
    for description in Path(get_package_share_directory(package)).glob("*/*.json"):
        yield json.loads(description.read_text())


def defined(package: str) -> list[Path]:
    return sorted(INTERFACES.joinpath(package).glob("*/*.*"))


@pytest.mark.parametrize("package", PUBLISHED["hashes"])
def test_types_have_the_published_hashes(package: str) -> None:
    hashes = {
        entry["type_name"]: entry["hash_string"]
        for description in built(package)
        for entry in description["type_hashes"]
    }
    for name, number in PUBLISHED["hashes"][package].items():
        assert hashes[f"{package}/{name}"] == f"RIHS01_{number}", name


@pytest.mark.parametrize("package", PUBLISHED["fields"])
def test_types_without_a_published_hash_have_the_published_fields(package: str) -> None:
    found = {}
    for description in built(package):
        message = description["type_description_msg"]
        for one in (message["type_description"], *message["referenced_type_descriptions"]):
            found[one["type_name"]] = [
                (field["name"], field["type"]["type_id"], field["type"]["nested_type_name"])
                for field in one["fields"]
            ]
    for name, fields in PUBLISHED["fields"][package].items():
        assert found[f"{package}/{name}"] == [
            (field, TYPES.get(kind, NESTED), "" if kind in TYPES else f"{package}/{kind}")
            for field, kind in fields.items()
        ]


@pytest.mark.parametrize("package", PUBLISHED["hashes"])
def test_constants_and_defaults_are_the_published_ones(package: str) -> None:
    """A generated class has them as properties of its type."""
    published, compared = PUBLISHED["constants"].get(package, {}), set()
    for file in defined(package):
        for part in PARTS[file.parent.name]:
            name = f"{file.parent.name}.{file.stem}{part}"
            found = import_module(f"{package}.{file.parent.name}")
            for word in f"{file.stem}{part}".split("."):
                found = getattr(found, word)
            names = [n for n in vars(type(found)) if n.isupper() and not n.startswith("_")]
            assert {n: getattr(found, n) for n in names} == published.get(name, {}), name
            compared.add(name)
    assert compared >= published.keys()


def test_everything_that_is_defined_here_is_compared() -> None:
    packages = {path.parent.name for path in INTERFACES.glob("*/package.xml")}
    assert packages == PUBLISHED["hashes"].keys()
    for package in packages:
        types = {f"{file.parent.name}/{file.stem}" for file in defined(package)}
        fields = {name.partition("_")[0] for name in PUBLISHED["fields"].get(package, {})}
        assert types and types <= PUBLISHED["hashes"][package].keys() | fields
