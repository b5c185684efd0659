# SPDX-License-Identifier: Apache-2.0
"""The action SimulateSteps: many ticks while paused, with feedback; may be cancelled."""

from __future__ import annotations

from typing import Any

from rclpy.action import ActionServer, CancelResponse
from rclpy.node import Node
from rclpy.task import Future

from arm_dynamics.logs import Throttled
from arm_dynamics.ros.common.executor import steady_timer
from arm_sim.ros.standard.results import FAILED, INCORRECT_STATE, OK, Refusal, filled_result
from arm_sim.ros.tick_engine import TickEngine

_PARTS = 100  # number of parts of a goal, each followed by feedback
_LARGEST = 200  # largest number of ticks in a part, such that a cancel takes effect soon
_PERIOD = 0.001  # [s] between parts, for other callbacks


class SimulateSteps:
    """Executes one goal at a time, in parts, by a timer of the spinning thread."""

    def __init__(self, node: Node, engine: TickEngine, kind: Any) -> None:
        """Offer the action ``~/simulate_steps`` of type ``kind``."""
        self._engine, self._kind = engine, kind
        self._log = Throttled(node.get_logger())
        self._goal: Any = None
        self._timer = steady_timer(node, _PERIOD, self._part)
        self._timer.cancel()
        self._server = ActionServer(
            node, kind, "~/simulate_steps", self._execute,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )  # fmt: skip

    async def _execute(self, goal: Any) -> Any:
        result = self._kind.Result()
        with filled_result(result.result, self._log):
            self._check(goal)
        if result.result.result != OK:
            goal.abort()
            return result
        self._goal, self._completed, self._result, self._done = goal, 0, result, Future()
        self._timer.reset()
        return await self._done

    def _check(self, goal: Any) -> None:
        if self._goal is not None:
            raise Refusal(INCORRECT_STATE, "another goal is under way; cancel it, or wait for it")
        if not self._engine.may_step:
            raise Refusal(FAILED, "the simulation is running; allowed only while it is paused")
        if not goal.request.steps:
            raise Refusal(FAILED, "steps = 0; allowed: 1 or more")

    def _part(self) -> None:
        """Execute some ticks, unless the goal was cancelled."""
        goal, total = self._goal, self._goal.request.steps
        if goal.is_cancel_requested:
            self._result.result.error_message = (
                f"cancelled after {self._completed} of {total} steps"
            )
            self._finish(goal.canceled)
            return
        steps = min(max(1, min(total // _PARTS, _LARGEST)), total - self._completed)
        with filled_result(self._result.result, self._log):
            self._engine.queue.run(lambda: self._engine.step(steps))
            self._completed += steps
        if self._result.result.result != OK:
            self._finish(goal.abort)
            return
        left = total - self._completed
        feedback = self._kind.Feedback(completed_steps=self._completed, remaining_steps=left)
        goal.publish_feedback(feedback)
        if not left:
            self._finish(goal.succeed)

    def _finish(self, end: Any) -> None:
        self._timer.cancel()
        self._goal = None
        end()
        self._done.set_result(self._result)

    def close(self) -> None:
        """End the action; call before the node is destroyed."""
        self._timer.cancel()
        self._server.destroy()
