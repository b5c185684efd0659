# SPDX-License-Identifier: Apache-2.0
"""``./arm build``: compile scenes for machines without a compiler."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import chain, product
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from arm_dynamics.codegen.processor import NATIVE, TARGETS
from arm_sim.cli.completion import SCENE
from arm_sim.cli.output import examples

if TYPE_CHECKING:
    from arm_dynamics import Dynamics
    from arm_sim import Simulator

    Further = Callable[[Simulator], Iterator[tuple[str, Callable[[], object]]]]


@click.command(
    epilog=examples(
        "./arm build my_scene.yaml --out compiled",
        "./arm build my_scene.yaml --out compiled --processor x86-64-v3",
        "./arm build one.yaml other.yaml --out compiled --dt 0.0005 --batches",
        "./arm build panda --out compiled --controllers --task-frame panda_hand",
        "./arm build panda --out compiled --nodes",
        "ARM_CACHE=compiled ./arm sim panda",
    )
)
@click.argument("scenes", metavar="SCENE...", type=SCENE, nargs=-1, required=True)
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR",
              help="Folder for the compiled code; created if missing.")  # fmt: skip
@click.option("--integrator", help="Integration method instead of the scene's, e.g. rk4, dop853.")
@click.option("--dt", type=float, help="Length of a time step in s instead of the scene's.")
@click.option(
    "--tolerance", type=float, help="Control the error inside each time step, e.g. 1e-8."
)
@click.option("--processor", type=click.Choice(TARGETS), default=NATIVE, show_default=True,
              help="Processors to compile for: like this one, or all of a level.")  # fmt: skip
@click.option("--controllers", is_flag=True, help="Also compile every controller in joint space.")
@click.option("--task-frame", metavar="FRAME",
              help="Also compile every controller in task space, for this frame.")  # fmt: skip
@click.option("--task-axes", default="pose", show_default=True, metavar="AXES",
              help='Axes that these control, e.g. position, "x z".')  # fmt: skip
@click.option("--batches", is_flag=True, help="Also compile batches and rollouts of many arms.")
@click.option("--derivatives", is_flag=True, help="Also compile derivatives and optimization.")
@click.option("--nodes", is_flag=True,
              help="Also compile the nodes, which do not run without.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print JSON at the end.")
def build(
    scenes: tuple[str, ...], out: Path, integrator: str | None, dt: float | None,
    tolerance: float | None, processor: str, controllers: bool, task_frame: str | None,
    task_axes: str, batches: bool, derivatives: bool, nodes: bool, as_json: bool,
) -> None:  # fmt: skip
    """Compile what SCENEs need into DIR, for machines without a compiler.

    There, with the same version of the suite, ARM_CACHE=DIR makes every command and node run the
    compiled code; ARM_CACHE may list several folders, separated by colons. Each SCENE is
    the name of a ready scene, or a scene file (YAML) or URDF: a path or a package:// URI.
    """
    context = click.get_current_context()
    of_axes, further = context.get_parameter_source("task_axes"), context.obj or ()
    if not task_frame and of_axes is not ParameterSource.DEFAULT:
        raise click.UsageError("--task-axes is allowed with --task-frame only")
    from arm_dynamics.codegen.compiled_scenes import make_folder
    from arm_sim import Simulator

    make_folder(out)
    for scene in scenes:
        name = Path(scene).name
        with _into(out, name, "simulator step", processor):
            simulator = Simulator(scene, integrator, dt, tolerance, "native")
        parts = (
            _other_parts(simulator, batches),
            _of_controllers(simulator, controllers, task_frame, task_axes),
            _of_derivatives(simulator, derivatives, further),
            _of_nodes(simulator, nodes),
        )
        for part, work in chain(*parts):
            with _into(out, name, part, processor):
                work()
    for part, work in _of_all_nodes() if nodes else ():
        with _into(out, "nodes", part, processor):
            work()
    _show(out, as_json)


def _show(out: Path, as_json: bool) -> None:
    """What is in the folder."""
    entries = list(out.glob("*.so"))
    size = sum(entry.stat().st_size for entry in entries)
    if as_json:
        click.echo(json.dumps({"folder": str(out), "libraries": len(entries), "bytes": size}))
    else:
        click.echo(f"{out}: {len(entries)} libraries, {size / 1e6:.1f} MB")


@contextmanager
def _into(out: Path, scene: str, part: str, processor: str) -> Iterator[None]:
    from arm_dynamics.codegen.compiler import Destination, building_into

    click.echo(f"{scene}: {part} ", nl=False, err=True)
    start, outcome = perf_counter(), "failed"
    try:
        with building_into(Destination(out, scene, part, processor)):
            yield
        outcome = f"{perf_counter() - start:.1f} s"
    finally:
        click.echo(f"({outcome})", err=True)


def _other_parts(
    simulator: Simulator, batches: bool
) -> Iterator[tuple[str, Callable[[], object]]]:
    """Other parts that a scene may need, each with the function that compiles it."""
    import numpy as np

    from arm_dynamics.control import make_controller, preparation
    from arm_dynamics.terms.answers import MANY
    from arm_dynamics.terms.table import FRICTION, TERMS

    if simulator.arm.compiled.energy_account.may_make_ticks_again:
        yield "energy account", simulator.arm.compiled.energy_account.prepare
    yield "check by a second run", lambda: simulator.arm.compiled.witness.stepper
    if job := preparation(make_controller("computed_torque", _controlled(simulator))):
        yield "computed torque", job
    if not batches:
        return
    q, dynamics = np.tile(simulator.model.q0, (MANY, 1)), simulator.dynamics
    still = np.zeros_like(q)
    for entry in TERMS:
        if not entry.which and entry is not FRICTION:  # which takes no code
            given = [q if x == "q" else still for x in entry.asks]
            yield f"batches of {entry.title()}", partial(getattr(dynamics, entry.asked), *given)
    yield "rollouts", lambda: simulator.rollout(q[:1], still[:1], still[:1], 1)


def _controlled(simulator: Simulator) -> Dynamics:
    """The model that controllers of a simulated arm use."""
    from arm_dynamics import ArmModel, Dynamics
    from arm_dynamics.actuation.command_map import rigid_twin

    return Dynamics(ArmModel(rigid_twin(simulator.model.scene)))


def _of_controllers(
    simulator: Simulator, wanted: bool, task_frame: str | None, task_axes: str
) -> Iterator[tuple[str, Callable[[], object]]]:
    """Controllers by name, with each combination of settings that changes their code."""
    from arm_dynamics.control import NAMES, Settings, make_controller, preparation
    from arm_dynamics.control.factory import IN_TASK_SPACE

    task = {"frame": task_frame or "", "axes": task_axes}
    names = [name for name in NAMES if (task_frame if name in IN_TASK_SPACE else wanted)]
    for name, *used in product(names, (False, True), (0.0, 1.0), (0.0, 1.0)):
        more = dict(zip(("friction", "observer", "damping"), used, strict=True))
        control = make_controller(name, _controlled(simulator), Settings(**task, **more))
        if job := preparation(control):
            yield ", ".join([name, *(key for key, value in more.items() if value)]), job


def _of_derivatives(
    simulator: Simulator, wanted: bool, further: Sequence[Further]
) -> Iterator[tuple[str, Callable[[], object]]]:
    if not wanted:
        return
    derivatives = simulator.arm.compiled.derivatives
    yield "derivatives of ticks", derivatives.linearizer().prepare
    yield "gradients of rollouts", derivatives.gradients.prepare
    for parts in further:
        yield from parts(simulator)


def _of_nodes(simulator: Simulator, wanted: bool) -> Iterator[tuple[str, Callable[[], object]]]:
    """What the loops of the nodes compute of a scene."""
    if not wanted:
        return
    from arm_dynamics.ros.dynamics import COMPILED, code_of
    from arm_sim.ros.drive_torques import DriveTorques

    yield "servo", lambda: simulator.arm.compiled.servo  # for position commands and stops
    if simulator.arm.plant.torques is not None:
        yield "torques of drives", lambda: DriveTorques(simulator.arm)
    for service, entries, _ in COMPILED:
        if all(entry.compiles(simulator.model) for entry in entries):
            work = partial(code_of, entries, simulator.dynamics)
            yield f"service {service.name.rpartition('/')[2]}", work


def _of_all_nodes() -> Iterator[tuple[str, Callable[[], object]]]:
    """Loops and messages of the nodes, which are the same for all scenes."""
    from arm_dynamics.ros.controller import controller_library as controller
    from arm_dynamics.ros.dynamics import compiled_services
    from arm_dynamics.ros.joint_state import joint_state_library as messages
    from arm_dynamics.trajectory import trajectory_library as trajectory
    from arm_sim.ros import node_library as sim

    # Uncached: what this process has loaded is not necessarily in the folder.
    yield "messages", messages.library.__wrapped__
    yield "controller", controller.library.__wrapped__
    yield "trajectories", trajectory.compiled
    yield "sim", sim.library.__wrapped__
    yield "services", compiled_services.native.__wrapped__
