# SPDX-License-Identifier: Apache-2.0
"""Variables of a functional mock-up unit."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from arm_dynamics import ArmModel
from arm_sim.state import State

# Units of variables, as exponents of SI units; radians are counted for display only
UNITS: dict[str, dict[str, int]] = {
    "s": {"s": 1}, "rad": {"rad": 1}, "m": {"m": 1}, "rad/s": {"rad": 1, "s": -1},
    "m/s": {"m": 1, "s": -1}, "N.m": {"kg": 1, "m": 2, "s": -2}, "N": {"kg": 1, "m": 1, "s": -2},
    "A": {"A": 1}, "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
}  # fmt: skip


@dataclass(frozen=True)
class Variable:
    """A variable, in the words of FMI.

    Attributes:
        name: Its name.
        causality: ``input``, ``output``, ``parameter`` or ``independent``.
        variability: ``continuous``, ``tunable`` or ``fixed``.
        unit: One of ``UNITS``; empty for none.
        start: Its default; None if it is computed.
        min: Lower limit, -inf for none.
        max: Upper limit, inf for none.
        description: What it is.
    """

    name: str
    causality: str
    variability: str
    unit: str = ""
    start: float | None = None
    min: float = -math.inf
    max: float = math.inf
    description: str = ""


def variables(
    model: ArmModel, state: State, parameters: Sequence[tuple[str, float]],
    frames: Sequence[str] = (),
) -> tuple[Variable, ...]:  # fmt: skip
    """Variables in the order of their value references, which ``native/instance.h`` fixes.

    Args:
        model: The arm.
        state: The state in which a simulation begins by default.
        parameters: Names and nominal values of what may be set.
        frames: Frames that take wrenches.
    """
    return (
        Variable("time", "independent", "continuous", "s"),
        *_commands(model),
        *_wrenches(frames),
        *_outputs(model),
        *_starts(model, state),
        *(Variable(name, "parameter", "tunable", start=value) for name, value in parameters),
    )


def _commands(model: ArmModel) -> Iterator[Variable]:
    for i, joint in enumerate(model.joint_names):
        unit, limit = model.command_unit[i].replace(" ", "."), float(model.command_limit[i])
        yield Variable(
            f"{joint}.command", "input", "continuous", unit, 0.0, -limit, limit,
            "command of the joint's drive, clipped at its limit",
        )  # fmt: skip


def _wrenches(frames: Sequence[str]) -> Iterator[Variable]:
    """Force and moment on each frame, in the order of the rows of its Jacobian."""
    for frame in frames:
        for kind, unit in (("force", "N"), ("torque", "N.m")):
            for axis in "xyz":
                description = f"{kind} on the frame at its origin, along an axis of the world"
                name = f"{frame}.wrench.{kind}.{axis}"
                yield Variable(name, "input", "continuous", unit, 0.0, description=description)


def _outputs(model: ArmModel) -> Iterator[Variable]:
    """Positions, velocities and efforts of the joints."""
    for kind, turning, sliding, description in (
        ("position", "rad", "m", "position"),
        ("velocity", "rad/s", "m/s", "velocity"),
        ("effort", "N.m", "N", "torque or force of the last tick on the joint"),
    ):
        for joint, unit in zip(model.joint_names, model.units(turning, sliding), strict=True):
            yield Variable(
                f"{joint}.{kind}", "output", "continuous", unit, description=description
            )


def _starts(model: ArmModel, state: State) -> Iterator[Variable]:
    """Positions and velocities of the joints at the start."""
    for kind, values, turning, sliding in (
        ("position", state.q, "rad", "m"),
        ("velocity", state.v, "rad/s", "m/s"),
    ):
        units = model.units(turning, sliding)
        for joint, unit, value in zip(model.joint_names, units, values, strict=True):
            yield Variable(
                f"{joint}.initial_{kind}", "parameter", "fixed", unit, float(value),
                description=f"{kind} at the start",
            )  # fmt: skip
