# SPDX-License-Identifier: Apache-2.0
"""Scenes that together contain every key of the schema, each where it acts."""

from collections.abc import Iterator
from typing import Any, get_args

import models
from arm_dynamics import load_scene
from arm_dynamics.scene.friction import Sides
from arm_dynamics.scene.schema import Scene
from arm_dynamics.scene.types import Part

URDF = (models.FOLDER / "planar_3r.urdf").read_text()
MOTOR = {
    "resistance": 0.8, "torque_constant": 0.05, "back_emf_constant": 0.04, "gear_ratio": 50.0,
    "rotor_inertia": 3e-5, "rotor_damping": 1e-5, "current_limit": 2.0, "voltage_limit": 1.5,
}  # fmt: skip
WAVE = {"amplitude": 1e-3, "order": 2, "phase": 0.3}
SOFT = {"stiffness": 800.0, "damping": 2.0, "stiffening": 1e4, "kinematic_error": WAVE}
DRY = {"viscous": 3.0, "coulomb": 0.6, "static": 0.9, "stribeck_velocity": 0.2}
TABLES = {
    "position": {"at": [-1, 0, 1], "factor": [0.6, 1, 1.5], "period": 7.0},
    "load": {"at": [0, 4, 10], "factor": [1, 1.1, 1.4], "period": 30.0},
}
TIP, ENDS = ["link3", "world"], [[0.2, 0, 0], [0.5, 0, 0.3]]
SCENES: dict[str, dict[str, Any]] = {
    "arm": {
        "robot": {"lock": ["joint3"]},
        "gravity": [0.1, 0.2, -5.0],
        "initial": {"position": {"joint1": 0.3}, "velocity": {"joint1": 0.4}},
        "sim": {"integrator": "dopri5", "dt": 2e-3, "tolerance": 1e-7},
        "tunable": ["gravity", "payload", "friction", "external"],
        "payloads": [{
            "frame": "link2", "mass": 0.5, "com": [0.1, 0.02, 0.03],
            "inertia": [2e-3, 1e-4, 0, 3e-3, 0, 1e-3],
        }],
        "links": {"link1": {
            "mass": 2.5, "com": [0.2, 0.02, 0.03], "inertia": [2e-3, 1e-4, 0, 3e-3, 0, 1e-3],
        }},
    },
    "joints": {
        "joints": {
            "*": {"friction": {"viscous": 0.3}},
            "joint1": {
                "armature": 0.2,
                "friction": {**DRY, **TABLES},
                "spring": {"stiffness": 4.0, "rest": -0.5, "damping": 0.1},
                "limits": {"effort": 10.0, "velocity": 3.0, "lower": -0.5, "upper": 1.0,
                           "stop": {"restitution": 0.5}},
                "servo": {"bandwidth": 50.0, "damping_ratio": 0.8},
            },
            "joint2": {
                "friction": {
                    "coulomb": 0.4, "viscous": {"positive": 0.1, "negative": 0.2},
                    "lugre": {"sigma0": 3e3, "sigma1": 5.0, "sigma1_velocity": 0.1},
                },
                "limits": {"stop": {"stiffness": 1e4, "damping": 10.0}},
                "servo": {"stiffness": 500.0, "damping": 20.0},
            },
        },
        "initial": {"position": {"joint1": 0.3}},
    },
    "drives": {
        "joints": {
            "joint1": {"actuator": {**MOTOR, "command": "voltage", "inductance": 1e-3}},
            "joint2": {
                "actuator": {**MOTOR, "cogging": WAVE},
                "transmission": {**SOFT, "hysteresis": {
                    "torque": 0.2, "deflection": 5e-4, "sharpness": 2.0}},
            },
            "joint3": {
                "actuator": {**MOTOR, "command": "current"},
                "transmission": {**SOFT, "backlash": 1e-2},
            },
        },
    },
    "gear": {"joints": {"joint2": {"actuator": {"efficiency": 0.8}}}},
    "curves": {"joints": {"joint1": {
        "friction": {"table": {
            "speed": [0, 1, 5], "torque": [[0.3, 0.5, 0.9], [0.6, 0.8, 1.4]],
            "position": [-1, 1], "period": 7.0,
        }},
        "spring": {"table": {"deflection": [-2, 0, 2], "torque": [-9, 0, 5]}},
    }}},
    "springs": {"springs": [{
        "frames": TIP, "points": ENDS, "stiffness": 30.0, "rest_length": 0.9, "damping": 0.5,
        "force": 2.0, "tension_only": True, "name": "cord",
    }]},
    "contact": {"constraints": [{
        "type": "contact", "frame": "link3", "point": [0.2, 0, 0], "radius": 0.02,
        "plane": {"frame": "link1", "point": [0, 0, -2], "normal": [0.1, 0, 1]},
        "friction": 0.3, "static_friction": 0.4, "restitution": 0.2, "name": "toe",
    }]},
    "sensors": {
        "sensors": {
            "seed": 3,
            "position": {"resolution": {"joint1": 1e-2}, "counts": {"joint2": 1000},
                         "noise": 1e-4, "offset": 1e-3},
            "velocity": {"from": "position", "cutoff": 50, "order": 2, "noise": 1e-3,
                         "offset": 0.1},
            "effort": {"noise": 0.1, "offset": 0.2},
            "delay": 2e-3, "jitter": 2e-3, "loss": 0.1,
        },
        "commands": {"gravity_compensated": True, "delay": 1e-3, "jitter": 3e-3, "loss": 0.3},
    },
}  # fmt: skip
TIED: dict[str, dict[str, Any]] = {
    "point": {"points": ENDS},
    "frame": {"points": ENDS, "rpy": [0, 0.4, 0]},
    "line": {"points": ENDS, "direction": [1, 0, 0.3]},
    "plane": {"points": ENDS, "normal": [0.1, 0, 1], "height": 0.05},
    "distance": {"points": ENDS, "distance": 0.3},
    "rolling": {"points": [[0.2, 0, 0], [0, 0, 0]], "radius": 0.1, "normal": [0, 0, 1],
                "axle": [0, 1, 0]},
}  # fmt: skip
SWITCHED = {"name": "tie", "switchable": True, "active": False}
GUESS = {"position": {"joint1": 0.4, "joint2": -0.9, "joint3": 0.5}}
SCENES |= {
    kind: {"constraints": [{"type": kind, "frames": TIP, **SWITCHED, **keys}], "initial": GUESS}
    for kind, keys in TIED.items()
}
COUPLED = {"type": "coupling", "joints": ["joint1", "joint2"], "ratio": -0.5, "offset": 0.1}
SCENES["coupling"] = {
    "constraints": [
        {**COUPLED, **SWITCHED},
        {"type": "coupling", "joints": ["joint2", "joint3"], "ratio": -0.5},
    ],
    "initial": {**GUESS, "hold": ["joint3"]},
}


def entries(content: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Places of all entries that are no mappings, nor lists of mappings."""
    inner = content.items() if isinstance(content, dict) else enumerate(content)
    for key, value in inner:
        here = (*place, key)
        if isinstance(value, dict) or (isinstance(value, list) and isinstance(value[0], dict)):
            yield from entries(value, here)
        elif key != "type":
            yield here


def at(content: Any, place: tuple[Any, ...]) -> Any:
    for key in place:
        content = content[key]
    return content


def parts_in(annotation: object) -> Iterator[type[Part]]:
    if isinstance(annotation, type) and issubclass(annotation, Part) and annotation is not Sides:
        yield annotation
    for argument in get_args(annotation):
        yield from parts_in(argument)


def built(content: dict[str, Any]) -> Scene:
    return load_scene({**content, "robot": {"urdf": URDF, **content.get("robot", {})}})
