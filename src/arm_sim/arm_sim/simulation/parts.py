# SPDX-License-Identifier: Apache-2.0
"""The parts of the physics that a tick computes and skips, with reasons, as text."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from arm_dynamics import ArmModel
from arm_dynamics.actuation.internal_state import FrictionLaw, StatefulLaw
from arm_dynamics.actuation.joint_laws import FRICTION
from arm_dynamics.exceptions import counted
from arm_dynamics.model.stops import Stops
from arm_dynamics.scene import Scene
from arm_dynamics.scene.constraint import WORLD
from arm_dynamics.scene.imperfections import Line
from arm_sim.plant.plant import Plant


@dataclass(frozen=True)
class Part:
    """One part of the physics.

    Attributes:
        name: Its name.
        on: Whether it is computed.
        why: The reason, from the scene.
    """

    name: str
    on: bool
    why: str


def parts_of(plant: Plant) -> tuple[Part, ...]:
    """All parts of the physics that a scene may have."""
    model, scene, p = plant.model, plant.model.scene, plant.parameters.names
    gravity, viscous, armature = scene.gravity, model.viscous, model.armature
    dry = model.friction.static.mean
    locked, loads = len(scene.robot.lock), len(scene.payloads)
    contacts, by_speed = _contacts(scene), _by_speed(model)
    folded = f"{loads} {'bodies' if loads > 1 else 'body'}, merged into links"
    limited = int(np.isfinite(model.effort_limit).sum())
    followers = model.pin.nv - model.n
    rows = sum(len(kept) for kept in model.constraint_rows.values())
    free = model.n - rows
    freedom = f"{counted(rows, 'row')}, {counted(free, 'degree')} of freedom"
    states = sum(len(law.states) for law in plant.laws.laws if law.replaces_command.any())
    driven = f"{_at(model.drives)}, {counted(states, 'state')}"
    gears = f"{counted(len(model.friction.gears), 'joint')}, load-dependent friction, by events"
    tables = sum(
        bool(by_position or by_load)
        for friction in (model.friction, model.friction.by_law)
        for by_position, by_load in zip(friction.position, friction.load, strict=True)
    )
    return (
        Part("rigid body", True, counted(model.n, "joint")),
        _part("gravity", any(gravity), f"{list(gravity)} m/s²", "zero", "gravity" in p),
        _part("springs", model.springs, _springs(model), "none"),
        _part("viscous friction", viscous.any(), _at(viscous), "no coefficient", "friction" in p),
        _part("dry friction", dry.any(), f"{_at(dry)}, by events", "not given", "coulomb" in p),
        _part("contact", contacts, f"{contacts}, solved by events", "no point touches a plane"),
        *(_law_part(kind, plant.laws.laws) for kind in FRICTION),
        _part("friction by position or load", tables, counted(tables, "joint"), "no table"),
        _part("friction by speed", by_speed, by_speed, "no table"),
        _part("drive inertia", armature.any(), _at(armature), "no armature"),
        _part("motors and transmissions", any(model.drives), driven, "no actuator"),
        _part("gear losses", model.friction.gears, gears, "every gear is ideal"),
        _part("payloads", loads, folded, "none", "payload" in p),
        _part("constraints", rows, freedom, "none"),
        _part("end stops", model.stops, _stops(model.stops), "no joint has one"),
        _part("effort limits", limited, counted(limited, "joint"), "no joint has one"),
        _part("sensors", scene.sensors, _sensors(scene), "measurements are exact and immediate"),
        _part("delay and loss of commands", _late(scene), _late(scene), "they act immediately"),
        _part("mimic joints", followers, f"{counted(followers, 'joint')} of others", "none"),
        _part("locked joints", False, "", f"{locked} eliminated" if locked else "none"),
        _part("energies", False, "", "computed on demand"),
        _part("check by a second run", False, "", "on demand, about four times a run"),
    )


def _part(name: str, on: object, why: str, why_not: str, tunable: bool = False) -> Part:
    if tunable:
        return Part(name, True, f"{why if on else why_not}, tunable")
    return Part(name, bool(on), why if on else why_not)


def _stops(stops: Stops) -> str:
    kinds = {"rigid": stops.rigid, "compliant": stops.compliant}
    counts = [f"{_at(ends.any(axis=0))}, {kind}" for kind, ends in kinds.items() if ends.any()]
    return f"{' and '.join(counts)}, solved by events"


def _contacts(scene: Scene) -> str:
    """Numbers of contacts by kind, and the frames of planes that are not fixed to the world."""
    contacts = [contact for _, contact in scene.contacts]
    balls = sum(contact.radius > 0 for contact in contacts)
    kinds = {"point": len(contacts) - balls, "ball": balls}
    carriers = sorted({contact.plane.frame for contact in contacts} - {WORLD})
    counts = [counted(count, kind) for kind, count in kinds.items() if count]
    return ", ".join([*counts, *([f"planes on {', '.join(carriers)}"] if carriers else [])])


def _sensors(scene: Scene) -> str:
    """Imperfections of the sensors, as text."""
    if (sensors := scene.sensors) is None:
        return ""
    sensed = {"position": sensors.position, "velocity": sensors.velocity, "effort": sensors.effort}
    imperfect = ", ".join(name for name, part in sensed.items() if part.model_fields_set)
    return "; ".join([*([f"of {imperfect}"] if imperfect else []), *_line(sensors)]) or "perfect"


def _late(scene: Scene) -> str:
    return "" if scene.commands is None else "; ".join(_line(scene.commands))


def _line(line: Line) -> list[str]:
    latest = f" to {1e3 * (line.delay + line.jitter):g}" if line.jitter else ""
    delay = [f"{1e3 * line.delay:g}{latest} ms late"]
    loss = [f"{100.0 * line.loss:g} % lost"]
    return (delay if line.delay or line.jitter else []) + (loss if line.loss else [])


def _law_part(kind: type[FrictionLaw], laws: tuple[StatefulLaw, ...]) -> Part:
    summaries = [law.summary for law in laws if isinstance(law, kind)]
    return _part(kind.title, summaries, "".join(summaries), kind.absent)


def _springs(model: ArmModel) -> str:
    """Numbers of springs by kind, for display."""
    springs = model.springs
    joints = np.count_nonzero(springs.of_joints)
    numbers = {"of joints": joints, "between points": len(springs.points)}
    return ", ".join(f"{count} {kind}" for kind, count in numbers.items() if count)


def _by_speed(model: ArmModel) -> str:
    """Sizes of the tables of friction by speed, for display."""
    tables = [table for table in model.friction.tables if table]
    rows = sum(len(table.moving) for table in tables)
    return f"{_at(tables)}, {counted(rows, 'row')} of speeds" if tables else ""


def _at(values: Any) -> str:
    """At how many joints there is a value, for display."""
    return counted(sum(map(bool, values)), "joint")
