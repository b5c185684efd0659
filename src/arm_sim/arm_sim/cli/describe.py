# SPDX-License-Identifier: Apache-2.0
"""``./arm describe``: what a scene holds, what a tick of it computes, and what that costs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from arm_dynamics import ArmModel
    from rich.console import Console

    from arm_sim import Simulator


@click.command()
@click.argument("scene")
@click.option("--integrator", help="Integration method instead of the scene's, e.g. rk4, dop853.")
@click.option("--dt", type=float, help="Length of a tick in s instead of the scene's.")
@click.option("--tolerance", type=float, help="Control the error inside each tick, e.g. 1e-8.")
def describe(
    scene: str, integrator: str | None, dt: float | None, tolerance: float | None
) -> None:
    """Show the joints of SCENE, what a tick of it computes and skips, and what that costs.

    SCENE is a scene file (YAML) or a URDF: a path or a package:// URI. The time is measured now,
    on this machine.

    \b
    Examples:
      ./arm describe package://example-robot-data/robots/panda_description/urdf/panda.urdf
      ./arm describe my_scene.yaml --integrator euler --dt 0.0005
      ./arm describe my_scene.yaml --tolerance 1e-8
    """
    from arm_sim import Simulator
    from arm_sim.cli.output import console

    simulator = Simulator(scene, integrator=integrator, dt=dt, tolerance=tolerance)
    out = console()
    _show_robot(out, simulator.model)
    _show_joints(out, simulator.model)
    _show_physics(out, simulator)
    _show_cost(out, simulator)


def _show_robot(out: Console, model: ArmModel) -> None:
    gravity = ", ".join(f"{g:g}" for g in model.scene.gravity)
    joints = f"{model.n} joint{'s' if model.n > 1 else ''}"
    out.print(
        f"\n[bold]{model.pin.name}[/]: {joints}, {model.total_mass:.6g} kg moving, "
        f"gravity \\[{gravity}] m/s²"
    )
    if model.scene.robot.lock:
        out.print(f"held fast: {', '.join(model.scene.robot.lock)}")


def _show_joints(out: Console, model: ArmModel) -> None:
    from arm_sim.cli.output import limit, number, table

    columns = (
        "joint", "type", "start", "lower", "upper", "speed limit", "effort limit",
        "viscous friction", "Coulomb friction", "armature",
    )  # fmt: skip
    rows = [
        (
            name, model.joint_types[i], number(model.q0[i], 5),
            limit(model.position_lower[i], 5), limit(model.position_upper[i], 5),
            limit(model.velocity_limit[i], 5), limit(model.effort_limit[i], 5),
            number(model.viscous[i], 5), number(model.coulomb[i], 5), number(model.armature[i], 5),
        )
        for i, name in enumerate(model.joint_names)
    ]  # fmt: skip
    out.print(table("", columns, rows))
    out.print(_units(set(model.joint_types)), style="dim")


def _units(types: set[str]) -> str:
    turning = "rad, rad/s, N m, viscous friction N m s/rad, armature kg m²"
    sliding = "m, m/s, N, viscous friction N s/m, armature kg"
    if types == {"prismatic"}:
        return f"units: {sliding}"
    return f"units: {turning}" + (f"; sliding joints: {sliding}" if "prismatic" in types else "")


def _show_physics(out: Console, simulator: Simulator) -> None:
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    grid = Table(title="What a tick computes", title_justify="left", title_style="bold",
                 box=box.SIMPLE_HEAD, show_header=False)  # fmt: skip
    parts = simulator.plan.parts
    for part in sorted(parts, key=lambda part: not part.on):
        word = "[green]computed[/]" if part.on else "[dim]skipped[/]"
        grid.add_row(word, part.name, escape(part.why))
    out.print()
    out.print(grid)


def _show_cost(out: Console, simulator: Simulator) -> None:
    from rich.markup import escape

    plan, choice = simulator.plan, simulator.choice
    method, microseconds = choice.method, plan.nanoseconds / 1e3
    control = "" if choice.tolerance is None else f", error controlled to {choice.tolerance:g}"
    step = "sub-step" if choice.tolerance else "tick"
    faster = simulator.dt * 1e6 / microseconds
    for name, value in (
        ("integrator", f"{method.name}, order {method.order}, {simulator.dt:g} s{control} ({plan.reason})"),
        ("algorithm", plan.algorithm),
        ("runs on", plan.backend),
        ("operations", f"{plan.operations} in a {step}, {plan.evaluation} in one evaluation"),
        ("time", f"{microseconds:.2f} µs for a tick, measured now: {faster:,.0f} times faster than real time"),
    ):
        out.print(f"  [bold]{name:<11}[/]{escape(value)}")
    out.print()
