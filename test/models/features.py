# SPDX-License-Identifier: Apache-2.0
"""Scenes with any set of features at once, on a planar arm and on a Panda, so that each matters.

The joints are driven by torques near those that hold the start, so that dry friction holds for a
while; a motor gets the current or voltage that gives its joint's torque at rest. Features of one
joint are merged: a flexible drive is driven by a current unless a voltage is asked for.
"""

from collections.abc import Collection, Mapping
from copy import deepcopy
from itertools import combinations
from typing import Any

import numpy as np

import models

MOTOR = {"resistance": 0.8, "torque_constant": 0.05, "rotor_inertia": 3e-5, "gear_ratio": 50.0}
PER_AMPERE = MOTOR["torque_constant"] * MOTOR["gear_ratio"]  # [N m/A] at the joint
BELT = {"stiffness": 800.0, "damping": 2.0}
TABLE = {"at": [-1.0, 0.0, 1.0], "factor": [0.6, 1.0, 1.5]}

BRISTLES = {"coulomb": 0.4, "viscous": 0.2, "lugre": {"sigma0": 3e3, "sigma1": 5.0}}
BARE = {"friction": {"viscous": 0.0, "coulomb": 0.0}, "limits": {"stop": False}}
"""Of every joint, whatever its URDF says."""
JOINT: Mapping[str, tuple[int, dict[str, Any]]] = {
    "viscous": (0, {"friction": {"viscous": 1.5}}),
    "coulomb": (0, {"friction": {"coulomb": 1.6, "static": 2.4, "stribeck_velocity": 0.2}}),
    "lugre": (1, {"friction": BRISTLES}),
    "table": (2, {"friction": {"coulomb": 0.3, "position": TABLE}}),
    "armature": (1, {"armature": 0.3}),
    "spring": (1, {"spring": {"stiffness": 4.0, "rest": -0.5, "damping": 0.1}}),
    "current": (0, {"actuator": {"command": "current", **MOTOR}}),
    "voltage": (2, {"actuator": {**MOTOR, "command": "voltage", "inductance": 1e-3}}),
    "lossy gear": (2, {"actuator": {**MOTOR, "efficiency": 0.8}}),
    "flexible": (1, {"actuator": MOTOR, "transmission": BELT}),
    "harmonic": (2, {
        "actuator": MOTOR,
        "transmission": {
            **BELT, "stiffening": 1e4, "hysteresis": {"torque": 0.2, "deflection": 5e-4},
            "kinematic_error": {"amplitude": 1e-4, "order": 2},
        },
    }),
}  # fmt: skip
"""Features of a joint, with the joint's number: 0 near the base, 1 in the middle, 2 outside."""

OTHERS = ("end stop", "bilateral", "contact", "mimic", "payload", "point spring")
ALL = (*JOINT, *OTHERS)
"""Those of which every pair is held against an independent solution."""
TOUCHING: Mapping[str, Mapping[str, dict[str, Any]]] = {
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
"""Other kinds of contact, that an arm which falls from its start closes soon."""
ARMS = {
    "planar": {
        "joints": ("joint1", "joint2", "joint3"),
        "lock": [],
        "tip": ("link3", [0.2, 0, 0]),
        "stop": {"lower": -1.0, "upper": 2.5},
        "cord": [0.5, 0, 0.9],
        "table": -0.12,
        "rod": {"points": [[0, 0, 0], [0.5, 0, 0.3]], "distance": 0.3566118245039002},
    },
    "panda": {
        "joints": ("panda_joint2", "panda_joint4", "panda_joint6"),
        "lock": ["panda_finger_joint1", "panda_finger_joint2"],
        "tip": ("panda_hand", [0, 0, 0.1034]),
        "stop": {"lower": -2.5, "upper": -0.07},
        "cord": [0.6, 0.4, 1.2],
        "table": 0.48,
        "rod": {"points": [[0, 0, 0], [0.3, 0.1, 0.9]], "distance": 0.32553431900914065},
    },
}
START = {
    "planar": {"joint1": 0.3, "joint2": -0.8, "joint3": 0.5},
    "panda": {
        "panda_joint2": -0.785398, "panda_joint4": -2.356194, "panda_joint6": 1.570796,
        "panda_joint7": 0.785398,
    },
}  # fmt: skip
TORQUE = {
    "planar": {"joint1": 23.48, "joint2": 4.86, "joint3": 0.48},
    "panda": {
        "panda_joint1": 1.0, "panda_joint2": -2.99, "panda_joint3": -0.6, "panda_joint4": 20.52,
        "panda_joint5": 0.6, "panda_joint6": 2.58,
    },
}  # fmt: skip
"""Of the joints that have no motor, in [N m]; of all others nothing."""
SPARE = {"panda_joint1": 1.5, "panda_joint3": 1.5, "panda_joint5": 1.5, "panda_joint7": 0.3}
"""Viscous friction of the joints of a Panda that carry no feature: they follow, not fly."""
LOAD = {"mass": 0.9, "com": [0.01, 0.02, 0.08], "inertia": [2e-3, 1e-4, 0.0, 3e-3, 0.0, 1e-3]}
"""What ``payload`` becomes before the first tick."""


def sets(count: int, among: Collection[str] = ALL) -> list[tuple[str, ...]]:
    """All sets of so many features."""
    return list(combinations(among, count))


def many(count: int, least: int = 6, seed: int = 0) -> list[tuple[str, ...]]:
    """So many random sets of ``least`` to all features but four."""
    rng = np.random.default_rng(seed)
    sizes = rng.integers(least, len(ALL) - 3, count)
    picks = [rng.choice(ALL, size, replace=False) for size in sizes]
    return [tuple(f for f in ALL if f in chosen) for chosen in picks]


def scene(arm: str, features: Collection[str]) -> dict[str, Any]:
    """A scene of an arm with the given features only."""
    about = ARMS[arm]
    name = "planar_3r" if arm == "planar" else arm
    robot: dict[str, Any] = {"urdf": models.scene(name).robot.urdf, "lock": about["lock"]}
    joints: dict[str, Any] = {"*": deepcopy(BARE)}
    if arm == "panda":
        joints |= {name: {"friction": {"viscous": level}} for name, level in SPARE.items()}
    for feature in features:
        if feature in JOINT:
            place, settings = JOINT[feature]
            _merge(joints.setdefault(about["joints"][place], {}), deepcopy(settings))
    if "end stop" in features:
        limits = {**about["stop"], "stop": {"restitution": 0.3}}
        _merge(joints.setdefault(about["joints"][1], {}), {"limits": limits})
    for joint in joints.values():
        if "transmission" in joint:
            joint["actuator"].setdefault("command", "current")
    data = {"robot": robot, "joints": joints, "initial": {"position": dict(START[arm])}}
    frame, point = about["tip"]
    constraints: list[dict[str, Any]] = []
    if "bilateral" in features:
        constraints.append({"type": "distance", "frames": [frame, "world"], **about["rod"]})
    if "contact" in features:
        plane = {"point": [0, 0, about["table"]], "normal": [0, 0, 1]}
        constraints.append(
            {
                "type": "contact", "frame": frame, "point": point, "friction": 0.3,
                "restitution": 0.2, "plane": plane,
            }
        )  # fmt: skip
    touching = {"type": "contact", "friction": 0.3, "restitution": 0.2}
    constraints += [touching | TOUCHING[name][arm] for name in TOUCHING if name in features]
    if "point spring" in features:
        ends = {"frames": [frame, "world"], "points": [point, about["cord"]]}
        data["springs"] = [{**ends, "stiffness": 30.0, "rest_length": 0.2, "damping": 0.5}]
    if "mimic" in features:
        robot["urdf"] = _with_mimic(robot["urdf"], about["joints"][2])
    if "payload" in features:
        data |= {
            "payloads": [{"frame": frame, "mass": 0.5, "com": [0.0, 0.02, 0.05]}],
            "tunable": ["payload"],
        }
    return data | ({"constraints": constraints} if constraints else {})


def command(arm: str, scene: Mapping[str, Any]) -> dict[str, float]:
    """What drives the joints of a scene, by name: a torque, a current or a voltage."""
    made = {}
    for name, torque in TORQUE[arm].items():
        actuator = scene["joints"].get(name, {}).get("actuator", {})
        current = torque / PER_AMPERE
        kinds = {"current": current, "voltage": current * MOTOR["resistance"]}
        made[name] = kinds.get(actuator.get("command"), torque)
    return made


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
