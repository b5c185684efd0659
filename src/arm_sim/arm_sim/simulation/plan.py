# SPDX-License-Identifier: Apache-2.0
"""The plan of a tick: the parts it computes and skips, and their cost."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cached_property
from textwrap import fill
from typing import Any

import casadi as ca
import numpy as np

from arm_dynamics import ArmModel
from arm_dynamics.actuation.internal_state import FrictionLaw, StatefulLaw
from arm_dynamics.actuation.joint_laws import FRICTION
from arm_dynamics.attributes import sealed
from arm_dynamics.codegen.kernel import Kernel, operations
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.exceptions import counted
from arm_dynamics.model.stops import Stops
from arm_dynamics.scene import Scene
from arm_dynamics.scene.constraint import WORLD
from arm_dynamics.scene.imperfections import Line
from arm_sim.integrators.selection import Choice
from arm_sim.plant.plant import Plant
from arm_sim.stepping.stepper import Stepper

# What is timed in one run, and runs of which the fastest counts: of ticks, and of each law
TIMED_TICKS, REPEATS = 200, 5
LAW_EVALUATIONS, LAW_REPEATS = 1000, 20


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


@dataclass(frozen=True)
class LawCost:
    """A law and the cost of one evaluation.

    Attributes:
        title: Name of the law.
        states: Its states, as text.
        operations: Arithmetic operations of one evaluation; a step takes several.
        nanoseconds: Time of one evaluation in [ns], measured.
    """

    title: str
    states: tuple[str, ...]
    operations: int
    nanoseconds: float

    def __str__(self) -> str:
        """One line of text."""
        cost = f"{counted(self.operations, 'operation')}, {self.nanoseconds:.0f} ns per evaluation"
        return f"{self.title}: {counted(len(self.states), 'state')}, {cost}"


@sealed
class Plan:
    """Parts that are computed and skipped.

    Attributes:
        parts: The physics, computed and skipped, and why.
        operations: Arithmetic operations of one tick (of one sub-step with error control).
        apart: The same while all joints move and nothing touches.
        evaluation: Operations of one evaluation of the acceleration.
        algorithm: How accelerations are computed.
        integrator: Name of the method.
        reason: Why this method was selected.
        backend: What executes the code.
    """

    def __init__(self, plant: Plant, choice: Choice, stepper: Stepper) -> None:
        self._plant, self._choice, self._stepper = plant, choice, stepper
        self.parts = _parts(plant)
        self.operations, self.apart = stepper.tick_operations, stepper.moving_operations
        mechanics = (plant.free or plant).mechanics
        self.evaluation, self.algorithm = operations(mechanics.acceleration), mechanics.method
        self.integrator = choice.method.name
        self.reason = choice.reason
        self.backend = stepper.kernel.backend

    @cached_property
    def nanoseconds(self) -> float:
        """Time of one tick in [ns], measured now.

        The minimum of several runs from the initial state without torque.
        """
        model, nx = self._plant.model, self._plant.nx
        trace, effort = np.empty((TIMED_TICKS, nx)), np.empty((TIMED_TICKS, model.n))
        notes, best = np.empty((TIMED_TICKS, 2)), np.inf
        for _ in range(REPEATS):
            self._stepper.restart()
            x = np.concatenate([model.q0, model.v0, self._plant.laws.initial(model.q0, model.v0)])
            start = time.perf_counter_ns()
            ticks = self._stepper.advance(x, np.zeros(model.n), trace, effort, notes)
            best = min(best, (time.perf_counter_ns() - start) / max(1, ticks))
        self._stepper.restart()
        return best

    @cached_property
    def laws(self) -> tuple[LawCost, ...]:
        """States and measured cost of each law that has states or replaces the command."""
        backend = "auto" if self._stepper.kernel.native else "vm"
        return tuple(_cost_of(law, self._plant.model.n, backend) for law in self._plant.laws.laws)

    def __repr__(self) -> str:
        """Readable lines."""
        choice = self._choice
        control = "" if choice.tolerance is None else f", tolerance {choice.tolerance:g}"
        per = "sub-step" if choice.tolerance is not None else "time step"
        method = f"{self.integrator} (order {choice.method.order}), dt {choice.dt:g} s{control}"
        apart = f" ({self.apart} in free motion)" if self.apart < self.operations else ""
        cost = f"{self.operations} operations per {per}{apart}, {self.evaluation} per evaluation"
        lines = [
            f"integrator  {method}: {self.reason}",
            f"accuracy    {self._plant.model.scene.sim.accuracy:g} of 1 + |x|, for each second",
            f"algorithm   {self.algorithm}",
            f"runs on     {self.backend}",
            f"cost        {cost}",
        ]
        lines += [f"            {law}" for law in self.laws]
        lines += [f"computed    {part.name}: {part.why}" for part in self.parts if part.on]
        off = ", ".join(part.name for part in self.parts if not part.on) or "none"
        skipped = f"skipped     {off}; plan.parts says why"
        lines.append(fill(skipped, 98, subsequent_indent=" " * 12))
        return "\n".join(lines)


def _parts(plant: Plant) -> tuple[Part, ...]:
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
    held = f"{counted(rows, 'row')}, {counted(free, 'degree')} of freedom"
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
        _part("constraints", rows, held, "none"),
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
    late = [f"{1e3 * line.delay:g}{latest} ms late"]
    lost = [f"{100.0 * line.loss:g} % lost"]
    return (late if line.delay or line.jitter else []) + (lost if line.loss else [])


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


@one_at_a_time
def _cost_of(law: StatefulLaw, n: int, backend: str) -> LawCost:
    """Measure a law, many evaluations in one call."""
    sizes = {"q": n, "v": n, "z": len(law.states), "u": n}
    symbols = [ca.SX.sym(name, size) for name, size in sizes.items()]
    flow = law.equations(*symbols)
    results = [ca.densify(flow.torque), ca.densify(flow.slope)]
    once = ca.Function("law", symbols, results, {"cse": True})
    many = once.map("laws", "serial", LAW_EVALUATIONS, [], [], {})
    call, best = Kernel([many], backend).call("laws"), np.inf
    for place in call.inputs:
        place[...] = 0.1
    for _ in range(LAW_REPEATS):
        start = time.perf_counter_ns()
        call.run()
        best = min(best, (time.perf_counter_ns() - start) / LAW_EVALUATIONS)
    return LawCost(law.title, tuple(state.name for state in law.states), operations(once), best)
