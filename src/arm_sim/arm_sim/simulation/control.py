# SPDX-License-Identifier: Apache-2.0
"""Controllers in Python as functions of the state."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from arm_dynamics import Dynamics, InvalidInput
from arm_dynamics.trajectory.reference import Motion
from arm_dynamics.trajectory.trajectory import hold
from arm_sim.state import State

# The command at a state
Control = Callable[[State], Any]


def commands_of(
    controller: Any, reference: Motion | None, dynamics: Dynamics, begin: State
) -> Control:
    """Commands of a controller that follows a reference.

    Args:
        controller: An object with ``torque(state, reference)``.
        reference: The reference from the state ``begin`` on; None: stay there.
        dynamics: Dynamics of the arm, for drives with commands other than torques.
        begin: The state at the start of the run.

    Raises:
        InvalidInput: If it is a class, or the reference cannot be sampled.
    """
    if inspect.isclass(controller):
        raise InvalidInput(
            f"control is class {controller.__name__}; an instance of it is expected"
        )
    motion: Motion = hold(begin.q) if reference is None else reference
    if not hasattr(motion, "sample"):
        raise InvalidInput(
            f"reference is of type {type(motion).__name__}; an object with sample(t) is expected, "
            "such as trajectory.quintic(…)"
        )

    def command(state: State) -> Any:
        tau = controller.torque(state, motion.sample(state.time - begin.time))
        return dynamics.command_map(state.q, state.v, tau)

    return command


def check_function(control: Control) -> None:
    """Refuse a function that does not take a state alone, unless it has no signature."""
    try:
        inspect.signature(control).bind(None)
    except TypeError:
        text = f"control = {control!r}: a function of one argument, the state, is expected"
        raise InvalidInput(text) from None
    except ValueError:
        pass
