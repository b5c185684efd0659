# SPDX-License-Identifier: Apache-2.0
"""``./arm call``: the services of running nodes, without the ros2 command line."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from arm_sim.cli.output import examples
from arm_sim.cli.vectors import HOW, VectorType

TERMS = {"inertia": 1, "coriolis": 2, "gravity": 4, "friction": 8}
DYNAMICS, SIM = ("/dynamics", "./arm dynamics SCENE"), ("/sim", "./arm sim SCENE")

VECTOR = VectorType()
Command = Callable[..., Any]


@click.group(
    epilog=examples(
        './arm call inverse-dynamics --position "0 -0.8 0 -2.4 0 1.6 0.8"',
        './arm call inverse-dynamics --position "panda_joint4=-2.4" --terms gravity',
        "./arm call model-info --json",
    )
)
def call() -> None:
    """Call a service of a running node.

    Vectors are in the model's order, or by joint name; joints that are not named are zero. Start
    nodes by ./arm dynamics SCENE and ./arm sim SCENE.
    """


def _options(partner: tuple[str, str]) -> Callable[[Command], Command]:
    """Options that every command has."""

    def add(command: Command) -> Command:
        for option in (
            click.option("--json", "as_json", is_flag=True, help="Print JSON."),
            click.option("--timeout", default=5.0, show_default=True, type=click.FloatRange(0.1),
                         help="How long to wait, in s."),
            click.option("--node", default=partner[0], show_default=True, help="Node to ask."),
        ):  # fmt: skip
            command = option(command)
        return command

    return add


def _vector(name: str, what: str, required: bool = False) -> Callable[[Command], Command]:
    rest = f"; {HOW}." if required else "; zero when not given."
    return click.option(f"--{name}", type=VECTOR, required=required, help=what + rest)


_joints = click.option(
    "--joints", default="", help='Order of the vectors, e.g. "elbow shoulder"; else the model\'s.'
)


@call.command(
    "inverse-dynamics",
    short_help="Torques that produce a motion.",
    epilog=examples(
        './arm call inverse-dynamics --position "panda_joint2=-0.8 panda_joint4=-2.4"',
    ),
)
@_vector("position", "Joint positions in rad or m", required=True)
@_vector("velocity", "Joint velocities")
@_vector("acceleration", "Joint accelerations")
@click.option("--terms", default="all", show_default=True,
              help="all, or some of inertia,coriolis,gravity,friction.")  # fmt: skip
@_joints
@_options(DYNAMICS)
def inverse_dynamics(terms: str, **given: Any) -> None:
    """Torques that produce a motion: M(q) a + C(q, v) v + G(q) + F(v)."""
    from arm_sim.cli import answers

    answers.inverse_dynamics(terms=_terms(terms), **given)


@call.command(
    "forward-dynamics",
    short_help="Accelerations that torques produce.",
    epilog=examples(
        './arm call forward-dynamics --position "0 -0.8 0 -2.4 0 1.6 0.8"',
    ),
)
@_vector("position", "Joint positions in rad or m", required=True)
@_vector("velocity", "Joint velocities")
@_vector("effort", "Joint torques in N m or N")
@_joints
@_options(DYNAMICS)
def forward_dynamics(**given: Any) -> None:
    """Accelerations that torques produce."""
    from arm_sim.cli import answers

    answers.forward_dynamics(**given)


@call.command(
    "dynamics-terms",
    short_help="Mass matrix, Coriolis matrix, gravity, friction, energies.",
    epilog=examples(
        './arm call dynamics-terms --position "0 -0.8 0 -2.4 0 1.6 0.8" --json',
    ),
)
@_vector("position", "Joint positions in rad or m", required=True)
@_vector("velocity", "Joint velocities")
@_joints
@_options(DYNAMICS)
def dynamics_terms(**given: Any) -> None:
    """Mass matrix, Coriolis matrix, gravity, friction and energies."""
    from arm_sim.cli import answers

    answers.dynamics_terms(**given)


@call.command(
    "task-space",
    short_help="Inertia, gravity, Jacobian and more at a frame.",
    epilog=examples(
        './arm call task-space --frame panda_hand --position "0 -0.8 0 -2.4 0 1.6 0.8"',
        './arm call task-space --frame panda_hand --axes "x y z" --direction "0 0 1" \\',
        '      --position "panda_joint2=-0.8 panda_joint4=-2.4 panda_joint6=1.6"',
    ),
)
@click.option("--frame", required=True, help="A frame that moves; model-info lists them.")
@click.option("--reference", default="local_world_aligned", show_default=True,
              help="Axes and point: local_world_aligned, local or world.")  # fmt: skip
@click.option("--axes", default="pose", show_default=True,
              help='pose, position, orientation, or some of "x y z rx ry rz".')  # fmt: skip
@click.option(
    "--direction", type=VECTOR, help="Also tell the mass felt along it, one number an axis."
)
@_vector("position", "Joint positions in rad or m", required=True)
@_vector("velocity", "Joint velocities")
@_joints
@_options(DYNAMICS)
def task_space(**given: Any) -> None:
    """The equation of motion as seen at a frame: inertia, velocity terms, gravity, Jacobian."""
    from arm_sim.cli import task_answer

    task_answer.task_space(**given)


@call.command(
    "model-info",
    short_help="Joints, limits, frames and mass of the node's arm.",
    epilog=examples(
        "./arm call model-info",
    ),
)
@_options(DYNAMICS)
def model_info(**given: Any) -> None:
    """What the node knows about its arm: joints, limits, frames, mass."""
    from arm_sim.cli import answers

    answers.model_info(**given)


@call.command(
    short_help="Put the simulation back to its start.",
    epilog=examples(
        "./arm call reset",
    ),
)
@_options(SIM)
def reset(**given: Any) -> None:
    """Put the simulation back to its initial state and time zero."""
    from arm_sim.cli import answers

    answers.reset(**given)


@call.command(
    epilog=examples(
        "./arm call pause",
    )
)
@_options(SIM)
def pause(**given: Any) -> None:
    """Stop the simulation's time."""
    from arm_sim.cli import answers

    answers.pause(True, **given)


@call.command(
    epilog=examples(
        "./arm call resume",
    )
)
@_options(SIM)
def resume(**given: Any) -> None:
    """Let the simulation's time go on."""
    from arm_sim.cli import answers

    answers.pause(False, **given)


@call.command(
    short_help="Advance a paused simulation.",
    epilog=examples(
        "./arm call step 100",
    ),
)
@click.argument("steps", default=1, type=click.IntRange(1))
@_options(SIM)
def step(steps: int, **given: Any) -> None:
    """Advance a paused simulation by STEPS ticks (1 when not given)."""
    from arm_sim.cli import answers

    answers.step(steps, **given)


@call.command(
    "set-joint-state",
    short_help="Put joints of the simulation somewhere at once.",
    epilog=examples(
        './arm call set-joint-state --position "panda_joint4=-1.5"',
    ),
)
@click.option("--position", type=VECTOR, help=f"Joint positions in rad or m; {HOW}.")
@click.option("--velocity", type=VECTOR, help="Joint velocities; zero when not given.")
@_joints
@_options(SIM)
def set_joint_state(**given: Any) -> None:
    """Put joints of the simulation somewhere at once; those not named stay."""
    from arm_sim.cli import answers

    if given["position"] is None and given["velocity"] is None:
        raise click.UsageError("nothing to set: give --position, --velocity or both")
    answers.set_joint_state(**given)


@call.command(
    "set-payload",
    short_help="Change a payload of the simulation.",
    epilog=examples(
        './arm call set-payload --mass 1.5 --com "0 0 0.05"',
    ),
)
@click.option("--mass", required=True, type=float, help="Mass in kg.")
@click.option("--com", type=VECTOR, default="0 0 0", help="Centre of mass in its frame, in m.")
@click.option("--inertia", type=VECTOR, default="0 0 0 0 0 0",
              help="About it: xx xy xz yy yz zz, in kg m².")  # fmt: skip
@click.option("--index", default=0, show_default=True, type=click.IntRange(0),
              help="Which of the scene's payloads.")  # fmt: skip
@_options(SIM)
def set_payload(**given: Any) -> None:
    """Change a payload; the scene has to declare payloads tunable."""
    from arm_sim.cli import answers

    answers.set_payload(**given)


@call.command(
    "set-friction",
    short_help="Change viscous friction of the simulation.",
    epilog=examples(
        './arm call set-friction --viscous "panda_joint4=0.5"',
    ),
)
@click.option("--viscous", type=VECTOR, required=True,
              help=f"Coefficients in N m s/rad or N s/m; {HOW}.")  # fmt: skip
@_joints
@_options(SIM)
def set_friction(**given: Any) -> None:
    """Change viscous friction; the scene has to declare friction tunable."""
    from arm_sim.cli import answers

    answers.set_friction(**given)


@call.command(
    "reset-counters",
    short_help="Have the counters of the simulation begin afresh.",
    epilog=examples(
        "./arm call reset-counters",
    ),
)
@_options(SIM)
def reset_counters(**given: Any) -> None:
    """Have the counters of loop, commands and answers begin afresh."""
    from arm_sim.cli import answers

    answers.reset_counters(**given)


def _terms(text: str) -> int:
    words = text.lower().replace(",", " ").split()
    if words == ["all"]:
        return sum(TERMS.values())
    if not words or not set(words) <= set(TERMS):
        raise click.BadParameter(
            f"{text!r}; allowed: all, or some of {', '.join(TERMS)}", param_hint="'--terms'"
        )
    return sum(TERMS[word] for word in set(words))
