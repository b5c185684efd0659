# SPDX-License-Identifier: Apache-2.0
"""Every entry of a scene acts: without it, or with another value, something is different.

The scenes here contain every key of the schema, each where it acts. ``scene.effect`` refuses keys
where they would not.
"""

from collections.abc import Iterator
from copy import deepcopy
from itertools import zip_longest
from typing import Any

import numpy as np
import pytest

from arm_dynamics import ArmModel, Dynamics, SceneError
from arm_dynamics.model.tree_builder import contact_points
from arm_dynamics.scene.constraint import SCHEMAS
from arm_dynamics.scene.friction import Sides
from arm_dynamics.scene.schema import Scene
from arm_dynamics.scene.spring import spring_name
from arm_dynamics.scene.types import Part
from arm_sim.imperfections import delivered, sensors_of
from arm_sim.integrators.selection import choose
from arm_sim.plant.plant import Plant
from arm_sim.servo.law import Gains, flexibility
from models.every_key import SCENES, at, built, entries, parts_in

ELSEWHERE = {
    "robot.urdf": "of every scene",
    "constraints.rolling.points": "the second is unused, as the reference says",
    "sim.accuracy": "of the verdict on a motion: recording/test_second_run.py",
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


def without(content: dict[str, Any], place: tuple[Any, ...]) -> dict[str, Any]:
    changed = deepcopy(content)
    del at(changed, place[:-1])[place[-1]]
    return changed


def otherwise(content: dict[str, Any], place: tuple[Any, ...]) -> dict[str, Any]:
    changed = deepcopy(content)
    at(changed, place[:-1])[place[-1]] = other(at(content, place))
    return changed


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
            sensors.sample(tick, *np.sin(0.1 * tick + rng.normal(size=(3, model.n))))
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


TRIED = {
    key_of(name, place): (name, place)
    for name, content in SCENES.items()
    for place in entries(content)
}
"""One place of each key."""


def test_every_key_is_tried() -> None:
    assert TRIED.keys() - ELSEWHERE.keys() == set(keys_of(Scene)) - ELSEWHERE.keys()


@pytest.mark.parametrize("name", SCENES)
def test_every_entry_acts(name: str) -> None:
    content = SCENES[name]
    known, idle = list(observed(content)), []
    for key, (scene, place) in TRIED.items():
        if scene == name and key not in ELSEWHERE:
            changes = (changed(content, place) for changed in (without, otherwise))
            if not any(missed(known, change) for change in changes):
                idle.append(place)
    assert idle == []


def missed(known: list[Any], changed: dict[str, Any]) -> bool:
    """Whether a scene without an entry, or with another value, is another one, or none."""
    try:
        return any(differ(*pair) for pair in zip_longest(known, observed(changed)))
    except SceneError:
        return True
