# SPDX-License-Identifier: Apache-2.0
"""Every entry of a scene acts: without it, or with another value, something is different.

The scenes here contain every key of the schema, each where it acts. ``scene.effect`` refuses keys
where they would not.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from itertools import zip_longest
from typing import Any, get_args

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, Dynamics, SceneError, load_scene
from arm_dynamics.model import contact_points
from arm_dynamics.scene.constraint import SCHEMAS
from arm_dynamics.scene.friction import Sides
from arm_dynamics.scene.schema import Scene
from arm_dynamics.scene.spring import spring_name
from arm_dynamics.scene.types import Part
from arm_sim.imperfections import delivered, sensors_of
from arm_sim.integrators.selection import choose
from arm_sim.plant.plant import Plant
from arm_sim.servo.law import Gains, flexibility

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

ELSEWHERE = {
    "robot.urdf": "of every scene",
    "constraints.rolling.points": "the second is unused, as the reference says",
    "sim.accuracy": "of the verdict on a motion: recording/test_witness.py",
    "robot.xacro": "in place of a URDF: scene/test_xacro.py",
    "robot.arguments": "likewise",
}
"""Keys that are not tried here, and why."""


def keys_of(part: type[Part], place: str = "") -> Iterator[str]:
    """Every key of the schema, without names of joints and places in lists."""
    for name, field in part.model_fields.items():
        key = f"{place}{field.alias or name}"
        if key == "constraints":
            for kind, schema in SCHEMAS.items():
                yield from keys_of(schema, f"{key}.{kind}.")
        elif name == "type":
            continue
        elif parts := list(parts_in(field.annotation)):
            for inner in parts:
                yield from keys_of(inner, f"{key}.")
        else:
            yield key


def parts_in(annotation: object) -> Iterator[type[Part]]:
    if isinstance(annotation, type) and issubclass(annotation, Part) and annotation is not Sides:
        yield annotation
    for argument in get_args(annotation):
        yield from parts_in(argument)


def entries(content: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Places of all entries that are no mappings, nor lists of mappings."""
    inner = content.items() if isinstance(content, dict) else enumerate(content)
    for key, value in inner:
        here = (*place, key)
        if isinstance(value, dict) or (isinstance(value, list) and isinstance(value[0], dict)):
            yield from entries(value, here)
        elif key != "type":
            yield here


def key_of(scene: str, place: tuple[Any, ...]) -> str:
    """The key of an entry, without the name of a joint or link and the place in a list."""
    names = [part for part in place if not isinstance(part, int)]
    if names[0] in ("joints", "links"):
        del names[1]
    if names[0] == "constraints":
        names.insert(1, SCENES[scene]["constraints"][place[1]]["type"])
    if names[0] in ("initial", "sensors"):
        names = [name for name in names if not name.startswith("joint")]
    if names[-1] in Sides.model_fields:
        names.pop()
    return ".".join(names)


def built(content: dict[str, Any]) -> Scene:
    return load_scene({**content, "robot": {"urdf": URDF, **content.get("robot", {})}})


def without(content: dict[str, Any], place: tuple[Any, ...]) -> dict[str, Any]:
    changed = deepcopy(content)
    del at(changed, place[:-1])[place[-1]]
    return changed


def otherwise(content: dict[str, Any], place: tuple[Any, ...]) -> dict[str, Any]:
    changed = deepcopy(content)
    at(changed, place[:-1])[place[-1]] = other(at(content, place))
    return changed


def at(content: Any, place: tuple[Any, ...]) -> Any:
    for key in place:
        content = content[key]
    return content


def other(value: Any) -> Any:
    """Another value of the same kind."""
    if isinstance(value, list):
        return [other(value[0]), *value[1:]]
    if isinstance(value, bool):
        return not value
    swapped = {"link3": "link2", "link2": "link1", "joint1": "joint3", "joint2": "joint1"}
    return swapped[value] if isinstance(value, str) else 0.8 * value + 0.013


def observed(content: dict[str, Any]) -> Iterator[Any]:
    """Everything that depends on a scene, what is quick to find first: the arm, its measurements,
    its equations, its plans.
    """
    scene = built(content)
    model = ArmModel(scene)
    yield [model.joint_names, [spring_name(s, 0) for s in scene.springs], model.command_unit]
    yield [model.position_lower, model.position_upper, model.velocity_limit]
    yield [model.effort_limit, model.command_limit, model.q0, model.v0, scene.initial.hold]
    yield [vars(point) for point in contact_points(model)]
    yield [vars(model.stops), vars(Gains.of(model, flexibility(model), 1e-3))]
    yield friction(model)
    yield measured(scene, model)
    plant = Plant(model)
    choice = choose(plant, None, None, None)
    yield [choice.method.name, choice.dt, choice.tolerance]
    yield [plant.parameters.names, plant.parameters.nominal]
    if scene.bilateral:
        rows, q = plant.closure.rows, np.linspace(0.3, 0.9, model.n)
        yield [plant.closure.initially_active, rows.names, *map(vars, rows.at(q, 2 * q))]
    yield equations(plant)


def equations(plant: Plant) -> list[Any]:
    """The accelerations and rates of internal states, at a few states."""
    rng, found = np.random.default_rng(0), []
    size = plant.rhs.size1_in(2) - len(plant.parameters.nominal)
    for direction, strength in 3 * ((1.0, 9.0), (-1.0, 9.0), (1.0, 0.5), (-1.0, 0.5)):
        x, u = 0.4 * rng.normal(size=plant.nx), strength * rng.normal(size=plant.model.n)
        p = np.concatenate([plant.parameters.nominal, np.full(size, direction)])
        found += [np.array(plant.rhs(x, u, p)), plant.joint_torque(x, u)]
        if plant.events:
            found += [np.array(out) for out in plant.events["loads"].call([x, u, p])]
    return found


def friction(model: ArmModel) -> list[Any]:
    rng, found = np.random.default_rng(0), []
    for _ in range(4):
        v, q, load = rng.normal(size=(3, model.n)) * [[0.2], [2.0], [20.0]]
        found += [model.friction.dry(v, np.sign(v), q, load), model.friction.level]
        found += [model.friction.relative_hold(load, q, load)]
    return found


def measured(scene: Scene, model: ArmModel) -> list[Any]:
    """Measurements of a motion, and commands as they arrive, and what they are for a torque."""
    rng, dt = np.random.default_rng(0), 1e-3
    found = [Dynamics(model).command(*rng.normal(size=(3, model.n)))]
    found += [delivered(scene, dt, rng.normal(size=(2, 40, model.n)))]
    if (sensors := sensors_of(scene, model.joint_names, dt)) is not None:
        sensors.restart(0, *np.zeros((3, model.n)))
        for tick in range(1, 40):
            sensors.look(tick, *np.sin(0.1 * tick + rng.normal(size=(3, model.n))))
            found.append(sensors.measured.copy())
    return found


def differ(one: Any, another: Any) -> bool:
    if isinstance(one, dict):
        return any(differ(one[key], another[key]) for key in one)
    if isinstance(one, list):
        return len(one) != len(another) or any(map(differ, one, another))
    if isinstance(one, np.ndarray):
        return not np.array_equal(one, another, equal_nan=True)
    return bool(one != another)


TRIED = [(name, place) for name, content in SCENES.items() for place in entries(content)]


def test_every_key_is_tried() -> None:
    tried = {key_of(*each) for each in TRIED}
    assert tried - ELSEWHERE.keys() == set(keys_of(Scene)) - ELSEWHERE.keys()


@pytest.mark.parametrize("name", SCENES)
def test_every_entry_acts(name: str) -> None:
    content = SCENES[name]
    known = list(observed(content))
    idle = []
    for place in (place for scene, place in TRIED if scene == name):
        changes = (changed(content, place) for changed in (without, otherwise))
        if not any(missed(known, change) for change in changes):
            idle.append(place)
    assert [place for place in idle if key_of(name, place) not in ELSEWHERE] == []


def missed(known: list[Any], changed: dict[str, Any]) -> bool:
    """Whether a scene without an entry, or with another value, is another one, or none."""
    try:
        return any(differ(*pair) for pair in zip_longest(known, observed(changed)))
    except SceneError:
        return True
