# SPDX-License-Identifier: Apache-2.0
"""A sequence of goals: followed to the end, cancelled or replaced during the motion."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from action_msgs.msg import GoalStatus

from arm_dynamics.arrays import Array
from arm_dynamics.model import ArmModel
from benchmarks.following.client import Failed, MoveItClient, Sent
from benchmarks.following.motions import message, onward, straight

PLAIN, CANCELLED, REPLACED = "to the end", "cancelled", "replaced"
_REACH = 0.5  # [rad] around the initial position
_SCALE = 0.5  # of the speed limits
_ACCELERATION = 2.0  # [rad/s²]
_SETTLING = 0.5  # [s] after a goal was cancelled
_STILL = 0.05  # [rad/s], including what an encoder and a filter report at rest
_DRIFT = 1e-3  # [rad] in a tenth of a second


@dataclass
class Tally:
    """What became of the goals of one kind.

    Attributes:
        asked: Number of goals.
        got: Number of goals that ended as expected.
        failures: Why the others did not.
        start: Largest distance from the start of a trajectory when it was sent in [rad].
        goal: Largest distance from its end when it had succeeded in [rad].
        late: Longest time that a goal took beyond its duration in [s].
    """

    asked: int = 0
    got: int = 0
    failures: list[str] = field(default_factory=list)
    start: float = 0.0
    goal: float = 0.0
    late: float = 0.0


class Course:
    """Goals at random places around the initial position, one after another."""

    def __init__(self, client: MoveItClient, model: ArmModel, seed: int = 0) -> None:
        """Take a client, and the arm for its limits."""
        self._client, self._model = client, model
        self._rng = np.random.default_rng(seed)
        self._speed = _SCALE * np.minimum(model.velocity_limit, 10.0)
        self._at: Array | None = None  # where the last trajectory ended
        self.tallies = {kind: Tally() for kind in (PLAIN, CANCELLED, REPLACED)}

    def run(self, goals: int, cancelled: int, replaced: int) -> Iterator[str]:
        """Send goals; yields the kind of each one that is over."""
        kinds = [PLAIN] * (goals - cancelled - replaced)
        kinds += [CANCELLED] * cancelled + [REPLACED] * replaced
        ways = {PLAIN: self._follow, CANCELLED: self._cancel, REPLACED: self._replace}
        for kind in self._rng.permutation(kinds).tolist():
            self._one(kind, self.tallies[kind], ways[kind])
            yield kind

    def _one(self, kind: str, tally: Tally, way: Callable[[Tally, Array], None]) -> None:
        tally.asked += 1
        try:
            here = self._client.fresh()[0] if self._at is None else self._at
            self._at = None
            tally.start = max(tally.start, self._client.check_start(here))
            way(tally, here)
            tally.got += 1
        except Failed as failure:
            tally.failures.append(str(failure))
            self._client.pause(_SETTLING)

    def _follow(self, tally: Tally, here: Array) -> None:
        there = self._target()
        motion, duration = straight(here, there, self._speed, _ACCELERATION)
        sent = self._client.send(message(motion, duration, self._model.joint_names), duration)
        self._arrive(tally, sent, there, duration)

    def _cancel(self, tally: Tally, here: Array) -> None:
        motion, duration = straight(here, self._target(), self._speed, _ACCELERATION)
        sent = self._client.send(message(motion, duration, self._model.joint_names), duration)
        self._client.pause(duration * self._rng.uniform(0.2, 0.7))
        self._client.cancel(sent)
        self._client.wait(sent, GoalStatus.STATUS_CANCELED)
        self._client.pause(_SETTLING)
        held, v = self._client.fresh()
        if np.abs(v).max() > _STILL:
            raise Failed(f"{_SETTLING} s after it was cancelled: {np.abs(v).max():.4g} rad/s")
        self._client.pause(0.1)
        moved = float(np.abs(self._client.fresh()[0] - held).max())
        if moved > _DRIFT:
            raise Failed(f"not held after it was cancelled: moved by {moved:.4g} rad")

    def _replace(self, tally: Tally, here: Array) -> None:
        motion, duration = straight(here, self._target(), self._speed, _ACCELERATION)
        names = self._model.joint_names
        first = self._client.send(message(motion, duration, names), duration)
        self._client.pause(duration * self._rng.uniform(0.2, 0.7))
        q, v = self._client.fresh()
        there = self._target()
        motion, duration = onward(q, v, there, 1.2)
        second = self._client.send(message(motion, duration, names), duration)
        self._client.wait(first, GoalStatus.STATUS_ABORTED)
        self._arrive(tally, second, there, duration)

    def _arrive(self, tally: Tally, sent: Sent, there: Array, duration: float) -> None:
        took = self._client.wait(sent)
        tally.late = max(tally.late, took - duration)
        tally.goal = max(tally.goal, float(np.abs(self._client.fresh()[0] - there).max()))
        self._at = there

    def _target(self) -> Array:
        low, high = self._model.position_lower, self._model.position_upper
        wanted = self._model.q0 + self._rng.uniform(-_REACH, _REACH, self._model.n)
        inside: Array = np.clip(wanted, low + 0.05, high - 0.05)
        return inside
