# SPDX-License-Identifier: Apache-2.0
"""Commands to a sim node."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from arm_sim.cli.call.asking import SIM, VECTOR, asks, call, joints, print_json
from arm_sim.cli.output import console, examples
from arm_sim.cli.vectors import HOW, Vector

if TYPE_CHECKING:
    from arm_dynamics.client import ArmClient


@call.command(
    short_help="Reset the simulation to its initial state.", epilog=examples("./arm call reset")
)
@asks(SIM)
def reset(client: ArmClient, as_json: bool) -> None:
    """Reset the simulation to its initial state and time zero."""
    client.reset()
    _print_done("reset to the initial state at time zero", as_json)


@call.command(epilog=examples("./arm call pause"))
@asks(SIM)
def pause(client: ArmClient, as_json: bool) -> None:
    """Pause the simulation."""
    client.pause()
    _print_done("paused", as_json)


@call.command(epilog=examples("./arm call resume"))
@asks(SIM)
def resume(client: ArmClient, as_json: bool) -> None:
    """Resume a paused simulation."""
    client.resume()
    _print_done("running", as_json)


@call.command(short_help="Advance a paused simulation.", epilog=examples("./arm call step 100"))
@click.argument("steps", default=1, type=click.IntRange(1))
@asks(SIM)
def step(client: ArmClient, as_json: bool, steps: int) -> None:
    """Advance a paused simulation by STEPS ticks (1 when omitted)."""
    time = client.step(steps)
    ticks = f"{steps} tick{'s' if steps > 1 else ''}"
    _print_done(f"advanced by {ticks}, t = {time:.6g} s", as_json, time=time)


def _something_to_set(position: Vector | None, velocity: Vector | None, **_: Any) -> None:
    if position is None and velocity is None:
        raise click.UsageError("nothing to set: give --position, --velocity or both")


@call.command(
    short_help="Set joint positions and velocities of the simulation.",
    epilog=examples('./arm call set-joint-state --position "panda_joint4=-1.5"'),
)
@click.option("--position", type=VECTOR, help=f"Joint positions in rad or m; {HOW}.")
@click.option("--velocity", type=VECTOR, help="Joint velocities; zero when omitted.")
@joints
@asks(SIM, check=_something_to_set)
def set_joint_state(
    client: ArmClient, as_json: bool, joints: list[str], **vectors: Vector | None
) -> None:
    """Set joint positions and velocities of the simulation; joints that are not named stay."""
    names, rows = _named_rows(joints, vectors)
    client.set_joint_state(rows.get("position"), rows.get("velocity"), names)
    _print_done(f"{', '.join(names) if names else 'all joints'} set", as_json)


@call.command(
    short_help="Change a payload of the simulation.",
    epilog=examples('./arm call set-payload --mass 1.5 --com "0 0 0.05"'),
)
@click.option("--mass", required=True, type=float, help="Mass in kg.")
@click.option("--com", type=VECTOR, default="0 0 0", help="Centre of mass in its frame, in m.")
@click.option("--inertia", type=VECTOR, default="0 0 0 0 0 0",
              help="Inertia about it: xx xy xz yy yz zz, in kg m².")  # fmt: skip
@click.option("--index", default=0, show_default=True, type=click.IntRange(0),
              help="Index of the payload in the scene.")  # fmt: skip
@asks(SIM)
def set_payload(
    client: ArmClient, as_json: bool, mass: float, com: Vector, inertia: Vector, index: int
) -> None:
    """Change a payload; the scene must declare payloads tunable."""
    client.set_payload(mass, com.flat(()), inertia.flat(()), index)
    _print_done(f"payload {index} has {mass:g} kg", as_json)


@call.command(
    short_help="Change viscous friction of the simulation.",
    epilog=examples('./arm call set-friction --viscous "panda_joint4=0.5"'),
)
@click.option("--viscous", type=VECTOR, required=True,
              help=f"Coefficients in N m s/rad or N s/m; {HOW}.")  # fmt: skip
@joints
@asks(SIM)
def set_friction(client: ArmClient, as_json: bool, joints: list[str], viscous: Vector) -> None:
    """Change viscous friction; the scene must declare friction tunable."""
    names, rows = _named_rows(joints, {"viscous": viscous})
    client.set_friction(rows["viscous"], names)
    _print_done(f"friction of {', '.join(names) if names else 'all joints'} set", as_json)


@call.command(
    short_help="Reset the counters of the simulation.",
    epilog=examples("./arm call reset-counters"),
)
@asks(SIM)
def reset_counters(client: ArmClient, as_json: bool) -> None:
    """Reset the counters of the loop, of commands and of answers to zero."""
    client.reset_counters()
    _print_done("counters reset", as_json)


def _named_rows(
    names: list[str], vectors: dict[str, Vector | None]
) -> tuple[list[str], dict[str, list[float]]]:
    """Names of the joints, none for all, and one number for each in every vector given."""
    given = {name: vector for name, vector in vectors.items() if vector is not None}
    for vector in given.values():
        if vector.batch:
            raise click.ClickException("one state is expected, got several points")
        if vector.named and names and set(vector.named) != set(names):
            raise click.ClickException(
                f"joints {', '.join(vector.named)} and {', '.join(names)}; allowed: the same "
                "joints in every vector and in --joints"
            )
        names = names or list(vector.named)
    return names, {name: vector.flat(names) for name, vector in given.items()}


def _print_done(done: str, as_json: bool, **answer: Any) -> None:
    if as_json:
        print_json(**answer)
    else:
        node = click.get_current_context().params["node"]
        console().print(f"/{node.strip('/')}: {done}", markup=False)
