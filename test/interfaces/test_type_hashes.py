# SPDX-License-Identifier: Apache-2.0
"""The standard interfaces are those of the published packages: their type hashes say so.

A type hash (RIHS01, REP 2016) covers the names, the types and the order of all fields, those of
the fields' types included. The numbers here were read from the code that rosidl had generated for
the published packages, not from a build of ours.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_share_directory

PUBLISHED = {
    "control_msgs": {
        "action/FollowJointTrajectory": (
            "738ebcb7a2d7cfa42f9f1001cc99ce3a4383d1cfe508015d9be8485e4b1c66f6"
        ),
        "action/FollowJointTrajectory_Goal": (
            "8a9060704b269608f5a340934cc26e66869dd14bdac29e2e7fd9ec8b9882d205"
        ),
        "action/FollowJointTrajectory_Result": (
            "8002e99ed2c14c6faa522f2a93c26d744c5982f254f9e98ff9c6f19789bdb220"
        ),
        "action/FollowJointTrajectory_Feedback": (
            "3fd0aaecf71725121ae1ff7f01098a5e0da581e672be18a6b2c286cb43d96b49"
        ),
        "action/FollowJointTrajectory_FeedbackMessage": (
            "80398fcb9674a79081a9906e2ccf0c804dd7cb15e22e362e606ee87186beab71"
        ),
        "action/FollowJointTrajectory_SendGoal": (
            "b13789dddc325a7a962825c45e28c77d37237ec129dd0c34dc5994562938c57f"
        ),
        "action/FollowJointTrajectory_GetResult": (
            "e3ceb38e3e1867c8dc0f46014df26e90eb93422f27e9e97f936e07f94be4bc8b"
        ),
        "msg/JointComponentTolerance": (
            "739ea7566931944d33830fa10f1bf5e7a7fbdc3172bce7a7eaac642bd6e3ffa4"
        ),
        "msg/JointTolerance": ("c254f9cece0f3b733017b6990fd46d1326e25242d6b8844398c97d9a88e7d648"),
    },
}


def built(package: str) -> dict[str, str]:
    """The hashes of the types of a package, as rosidl wrote them beside the definitions."""
    hashes: dict[str, str] = {}
    for description in Path(get_package_share_directory(package)).glob("*/*.json"):
        for entry in json.loads(description.read_text())["type_hashes"]:
            hashes[entry["type_name"]] = entry["hash_string"]
    return hashes


@pytest.mark.parametrize(
    ("package", "name"), [(package, name) for package in PUBLISHED for name in PUBLISHED[package]]
)
def test_a_type_is_the_published_one(package: str, name: str) -> None:
    assert built(package)[f"{package}/{name}"] == f"RIHS01_{PUBLISHED[package][name]}"


@pytest.mark.parametrize("package", PUBLISHED)
def test_every_type_that_is_defined_here_is_compared(package: str) -> None:
    here = Path(__file__).parents[2] / "interfaces" / package
    defined = {
        f"{file.parent.name}/{file.stem}"
        for kind in ("msg", "srv", "action")
        for file in (here / kind).glob("*.*")
    }
    assert defined
    assert defined <= PUBLISHED[package].keys()
