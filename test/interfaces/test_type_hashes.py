# SPDX-License-Identifier: Apache-2.0
"""The standard interfaces are those of the published packages: their type hashes say so.

A type hash (RIHS01, REP 2016) covers the names, the types and the order of all fields, those of
the fields' types included. The numbers here were read from the code that rosidl had generated for
the published packages, not from a build of ours.
"""

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
    "simulation_interfaces": {
        "msg/Bounds": "e8624fe51f0f5548197542697d924c5699ac7198f1e4c68e50c3ca2af73f5b3f",
        "msg/EntityCategory": "43bdf7933fddf75f6970f7a8fe7078524355d821d390b3954bb46ac36c03dfe1",
        "msg/EntityFilters": "8e7b12e8ea062f14c55de4877221fe1b7cd9749665a7ad8a4ab855fc4b148303",
        "msg/EntityInfo": "3b9a2e7fa00f9a59d325b6e47904044c421561a385682027c7fc06c359806319",
        "msg/EntityState": "2e0464a85eb80a939025075d6c20761eca6a4cb9d6baf2c0ba373467c8b598d0",
        "msg/Resource": "2bb1939cf80f8d2f284afba53cbec60b5ff33759bd39b714128ea8867a34c51a",
        "msg/Result": "cf43a306adff3337a0a47143d8f5689933bc70a30478f13b077dc1fe3bc5ad17",
        "msg/SimulationState": "bb9f87ccdd98fba113052a512d9801e84ce732d0a2b3c2b0cb281828de36e415",
        "msg/SimulatorFeatures": (
            "8b101c8529bc0ea3dcf056078254768f39832b9ef0adaf93bd5cea96c0de3305"
        ),
        "msg/TagsFilter": "5c3efc51e8ed04c266c09cb4691ec95b964cd410558e01d8c83646b038826b45",
        "msg/WorldResource": "e3b65ecf904b9b115673e4a343c6aa3d28c19e185a71228faa64b783afcf2403",
        "srv/GetCurrentWorld": "79ed4e910e1b7a1c9f7950ff758bfba3535bf0dec669054e8af115a099724ddd",
        "srv/GetEntities": "cb90004c48cd50f37732fb008e22c34c261dd680a723bf0f85d8437ea4498bf7",
        "srv/GetEntitiesStates": (
            "0a76170d0c1c90e1eaf805cfab78ea801d1f82df309a28c1f0fae4b570f19754"
        ),
        "srv/GetSimulationState": (
            "3362dcebee4b1afebbf9c4beee5c79c1455385aded62092a892d61fde8644f30"
        ),
        "srv/ResetSimulation": "4ce285d7ff9b8ac70dcc95161f32bf54c05a6f4b13427990e41ab40c36c39646",
        "srv/StepSimulation": "913fe0653690ce6bf8f09f316e6a626747012e9fca31e26719910d417aa8565c",
    },
    "tf2_msgs": {
        "msg/TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"
    },
}


# Of these no generated hash was found, but the fields: from the published package's generated
# structs. Fields are as (name, type); a "[]" behind a type is a sequence.
FIELDS = {
    "simulation_interfaces": {
        "srv/GetEntityInfo_Request": [("entity", "string")],
        "srv/GetEntityInfo_Response": [("result", "msg/Result"), ("info", "msg/EntityInfo")],
        "srv/GetEntityState_Request": [("entity", "string")],
        "srv/GetEntityState_Response": [("result", "msg/Result"), ("state", "msg/EntityState")],
        "srv/GetSimulatorFeatures_Request": [("structure_needs_at_least_one_member", "uint8")],
        "srv/GetSimulatorFeatures_Response": [("features", "msg/SimulatorFeatures")],
        "srv/SetSimulationState_Request": [("state", "msg/SimulationState")],
        "srv/SetSimulationState_Response": [("result", "msg/Result")],
        "action/SimulateSteps_Goal": [("steps", "uint64")],
        "action/SimulateSteps_Result": [("result", "msg/Result")],
        "action/SimulateSteps_Feedback": [
            ("completed_steps", "uint64"),
            ("remaining_steps", "uint64"),
        ],
    }
}
TYPES = {
    "uint8": 3,
    "uint64": 9,
    "string": 17,
    "nested": 1,
}  # type_description_interfaces/FieldType


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
    known = {name.partition("_")[0] for name in FIELDS.get(package, ())}
    assert defined <= PUBLISHED[package].keys() | known


@pytest.mark.parametrize(
    ("package", "name"), [(package, name) for package in FIELDS for name in FIELDS[package]]
)
def test_a_type_has_the_published_fields(package: str, name: str) -> None:
    assert described(package)[f"{package}/{name}"] == [
        (field, TYPES.get(kind, TYPES["nested"]), "" if kind in TYPES else f"{package}/{kind}")
        for field, kind in FIELDS[package][name]
    ]


def described(package: str) -> dict[str, list[tuple[str, int, str]]]:
    """Fields of the types of a package: name, type, and name of a nested type."""
    found: dict[str, list[tuple[str, int, str]]] = {}
    for description in Path(get_package_share_directory(package)).glob("*/*.json"):
        message = json.loads(description.read_text())["type_description_msg"]
        for one in (message["type_description"], *message["referenced_type_descriptions"]):
            found[one["type_name"]] = [
                (field["name"], field["type"]["type_id"], field["type"]["nested_type_name"])
                for field in one["fields"]
            ]
    return found
