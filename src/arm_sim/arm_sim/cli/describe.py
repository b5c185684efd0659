# SPDX-License-Identifier: Apache-2.0
"""``./arm describe``: content of a scene, computations of a tick, and their cost."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from arm_sim.cli.arguments import Json, Scene
from arm_sim.cli.command import command
from arm_sim.cli.output import console, facts, limit, number, say, table, to_json, waiting

if TYPE_CHECKING:
    from rich.console import Console

    from arm_dynamics import ArmModel
    from arm_dynamics.arrays import Array
    from arm_sim import Simulator


@command(
    "./arm describe panda",
    "./arm describe package://example-robot-data/robots/panda_description/urdf/panda.urdf",
    "./arm describe my_scene.yaml --integrator euler --dt 0.0005",
    "./arm describe my_scene.yaml --tolerance 1e-8",
)
def describe(
    scene: Scene,
    *,
    integrator: str | None = None,
    dt: float | None = None,
    tolerance: float | None = None,
    details: bool = False,
    as_json: Json = False,
) -> None:
    """Show the joints of SCENE, what is computed or skipped, and the cost of a time step.

    SCENE is the name of a bundled scene, or a scene file (YAML) or URDF: a path or a package://
    URI. The time is measured on this machine.

    Args:
        integrator: Integration method, instead of the scene's, e.g. rk4, dop853.
        dt: Length of a time step in s, instead of the scene's.
        tolerance: Control the error inside each time step, e.g. 1e-8.
        details: Also show the comment at the top of the file, and why each part is skipped.
    """
    from arm_dynamics import ModelError
    from arm_dynamics.dynamics.arm_models import arm_model
    from arm_dynamics.model.regularity import MASSLESS
    from arm_dynamics.scene.files import find_scene
    from arm_dynamics.scene.load import naming
    from arm_sim import Simulator

    simulator, why = None, ""
    with waiting(f"building {scene}"):
        model = arm_model(scene)
        try:
            with naming(scene):
                simulator = Simulator(model, integrator=integrator, dt=dt, tolerance=tolerance)
        except ModelError as error:  # some joint moves no mass, but all can be listed
            why = MASSLESS if model.massless else str(error)
            motion = {"not_simulated": why}
        else:
            motion = _motion(simulator)
    if as_json:
        click.echo(to_json(_robot(model) | motion, indent=1))
        return
    out = console()
    if details and simulator:  # the comment that begins a file, such as where its numbers are from
        text = find_scene(scene, Path.cwd()).read_text(encoding="utf-8", errors="replace")
        lines = takewhile(lambda line: line.startswith("#"), text.splitlines())
        if comment := " ".join(line.lstrip("# ") for line in lines):
            out.print(f"\n{comment}", style="dim", markup=False, highlight=False)
    _show_robot(out, model)
    _show_joints(out, model)
    if simulator:
        _show_physics(out, simulator, details)
    else:
        _remark(out, "not simulated:", why)


def _robot(model: ArmModel) -> dict[str, Any]:
    """The robot for --json; null for no limit."""
    columns = _columns(model)
    joints = [
        {"name": name, "type": model.joint_types[i], "command_unit": model.command_unit[i]}
        | {column.key: column.values[i] for column in columns}
        for i, name in enumerate(model.joint_names)
    ]
    return {
        "robot": model.pin.name, "mass": model.total_mass, "gravity": model.scene.gravity,
        "locked": model.scene.robot.lock,
        "links": {name: body.mass for name, body in model.scene.links.items()},
        "placeholders": dict.fromkeys(model.placeholder_limits, "effort 1"), "joints": joints,
        "frames": model.frame_names,
    }  # fmt: skip


class _Column(NamedTuple):
    """Numbers of the joints."""

    key: str  # in JSON
    heading: str
    values: Array
    write: Callable[[float, int], str] = number
    optional: bool = False  # left out of the table if all are zero


def _columns(model: ArmModel) -> list[_Column]:
    """Quantities of the joints in the table, in their order."""
    friction = model.friction
    return [
        _Column("start", "start", model.q0),
        _Column("lower", "lower", model.position_lower, limit),
        _Column("upper", "upper", model.position_upper, limit),
        _Column("velocity_limit", "speed\nlimit", model.velocity_limit, limit),
        _Column("effort_limit", "effort\nlimit", model.effort_limit, limit),
        _Column("viscous", "viscous\nfriction", model.viscous, optional=True),
        _Column("coulomb", "Coulomb\nfriction", friction.coulomb.mean, optional=True),
        _Column("armature", "armature", model.armature, optional=True),
        _Column("static", "static\nfriction", friction.static.mean, optional=True),
    ]


def _motion(simulator: Simulator) -> dict[str, Any]:
    """What computes its motion, for --json."""
    plan, choice = simulator.plan, simulator.choice
    return {
        "dt": choice.dt, "integrator": choice.method.name, "tolerance": choice.tolerance,
        "reason": plan.reason, "algorithm": plan.algorithm, "backend": plan.backend,
        "operations": plan.operations, "nanoseconds": plan.nanoseconds,
        "computed": {part.name: part.why for part in plan.parts if part.on},
        "skipped": {part.name: part.why for part in plan.parts if not part.on},
    }  # fmt: skip


def _remark(out: Console, title: str, text: str) -> None:
    from rich.text import Text

    out.print(Text.assemble((title, "yellow"), f" {text}"))


def _show_robot(out: Console, model: ArmModel) -> None:
    from rich.text import Text

    scene = model.scene
    gravity = ", ".join(f"{g:g}" for g in scene.gravity)
    joints = f"{model.n} joint{'s' if model.n > 1 else ''}"
    about = f": {joints}, {model.total_mass:.6g} kg moving, gravity [{gravity}] m/s²"
    out.print(Text.assemble("\n", (model.pin.name, "bold"), about))
    if scene.robot.lock:
        say(f"locked: {', '.join(scene.robot.lock)}")
    if scene.links:
        masses = ", ".join(f"{name} {body.mass:g} kg" for name, body in scene.links.items())
        say(f"inertias from the scene: {masses}")
    for link, trouble in model.doubtful.items():
        out.print(f"link '{link}': {trouble}", style="yellow", markup=False)


def _show_joints(out: Console, model: ArmModel) -> None:
    import numpy as np

    names, friction, columns = model.joint_names, model.friction, _columns(model)
    if (friction.static.mean == friction.coulomb.mean).all():
        columns = [column for column in columns if column.key != "static"]
    absent = [x.heading for x in columns if x.optional and not x.values.any()]
    columns = [column for column in columns if column.heading not in absent]
    rows = [
        (name, model.joint_types[i], *(x.write(x.values[i], 4) for x in columns))
        for i, name in enumerate(names)
    ]
    say(table(("joint", "type", *(x.heading for x in columns)), rows, text=(0, 1)))
    if absent:
        out.print(f"all zero: {', '.join(absent)}".replace("\n", " "), style="dim")
    turning = "rad, rad/s, N m, viscous friction N m s/rad, armature kg m²"
    sliding = "m, m/s, N, viscous friction N s/m, armature kg"
    if not model.turning.all():
        turning = sliding if not model.turning.any() else f"{turning}; sliding joints: {sliding}"
    out.print(f"units: {turning}", style="dim")
    if model.placeholder_limits:
        named = ", ".join(f"{name} (effort 1)" for name in model.placeholder_limits)
        _remark(out, "limits that are probably placeholders:",
                f"{named}; a scene's joints.NAME.limits gives others")  # fmt: skip
    _show_drives(model)
    _show_springs(model)
    if model.stops.contradicting:
        _remark(out, "limits left out:", f"{', '.join(model.stops.contradicting)}; with those of "
                "the joints that they follow they allow no motion")  # fmt: skip
    outside = (model.q0 < model.position_lower) | (model.position_upper < model.q0)
    at_stop = model.stops.touched(model.q0) & ~outside
    for place, joints in {"outside its limits": outside, "at its stop": at_stop}.items():
        if joints.any():
            named = ", ".join(np.array(names)[joints])
            _remark(out, f"starts {place}:", f"{named}; a scene's initial.position changes that")


def _show_drives(model: ArmModel) -> None:
    if not any(model.drives):
        return
    columns = ("joint", "command", "at most", "gear\nratio", "rotor inertia\nat the joint",
               "efficiency", "transmission")  # fmt: skip
    rows, remarks = [], []
    for i, (name, drive) in enumerate(zip(model.joint_names, model.drives, strict=True)):
        if drive is None:
            continue
        rows.append((
            name, f"{drive.motor.command} [{model.command_unit[i]}]",
            limit(model.command_limit[i], 4), number(drive.motor.gear_ratio, 4),
            number(drive.rotor_inertia, 4), number(drive.motor.efficiency, 4), drive.transmission,
        ))  # fmt: skip
        if math.isfinite(drive.overspeed):
            unit = model.units("rad/s", "m/s")[i]
            remarks.append(
                f"{name}: beyond {drive.overspeed:.4g} {unit} the current limit holds, and the "
                "voltage limit cannot"
            )
    say(table(columns, rows, text=(0, 1, 6)), *remarks)


def _show_springs(model: ArmModel) -> None:
    from arm_dynamics.scene.spring import spring_name

    springs, rows = model.springs, []
    if not springs:
        return
    for i, name in enumerate(list(model.pin.names)[1:]):
        if springs.of_joints[i]:
            stiffness = number(springs.stiffness[i], 4) if springs.tables[i] is None else "table"
            numbers = number(springs.rest[i], 4), number(springs.damping[i], 4)
            rows.append((name, "joint", stiffness, *numbers))
    for i, spring in enumerate(springs.points):
        kind = "cord, " if spring.tension_only else ""
        preload = f", {spring.force:g} N" if spring.force else ""
        numbers = (spring.stiffness, spring.rest_length, spring.damping)
        rows.append((spring_name(spring, i), f"{kind}{' to '.join(spring.frames)}{preload}",
                     *(number(x, 4) for x in numbers)))  # fmt: skip
    columns = ("spring", "of", "stiffness", "at rest", "damping")
    say(table(columns, rows, text=(0, 1)))


def _show_physics(out: Console, simulator: Simulator, details: bool) -> None:
    plan, choice = simulator.plan, simulator.choice
    parts = sorted(plan.parts, key=lambda part: not part.on)
    rows = [("computed" if p.on else "skipped", p.name, p.why) for p in parts if p.on or details]
    say(table(("in a time step", "", ""), rows, text=(0, 1, 2)))
    if not details:
        skipped = ", ".join(part.name for part in parts if not part.on)
        out.print(f" skipped    {skipped}; --details says why", style="dim")
        out.print()
    method, microseconds = choice.method, plan.nanoseconds / 1e3
    control = "" if choice.tolerance is None else f", error controlled to {choice.tolerance:g}"
    step = "sub-step" if choice.tolerance else "time step"
    how = f"{method.name}, order {method.order}, {simulator.dt:g} s{control}"
    faster = f"{simulator.dt * 1e6 / microseconds:,.0f} times faster than real time"
    out.print(facts([
        ("integrator", f"{how} ({plan.reason})"),
        ("algorithm", plan.algorithm),
        ("runs on", plan.backend),
        ("operations", f"{plan.operations} in a {step}, {plan.evaluation} in one evaluation"),
        ("time", f"{microseconds:.2f} µs for a time step, measured now; {faster}"),
    ]))  # fmt: skip
    out.print()
