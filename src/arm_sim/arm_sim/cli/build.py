# SPDX-License-Identifier: Apache-2.0
"""``./arm build``: compile scenes for machines without a compiler."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import chain, product
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import click

from arm_dynamics.codegen.processor import NATIVE, TARGETS
from arm_sim.cli.arguments import Json, Scene
from arm_sim.cli.command import command
from arm_sim.cli.output import to_json

if TYPE_CHECKING:
    from arm_dynamics import Dynamics
    from arm_sim import Simulator

# What is compiled, by name, each with the function that compiles it
Parts = Iterator[tuple[str, Callable[[], object]]]


@command(
    "./arm build my_scene.yaml --out compiled",
    "./arm build my_scene.yaml --out compiled --processor x86-64-v3",
    "./arm build one.yaml other.yaml --out compiled --dt 0.0005 --batches",
    "./arm build panda --out compiled --controllers --task-frame panda_hand",
    "./arm build panda --out compiled --nodes",
    "ARM_CACHE=compiled ./arm sim panda",
)
def build(
    scenes: Annotated[tuple[Scene, ...], "SCENE..."],
    *,
    out: Annotated[Path, "--out DIR"],
    integrator: str | None = None,
    dt: float | None = None,
    tolerance: float | None = None,
    processor: Annotated[str, click.Choice(TARGETS)] = NATIVE,
    controllers: bool = False,
    task_frame: Annotated[str | None, "--task-frame FRAME"] = None,
    task_axes: Annotated[str | None, "--task-axes AXES"] = None,
    batches: bool = False,
    derivatives: bool = False,
    nodes: bool = False,
    as_json: Json = False,
) -> None:
    """Compile what SCENEs need into DIR, for machines without a compiler.

    There, with the same version of the suite, ARM_CACHE=DIR makes every command and node run the
    compiled code; ARM_CACHE may list several folders, separated by colons. Each SCENE is
    the name of a bundled scene, or a scene file (YAML) or URDF: a path or a package:// URI.

    Args:
        out: Folder for the compiled code; created if missing.
        integrator: Integration method instead of the scene's, e.g. rk4, dop853.
        dt: Length of a time step in s instead of the scene's.
        tolerance: Control the error inside each time step, e.g. 1e-8.
        processor: Processors to compile for: like this one, or all of a level.
        controllers: Also compile every controller in joint space.
        task_frame: Also compile every controller in task space, for this frame.
        task_axes: Axes that these control, e.g. position, "x z".  [default: pose]
        batches: Also compile batches and rollouts of many arms.
        derivatives: Also compile derivatives and optimization.
        nodes: Also compile the nodes, which do not run without.
        as_json: Print JSON at the end.
    """
    if task_axes and not task_frame:
        raise click.UsageError("--task-axes is allowed with --task-frame only")
    from arm_dynamics.codegen.compiled_scenes import make_folder
    from arm_sim import Simulator

    make_folder(out)
    for scene in scenes:
        name = Path(scene).name
        with _into(out, name, "simulator step", processor):
            simulator = Simulator(scene, integrator, dt, tolerance, "native")
        parts = [_always(simulator)]
        if batches:
            parts.append(_of_batches(simulator))
        if controllers or task_frame:
            parts.append(_of_controllers(simulator, controllers, task_frame, task_axes or "pose"))
        if derivatives:
            parts.append(_of_derivatives(simulator))
        if nodes:
            parts.append(_of_nodes(simulator))
        for part, work in chain(*parts):
            with _into(out, name, part, processor):
                work()
    for part, work in _of_all_nodes() if nodes else ():
        with _into(out, "nodes", part, processor):
            work()
    sizes = [entry.stat().st_size for entry in out.glob("*.so")]
    if as_json:
        click.echo(to_json({"folder": out, "libraries": len(sizes), "bytes": sum(sizes)}))
    else:
        click.echo(f"{out}: {len(sizes)} libraries, {sum(sizes) / 1e6:.1f} MB")


@contextmanager
def _into(out: Path, scene: str, part: str, processor: str) -> Iterator[None]:
    """Report a part of a scene on one line while it is compiled into a folder."""
    from arm_dynamics.codegen.compiler import Destination, building_into

    click.echo(f"{scene}: {part} ", nl=False, err=True)
    start, outcome = perf_counter(), "failed"
    try:
        with building_into(Destination(out, scene, part, processor)):
            yield
        outcome = f"{perf_counter() - start:.1f} s"
    finally:
        click.echo(f"({outcome})", err=True)


def _always(simulator: Simulator) -> Parts:
    """Parts that any scene may need, each with the function that compiles it."""
    from arm_dynamics.control import make_controller, preparation

    compiled = simulator.arm.compiled
    if compiled.energy_account.may_need_repeats:
        yield "energy account", compiled.energy_account.prepare
    yield "check by a second run", lambda: compiled.repeater.stepper
    control = make_controller("computed_torque", _controlled(simulator))
    if compile_law := preparation(control):
        yield "computed torque", compile_law


def _of_batches(simulator: Simulator) -> Parts:
    """Compiled terms of many states, and rollouts: names, and functions that compile them."""
    import numpy as np

    from arm_dynamics.terms.evaluator import MANY
    from arm_dynamics.terms.table import FRICTION, TERMS

    q, dynamics = np.tile(simulator.model.q0, (MANY, 1)), simulator.dynamics
    still = np.zeros_like(q)
    for entry in TERMS:
        if not entry.selectors and entry is not FRICTION:  # which takes no code
            arguments = [q if x == "q" else still for x in entry.parameters]
            method = getattr(dynamics, entry.method_name)
            yield f"batches of {entry.title()}", partial(method, *arguments)
    yield "rollouts", lambda: simulator.rollout(q[:1], still[:1], still[:1], 1)


def _controlled(simulator: Simulator) -> Dynamics:
    """The model that controllers of a simulated arm use."""
    from arm_dynamics import ArmModel, Dynamics
    from arm_dynamics.actuation.command_map import rigid_twin

    return Dynamics(ArmModel(rigid_twin(simulator.model.scene)))


def _of_controllers(
    simulator: Simulator, in_joint_space: bool, task_frame: str | None, task_axes: str
) -> Parts:
    """Controllers by name, with each combination of settings that changes their code."""
    from arm_dynamics.control import NAMES, Settings, make_controller, preparation
    from arm_dynamics.control.factory import IN_TASK_SPACE

    task = {"frame": task_frame or "", "axes": task_axes}
    names = [name for name in NAMES if (task_frame if name in IN_TASK_SPACE else in_joint_space)]
    for name, friction, observer, damping in product(names, (False, True), (0.0, 1.0), (0.0, 1.0)):
        options = {"friction": friction, "observer": observer, "damping": damping}
        control = make_controller(name, _controlled(simulator), Settings(**task, **options))
        if compile_law := preparation(control):
            active = (option for option, value in options.items() if value)
            yield ", ".join([name, *active]), compile_law


def _of_derivatives(simulator: Simulator) -> Parts:
    derivatives = simulator.arm.compiled.derivatives
    yield "derivatives of time steps", derivatives.linearizer().prepare
    yield "gradients of rollouts", derivatives.gradients.prepare
    for parts in click.get_current_context().obj:  # of the studies
        yield from parts(simulator)


def _of_nodes(simulator: Simulator) -> Parts:
    """What the loops of the nodes compute of a scene."""
    from arm_dynamics.ros.dynamics.compiled_services import CANDIDATES, code_of
    from arm_sim.ros.drive_torques import DriveTorques

    yield "servo", lambda: simulator.arm.compiled.servo  # for position commands and stops
    if (torques := simulator.arm.plant.torques) is not None:
        yield "torques of drives", lambda: DriveTorques(simulator.arm, torques)
    for service, entries, _ in CANDIDATES:
        if all(entry.compiles(simulator.model) for entry in entries):
            work = partial(code_of, entries, simulator.dynamics)
            yield f"service {service.name.rpartition('/')[2]}", work


def _of_all_nodes() -> Parts:
    """Loops and messages of the nodes, which are the same for all scenes."""
    from arm_dynamics.ros.controller import controller_library as controller
    from arm_dynamics.ros.dynamics import compiled_services
    from arm_dynamics.ros.joint_state import joint_state_library as messages
    from arm_dynamics.trajectory import trajectory_library as trajectory
    from arm_sim.ros import node_library as sim

    # Uncached: what this process has loaded is not necessarily in the folder.
    yield "messages", messages.library.__wrapped__
    yield "controller", controller.library.__wrapped__
    yield "trajectories", trajectory.build_library
    yield "sim", sim.library.__wrapped__
    yield "services", compiled_services.native.__wrapped__
