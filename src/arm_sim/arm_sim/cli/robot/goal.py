# SPDX-License-Identifier: Apache-2.0
"""Joint goals on the command line: ``elbow=0.5``, ``elbow+=0.1``."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import click

from arm_dynamics.exceptions import degrees_meant

_WORD = re.compile(r"(?P<name>[^=+]+?)(?P<how>\+=|-=|=)(?P<number>.+)", re.DOTALL)
PEAK = 1.875  # ratio of a quintic's peak speed to its mean
FASTEST = 1.0  # [rad/s] or [m/s], peak speed of a joint when no duration is given
LEAST = 1.0  # [s]


@dataclass(frozen=True)
class JointGoal:
    """Goal of one joint.

    Attributes:
        name: The joint.
        value: Its position, or its displacement, in [rad] or [m].
        relative: Whether ``value`` is relative to the current reference.
    """

    name: str
    value: float
    relative: bool


def parse(words: Sequence[str]) -> tuple[JointGoal, ...]:
    """Parse joint goals.

    Raises:
        click.UsageError: If a word is not a goal, or repeats a joint.
    """
    goals = tuple(map(_goal, words))
    names = [goal.name for goal in goals]
    if again := next((name for name in names if names.count(name) > 1), None):
        raise click.UsageError(f"joint '{again}' is named twice")
    return goals


def _goal(word: str) -> JointGoal:
    found = _WORD.fullmatch(word.strip())
    try:
        number = float(found["number"]) if found else math.nan
    except ValueError:
        number = math.nan
    if found is None or not math.isfinite(number):
        raise click.UsageError(
            f"'{word}' is not a joint goal; allowed: JOINT=POSITION, JOINT+=DISTANCE and "
            "JOINT-=DISTANCE, with finite numbers in rad or m"
        )
    if remark := degrees_meant(number):
        click.echo(f"{found['name']}: {remark} (for a joint that slides, in m)", err=True)
    how = found["how"]
    return JointGoal(found["name"], -number if how == "-=" else number, how != "=")


def targets(goals: Sequence[JointGoal], here: Mapping[str, float]) -> dict[str, float]:
    """Target positions of the joints, from their current reference.

    The controller decides about joints that have none: they follow others, or do not exist.
    """
    return {g.name: g.value + (here.get(g.name, 0.0) if g.relative else 0.0) for g in goals}


def unhurried(there: Mapping[str, float], here: Mapping[str, float]) -> float:
    """A duration in [s] in which no joint gets faster than ``FASTEST``."""
    farthest = max((abs(there[name] - here[name]) for name in there.keys() & here), default=0.0)
    return max(LEAST, PEAK * farthest / FASTEST)
