# SPDX-License-Identifier: Apache-2.0
"""Commands that order a sim node to do something."""

from __future__ import annotations

from typing import Any

import click

from arm_sim.cli.call.options import SIM, VECTOR, joints, options
from arm_sim.cli.output import examples
from arm_sim.cli.vectors import HOW


@click.command(
    short_help="Put the simulation back to its start.",
    epilog=examples(
        "./arm call reset",
    ),
)
@options(SIM)
def reset(**given: Any) -> None:
    """Put the simulation back to its initial state and time zero."""
    from arm_sim.cli.call import simulation

    simulation.reset(**given)


@click.command(
    epilog=examples(
        "./arm call pause",
    )
)
@options(SIM)
def pause(**given: Any) -> None:
    """Stop the simulation's time."""
    from arm_sim.cli.call import simulation

    simulation.pause(True, **given)


@click.command(
    epilog=examples(
        "./arm call resume",
    )
)
@options(SIM)
def resume(**given: Any) -> None:
    """Let the simulation's time go on."""
    from arm_sim.cli.call import simulation

    simulation.pause(False, **given)


@click.command(
    short_help="Advance a paused simulation.",
    epilog=examples(
        "./arm call step 100",
    ),
)
@click.argument("steps", default=1, type=click.IntRange(1))
@options(SIM)
def step(steps: int, **given: Any) -> None:
    """Advance a paused simulation by STEPS ticks (1 when not given)."""
    from arm_sim.cli.call import simulation

    simulation.step(steps, **given)


@click.command(
    "set-joint-state",
    short_help="Put joints of the simulation somewhere at once.",
    epilog=examples(
        './arm call set-joint-state --position "panda_joint4=-1.5"',
    ),
)
@click.option("--position", type=VECTOR, help=f"Joint positions in rad or m; {HOW}.")
@click.option("--velocity", type=VECTOR, help="Joint velocities; zero when not given.")
@joints
@options(SIM)
def set_joint_state(**given: Any) -> None:
    """Put joints of the simulation somewhere at once; those not named stay."""
    from arm_sim.cli.call import simulation

    if given["position"] is None and given["velocity"] is None:
        raise click.UsageError("nothing to set: give --position, --velocity or both")
    simulation.set_joint_state(**given)


@click.command(
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
@options(SIM)
def set_payload(**given: Any) -> None:
    """Change a payload; the scene has to declare payloads tunable."""
    from arm_sim.cli.call import simulation

    simulation.set_payload(**given)


@click.command(
    "set-friction",
    short_help="Change viscous friction of the simulation.",
    epilog=examples(
        './arm call set-friction --viscous "panda_joint4=0.5"',
    ),
)
@click.option("--viscous", type=VECTOR, required=True,
              help=f"Coefficients in N m s/rad or N s/m; {HOW}.")  # fmt: skip
@joints
@options(SIM)
def set_friction(**given: Any) -> None:
    """Change viscous friction; the scene has to declare friction tunable."""
    from arm_sim.cli.call import simulation

    simulation.set_friction(**given)


@click.command(
    "reset-counters",
    short_help="Have the counters of the simulation begin afresh.",
    epilog=examples(
        "./arm call reset-counters",
    ),
)
@options(SIM)
def reset_counters(**given: Any) -> None:
    """Have the counters of loop, commands and answers begin afresh."""
    from arm_sim.cli.call import simulation

    simulation.reset_counters(**given)
