# SPDX-License-Identifier: Apache-2.0
"""Commands that ask a dynamics node."""

from __future__ import annotations

from typing import Any

import click

from arm_sim.cli.call.options import DYNAMICS, VECTOR, joints, options, vector
from arm_sim.cli.output import examples

TERMS = {"inertia": 1, "coriolis": 2, "gravity": 4, "friction": 8}


@click.command(
    "inverse-dynamics",
    short_help="Torques that produce a motion.",
    epilog=examples(
        './arm call inverse-dynamics --position "panda_joint2=-0.8 panda_joint4=-2.4"',
    ),
)
@vector("position", "Joint positions in rad or m", required=True)
@vector("velocity", "Joint velocities")
@vector("acceleration", "Joint accelerations")
@click.option("--terms", default="all", show_default=True,
              help="all, or some of inertia,coriolis,gravity,friction.")  # fmt: skip
@joints
@options(DYNAMICS)
def inverse_dynamics(terms: str, **given: Any) -> None:
    """Torques that produce a motion: M(q) a + C(q, v) v + G(q) + F(v)."""
    from arm_sim.cli.call import motion

    motion.inverse_dynamics(terms=_terms(terms), **given)


@click.command(
    "forward-dynamics",
    short_help="Accelerations that torques produce.",
    epilog=examples(
        './arm call forward-dynamics --position "0 -0.8 0 -2.4 0 1.6 0.8"',
    ),
)
@vector("position", "Joint positions in rad or m", required=True)
@vector("velocity", "Joint velocities")
@vector("effort", "Joint torques in N m or N")
@joints
@options(DYNAMICS)
def forward_dynamics(**given: Any) -> None:
    """Accelerations that torques produce."""
    from arm_sim.cli.call import motion

    motion.forward_dynamics(**given)


@click.command(
    "dynamics-terms",
    short_help="Mass matrix, Coriolis matrix, gravity, friction, energies.",
    epilog=examples(
        './arm call dynamics-terms --position "0 -0.8 0 -2.4 0 1.6 0.8" --json',
    ),
)
@vector("position", "Joint positions in rad or m", required=True)
@vector("velocity", "Joint velocities")
@joints
@options(DYNAMICS)
def dynamics_terms(**given: Any) -> None:
    """Mass matrix, Coriolis matrix, gravity, friction and energies."""
    from arm_sim.cli.call import motion

    motion.dynamics_terms(**given)


@click.command(
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
@vector("position", "Joint positions in rad or m", required=True)
@vector("velocity", "Joint velocities")
@joints
@options(DYNAMICS)
def task_space(**given: Any) -> None:
    """The equation of motion as seen at a frame: inertia, velocity terms, gravity, Jacobian."""
    from arm_sim.cli.call import task

    task.task_space(**given)


@click.command(
    "inverse-kinematics",
    short_help="Joint positions for a pose of a frame.",
    epilog=examples(
        './arm call inverse-kinematics --frame panda_hand --pose "0.4 0.2 0.5 1 0 0 0"',
        "./arm call inverse-kinematics --frame panda_hand --axes position \\",
        '      --pose "[[0.4, 0.2, 0.5, 0, 0, 0, 1], [0.4, 0.3, 0.5, 0, 0, 0, 1]]"',
    ),
)
@click.option("--frame", required=True, help="A frame that moves; model-info lists them.")
@click.option("--pose", type=VECTOR, required=True,
              help="Position x y z in m and quaternion x y z w of the frame in the world; "
                   "[[…], […]] for two poses, or @FILE.")  # fmt: skip
@click.option("--axes", default="pose", show_default=True,
              help='pose, position, orientation, or some of "x y z rx ry rz".')  # fmt: skip
@click.option("--seed", type=VECTOR,
              help="Joint positions to begin at; the scene's when not given.")  # fmt: skip
@joints
@options(DYNAMICS)
def inverse_kinematics(**given: Any) -> None:
    """Joint positions, within limits, that bring a frame to a pose.

    Where a pose is not reached the nearest found is shown, and the exit status is 1. Of several
    poses each search begins where the one before ended.
    """
    from arm_sim.cli.call import kinematics

    kinematics.inverse_kinematics(**given)


@click.command(
    "constrained-dynamics",
    short_help="Accelerations and forces under the scene's constraints.",
    epilog=examples(
        './arm call constrained-dynamics --position "0 0.6 -0.6 0.6 0.6 -0.6 0.6" \\',
        '      --effort "left_driver_joint=0.1"',
        './arm call constrained-dynamics --position "0 0.6 -0.6 0.6 0.6 -0.6 0.6" \\',
        '      --inverse --acceleration "wrist=2"',
    ),
)
@vector(
    "position", "Joint positions in rad or m, where the constraints should hold", required=True
)
@vector("velocity", "Joint velocities")
@vector("effort", "Joint torques in N m or N")
@click.option("--inverse", is_flag=True,
              help="Ask for torques, from --acceleration and --multipliers.")  # fmt: skip
@vector("acceleration", "Joint accelerations")
@click.option("--multipliers", type=VECTOR,
              help="Forces against the constraints in N or N m; zero when not given.")  # fmt: skip
@joints
@options(DYNAMICS)
def constrained_dynamics(inverse: bool, multipliers: Any, **given: Any) -> None:
    """Accelerations and forces that torques produce under the scene's constraints.

    tau = M a + C v + G + F + A^T lambda with A v = 0. lambda is what the arm exerts against the
    constraints: force and moment of a constraint's first frame upon its second.
    """
    from arm_sim.cli.call import constrained

    if inverse and given["effort"] is not None:
        raise click.UsageError("--effort is what --inverse asks for; allowed: one of the two")
    if not inverse and (multipliers or given["acceleration"]):
        raise click.UsageError("--acceleration and --multipliers are allowed with --inverse only")
    if inverse:
        constrained.inverse(multipliers, **given)
    else:
        constrained.forward(**given)


@click.command(
    "model-info",
    short_help="Joints, limits, frames and mass of the node's arm.",
    epilog=examples(
        "./arm call model-info",
    ),
)
@options(DYNAMICS)
def model_info(**given: Any) -> None:
    """What the node knows about its arm: joints, limits, frames, mass."""
    from arm_sim.cli.call import model

    model.model_info(**given)


def _terms(text: str) -> int:
    words = text.lower().replace(",", " ").split()
    if words == ["all"]:
        return sum(TERMS.values())
    if not words or not set(words) <= set(TERMS):
        raise click.BadParameter(
            f"{text!r}; allowed: all, or some of {', '.join(TERMS)}", param_hint="'--terms'"
        )
    return sum(TERMS[word] for word in set(words))
