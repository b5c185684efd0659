# SPDX-License-Identifier: Apache-2.0
"""The action SimulateSteps: many ticks while paused, with feedback; may be cancelled."""

import asyncio
from functools import partial
from typing import Any

from rclpy.action import ActionServer, CancelResponse
from rclpy.node import Node

from arm_dynamics.logs import Throttled
from arm_sim.ros.standard.results import FAILED, INCORRECT_STATE, OK, Refusal, filled_result
from arm_sim.ros.tick_engine import TickEngine

_PARTS = 100  # number of parts of a goal, each followed by feedback
_LARGEST = 200  # largest number of ticks in a part, such that a cancel takes effect soon


class SimulateSteps:
    """Executes one goal at a time, in parts, between which other callbacks get their turn."""

    def __init__(self, node: Node, engine: TickEngine, kind: Any) -> None:
        """Offer the action ``~/simulate_steps`` of type ``kind``."""
        self._engine, self._kind = engine, kind
        self._log, self._busy = Throttled(node.get_logger()), False
        self._server = ActionServer(
            node, kind, "~/simulate_steps", self._execute,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )  # fmt: skip

    async def _execute(self, goal: Any) -> Any:
        result, total, completed = self._kind.Result(), goal.request.steps, 0
        with filled_result(result.result, self._log):
            if self._busy:
                raise Refusal(INCORRECT_STATE, "another goal is under way; cancel it, or wait")
            if not total:
                raise Refusal(FAILED, "steps = 0; allowed: 1 or more")
            part, self._busy = max(1, min(total // _PARTS, _LARGEST)), True
            try:
                while completed < total and not goal.is_cancel_requested:
                    steps = min(part, total - completed)
                    self._engine.queue.run(partial(self._engine.step, steps))
                    completed += steps
                    counts = {"completed_steps": completed, "remaining_steps": total - completed}
                    goal.publish_feedback(self._kind.Feedback(**counts))
                    await asyncio.sleep(0)  # a turn of the other callbacks
            finally:
                self._busy = False
        if result.result.result != OK:
            goal.abort()
        elif completed < total:
            result.result.error_message = f"cancelled after {completed} of {total} steps"
            goal.canceled()
        else:
            goal.succeed()
        return result

    def close(self) -> None:
        """End the action; call before the node is destroyed."""
        self._server.destroy()
