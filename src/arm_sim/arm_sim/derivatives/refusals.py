# SPDX-License-Identifier: Apache-2.0
"""Why a tick cannot be differentiated, in words; see ``enum refusal`` of compiled code."""

from collections.abc import Sequence

from arm_dynamics.codegen.header import Header
from arm_sim.exceptions import SimulationDiverged
from arm_sim.integrators.selection import Choice
from arm_sim.stepping.engine import NATIVE

_HEADER = Header(NATIVE / "derivatives/sensitivities.h", only="refusal")
# Names of reasons by their values in compiled code
REASONS = {value: name for name, value in _HEADER.constants.items()}
# Largest number of steps of a tick, in all its segments
MAX_STEPS = 200_000
# Messages of reasons, with room for the names of guards or joints
MESSAGES = {
    "ACCUMULATE": "events accumulate in the time step: it has no derivative",
    "TOO_MANY_STEPS": f"the time step takes more than {MAX_STEPS} sub-steps",
    "BEGINS_WITH_IMPACT": "the time step begins with an impact",
    "BEGINS_ON_BOUNDARY": (
        "{} is on the boundary between two modes at its beginning, as at rest and about to slide"
    ),
    "ENDS_ON_BOUNDARY": "{} is on the boundary between two modes at its end",
    "REDUCED_REBOUND": "the restitution of an impact is reduced so that it adds no energy",
    "IMPACT_ON_EDGE": "the impact at {} is on the boundary of stick and slip",
    "UNLOADED_GEAR": "{} is at rest without load, where its gear's friction vanishes",
    "JOINT_WOULD_GO_ON": (
        "{} is held at rest by a load between its sliding and its static level: if it moved, it "
        "would go on"
    ),
    "CONTACT_WOULD_GO_ON": (
        "{} is held by a load between its sliding and its static level: if it moved, it would "
        "go on"
    ),
    "STARTS_TO_SLIDE": "{} starts to slide, where its direction of sliding is not differentiable",
    "STOPS_STRAIGHT": (
        "{} comes to rest in a straight line, where its direction of sliding is not differentiable"
    ),
    "SAME_INSTANT": "two events occur at the same instant, or one at the start of the time step",
    "COINCIDE": "{}: events at the same instant",
    "GRAZES": "{} is grazed",
}
# Message of GRAZES without the name of a guard
UNKNOWN_GRAZING = "an event is grazed, or joints and contacts that held together let go"
# Reasons that concern a joint by its index; all others concern guards
JOINT_REASONS = ("UNLOADED_GEAR", "JOINT_WOULD_GO_ON")


def refusal_message(reason: str, names: Sequence[str], indices: Sequence[int]) -> str:
    """The message of a tick without a derivative.

    Args:
        reason: A key of ``MESSAGES``.
        names: Names of all joints for one of ``JOINT_REASONS``, else of all guards.
        indices: Indices of the names that the reason concerns.
    """
    subjects = ", ".join(names[i] for i in indices)
    grazing_unknown = reason == "GRAZES" and not subjects
    message = UNKNOWN_GRAZING if grazing_unknown else MESSAGES[reason].format(subjects)
    return f"linearize: {message}; side=1 or side=-1 takes one side of it"


def divergence(choice: Choice) -> SimulationDiverged:
    """The error of a tick that cannot be computed."""
    return SimulationDiverged(f"linearize: the time step cannot be computed{choice.remark}")
