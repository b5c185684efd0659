# SPDX-License-Identifier: Apache-2.0
"""Scenes with any set of features at once, on a planar arm and on a Panda, so that each matters.

Each feature belongs to joints of its own where it can, so that a set holds what it names; features
that describe the same thing of one joint are told apart by ``possible``.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from copy import deepcopy
from itertools import combinations
from typing import Any

import models

MOTOR = {"torque_constant": 0.05, "rotor_inertia": 3e-5, "gear_ratio": 50.0}
BELT = {"stiffness": 800.0, "damping": 2.0}
TABLE = {"at": [-1.0, 0.0, 1.0], "factor": [0.6, 1.0, 1.5]}

BRISTLES = {"coulomb": 0.4, "viscous": 0.2, "lugre": {"sigma0": 3e3, "sigma1": 5.0}}
COIL = {"command": "voltage", "resistance": 0.8, "inductance": 1e-3}
JOINT: Mapping[str, tuple[int, dict[str, Any]]] = {
    "viscous": (0, {"friction": {"viscous": 1.5}}),
    "coulomb": (0, {"friction": {"coulomb": 0.8, "static": 1.0, "stribeck_velocity": 0.2}}),
    "lugre": (1, {"friction": BRISTLES}),
    "table": (2, {"friction": {"coulomb": 0.3, "position": TABLE}}),
    "armature": (1, {"armature": 0.3}),
    "spring": (1, {"spring": {"stiffness": 4.0, "rest": -0.5, "damping": 0.1}}),
    "current": (0, {"actuator": {"command": "current", **MOTOR}}),
    "voltage": (2, {"actuator": {**COIL, **MOTOR}}),
    "lossy gear": (1, {"actuator": {"efficiency": 0.8, **MOTOR}}),
    "flexible": (1, {"actuator": {"command": "current", **MOTOR}, "transmission": BELT}),
    "harmonic": (2, {
        "actuator": {"command": "current", **MOTOR},
        "transmission": {
            **BELT, "stiffening": 1e4, "hysteresis": {"torque": 0.2, "deflection": 5e-4},
            "kinematic_error": {"amplitude": 1e-4, "order": 2},
        },
    }),
}  # fmt: skip
"""Features of a joint, with the joint's number: 0 near the base, 1 in the middle, 2 outside."""


OTHERS = ("bilateral", "contact", "ball", "plane on a link", "mimic", "payload", "point spring")
ALL = (*JOINT, *OTHERS)
TOUCHING: Mapping[str, Mapping[str, dict[str, Any]]] = {
    "contact": {
        "planar": {"frame": "link3", "point": [0.2, 0, 0], "plane": {"point": [0, 0, -0.12]}},
        "panda": {
            "frame": "panda_hand",
            "point": [0, 0, 0.1034],
            "plane": {"point": [0, 0, 0.45]},
        },
    },
    "ball": {
        "planar": {"frame": "link3", "radius": 0.04, "plane": {"point": [0, 0, -0.2]}},
        "panda": {"frame": "panda_link6", "radius": 0.06, "plane": {"point": [0, 0, 0.55]}},
    },
    "plane on a link": {
        "planar": {
            "frame": "link3",
            "plane": {"frame": "link1", "point": [0, 0, -0.12], "normal": [0, 0, -1]},
        },
        "panda": {
            "frame": "panda_link6",
            "plane": {"frame": "panda_link3", "point": [0.33, 0, 0], "normal": [1, 0, 0]},
        },
    },
}
"""Contacts that an arm which falls from its start closes soon."""
ARMS = {
    "planar": {
        "joints": ("joint1", "joint2", "joint3"),
        "lock": [],
        "tip": ("link3", [0.2, 0, 0]),
    },
    "panda": {
        "joints": ("panda_joint2", "panda_joint4", "panda_joint6"),
        "lock": ["panda_finger_joint1", "panda_finger_joint2"],
        "tip": ("panda_hand", [0, 0, 0.1034]),
    },
}
START = {
    "planar": {"joint1": 0.3, "joint2": -0.8, "joint3": 0.5},
    "panda": {
        "panda_joint2": -0.785398, "panda_joint4": -2.356194, "panda_joint6": 1.570796,
        "panda_joint7": 0.785398,
    },
}  # fmt: skip


def possible(features: Collection[str]) -> bool:
    """Whether a set contains nothing that describes the same thing of a joint twice."""
    merged: dict[int, dict[str, Any]] = {}
    for name in features:
        if name in JOINT:
            place, settings = JOINT[name]
            if not _fits(merged.setdefault(place, {}), settings):
                return False
            _merge(merged[place], settings)
    lugre = any("lugre" in m.get("friction", {}) for m in merged.values())
    return not (lugre and "lossy gear" in features)  # both on the middle joint


def sets(count: int) -> list[tuple[str, ...]]:
    """All possible sets of so many features."""
    return [chosen for chosen in combinations(ALL, count) if possible(chosen)]


def scene(arm: str, features: Collection[str]) -> dict[str, Any]:
    """A scene of an arm with features, and none that are not asked for."""
    about = ARMS[arm]
    name = "planar_3r" if arm == "planar" else arm
    robot: dict[str, Any] = {"urdf": models.scene(name).robot.urdf, "lock": about["lock"]}
    joints: dict[str, Any] = {"*": {"friction": {"viscous": 0.0, "coulomb": 0.0}}}
    for feature in features:
        if feature in JOINT:
            place, settings = JOINT[feature]
            _merge(joints.setdefault(about["joints"][place], {}), deepcopy(settings))
    data = {"robot": robot, "joints": joints, "initial": {"position": dict(START[arm])}}
    frame, point = about["tip"]
    constraints = []
    if "bilateral" in features:
        first, second = about["joints"][0], about["joints"][2]
        offset = START[arm][first] - 0.7 * START[arm][second]
        constraints.append(
            {"type": "coupling", "joints": [first, second], "ratio": 0.7, "offset": offset}
        )
    if "point spring" in features:
        away = {"planar": [0.5, 0, 0.9], "panda": [0.6, 0.4, 1.2]}[arm]
        ends = {"frames": [frame, "world"], "points": [point, away]}
        data["springs"] = [{**ends, "stiffness": 30.0, "rest_length": 0.2, "damping": 0.5}]
    touching = {"type": "contact", "friction": 0.3, "restitution": 0.2}
    constraints += [touching | TOUCHING[name][arm] for name in TOUCHING if name in features]
    if "mimic" in features:
        robot["urdf"] = _with_mimic(robot["urdf"], about["joints"][2])
    if "payload" in features:
        data |= {
            "payloads": [{"frame": frame, "mass": 0.5, "com": [0.0, 0.02, 0.05]}],
            "tunable": ["payload"],
        }
    return data | ({"constraints": constraints} if constraints else {})


def _fits(have: Mapping[str, Any], new: Mapping[str, Any]) -> bool:
    both = set(have) & set(new)
    return all(
        isinstance(have[k], dict) and isinstance(new[k], dict) and _fits(have[k], new[k])
        for k in both
    )


def _merge(into: dict[str, Any], new: Mapping[str, Any]) -> None:
    for key, value in new.items():
        if isinstance(value, dict):
            _merge(into.setdefault(key, {}), value)
        else:
            into[key] = value


def _with_mimic(urdf: str, leader: str) -> str:
    """The robot with a flap at its tip that follows a joint."""
    tip = "link3" if "link3" in urdf and "panda" not in urdf else "panda_hand"
    flap = f"""<link name="flap"><inertial><origin xyz="0.05 0 0"/><mass value="0.2"/>
      <inertia ixx="1e-4" iyy="2e-4" izz="2e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="flapping" type="revolute"><parent link="{tip}"/><child link="flap"/>
      <origin xyz="0.05 0 0.02"/><axis xyz="0 1 0"/><mimic joint="{leader}" multiplier="-0.5"/>
      <limit lower="-3" upper="3" effort="10" velocity="10"/></joint>"""
    return urdf.replace("</robot>", flap + "</robot>")
