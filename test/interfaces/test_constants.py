# SPDX-License-Identifier: Apache-2.0
"""The standard interfaces have the constants and defaults of the published packages.

Type hashes do not cover them. The values were read from the published definitions of the versions
that ROS 2 Jazzy distributes, which the ``package.xml`` of each package here names.
"""

from importlib import import_module
from pathlib import Path

import pytest

INTERFACES = Path(__file__).parents[2] / "interfaces"

# By package, and by the class that has them; all other classes have none.
PUBLISHED: dict[str, dict[str, dict[str, int]]] = {
    "control_msgs": {
        "msg.JointComponentTolerance": {
            "X_AXIS": 1,
            "Y_AXIS": 2,
            "Z_AXIS": 3,
            "TRANSLATION": 4,
            "ROTATION": 5,
        },
        "action.FollowJointTrajectory.Result": {
            "SUCCESSFUL": 0,
            "INVALID_GOAL": -1,
            "INVALID_JOINTS": -2,
            "OLD_HEADER_TIMESTAMP": -3,
            "PATH_TOLERANCE_VIOLATED": -4,
            "GOAL_TOLERANCE_VIOLATED": -5,
        },
    },
    "simulation_interfaces": {
        "msg.Bounds": {"TYPE_EMPTY": 0, "TYPE_BOX": 1, "TYPE_CONVEX_HULL": 2, "TYPE_SPHERE": 3},
        "msg.EntityCategory": {
            "CATEGORY_OBJECT": 0,
            "CATEGORY_ROBOT": 1,
            "CATEGORY_HUMAN": 2,
            "CATEGORY_DYNAMIC_OBJECT": 4,
            "CATEGORY_STATIC_OBJECT": 5,
        },
        "msg.Result": {
            "RESULT_FEATURE_UNSUPPORTED": 0,
            "RESULT_OK": 1,
            "RESULT_NOT_FOUND": 2,
            "RESULT_INCORRECT_STATE": 3,
            "RESULT_OPERATION_FAILED": 4,
        },
        "msg.SimulationState": {
            "STATE_STOPPED": 0,
            "STATE_PLAYING": 1,
            "STATE_PAUSED": 2,
            "STATE_QUITTING": 3,
            "STATE_NO_WORLD": 4,
            "STATE_LOADING_WORLD": 5,
        },
        "msg.SimulatorFeatures": {
            "SPAWNING": 0,
            "DELETING": 1,
            "NAMED_POSES": 2,
            "POSE_BOUNDS": 3,
            "ENTITY_TAGS": 4,
            "ENTITY_BOUNDS": 5,
            "ENTITY_BOUNDS_BOX": 6,
            "ENTITY_BOUNDS_CONVEX": 7,
            "ENTITY_CATEGORIES": 8,
            "SPAWNING_RESOURCE_STRING": 9,
            "ENTITY_STATE_GETTING": 10,
            "ENTITY_STATE_SETTING": 11,
            "ENTITY_INFO_GETTING": 12,
            "ENTITY_INFO_SETTING": 13,
            "SPAWNABLES": 14,
            "SIMULATION_RESET": 20,
            "SIMULATION_RESET_TIME": 21,
            "SIMULATION_RESET_STATE": 22,
            "SIMULATION_RESET_SPAWNED": 23,
            "SIMULATION_STATE_GETTING": 24,
            "SIMULATION_STATE_SETTING": 25,
            "SIMULATION_STATE_PAUSE": 26,
            "STEP_SIMULATION_SINGLE": 31,
            "STEP_SIMULATION_MULTIPLE": 32,
            "STEP_SIMULATION_ACTION": 33,
            "WORLD_LOADING": 40,
            "WORLD_RESOURCE_STRING": 41,
            "WORLD_TAGS": 42,
            "WORLD_UNLOADING": 43,
            "WORLD_INFO_GETTING": 44,
            "AVAILABLE_WORLDS": 45,
            "SPAWNING_ENTITIES": 50,
        },
        "msg.TagsFilter": {"FILTER_MODE_ANY": 0, "FILTER_MODE_ALL": 1},
        "srv.GetCurrentWorld.Response": {"NO_WORLD_LOADED": 101},
        "srv.ResetSimulation.Request": {
            "SCOPE_DEFAULT": 0,
            "SCOPE_TIME": 1,
            "SCOPE_STATE": 2,
            "SCOPE_SPAWNED": 4,
            "SCOPE_ALL": 255,
        },
        "srv.SetSimulationState.Response": {
            "ALREADY_IN_TARGET_STATE": 101,
            "STATE_TRANSITION_ERROR": 102,
            "INCORRECT_TRANSITION": 103,
        },
        "srv.StepSimulation.Request": {"STEPS__DEFAULT": 1},
    },
    "tf2_msgs": {},
}
PARTS = {
    "msg": ("",),
    "srv": (".Request", ".Response"),
    "action": (".Goal", ".Result", ".Feedback"),
}
DEFINED = [
    (package, f"{file.parent.name}.{file.stem}{part}")
    for package in PUBLISHED
    for file in sorted((INTERFACES / package).glob("*/*.*"))
    for part in PARTS[file.parent.name]
]


def constants(package: str, name: str) -> dict[str, int]:
    """Constants and defaults of a generated class, which are properties of its type."""
    folder, *path = name.split(".")
    found = import_module(f"{package}.{folder}")
    for part in path:
        found = getattr(found, part)
    names = [name for name in vars(type(found)) if name.isupper() and not name.startswith("_")]
    return {name: getattr(found, name) for name in names}


@pytest.mark.parametrize(("package", "name"), DEFINED)
def test_constants_are_the_published_ones(package: str, name: str) -> None:
    assert constants(package, name) == PUBLISHED[package].get(name, {})


def test_every_package_and_every_class_of_the_table_is_compared() -> None:
    assert {path.parent.name for path in INTERFACES.glob("*/package.xml")} == set(PUBLISHED)
    listed = {(package, name) for package in PUBLISHED for name in PUBLISHED[package]}
    assert listed <= set(DEFINED)
