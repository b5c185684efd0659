# SPDX-License-Identifier: Apache-2.0
"""The sim node's services; what they ask for happens between two ticks.

A new one is a method here, its type and name in ``arm_dynamics.ros.interfaces``, and a method of
the client.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from arm_dynamics.ros import interfaces
from arm_dynamics.ros.common.convert import answering, joint_indices, spread
from arm_sim.ros.tick_engine import TickEngine
from arm_sim.runtime_changes import friction_change, payload_change


class SimServices:
    """Answers requests to a simulation; a bad one changes nothing."""

    def __init__(self, node: Node, engine: TickEngine, reset_counters: Callable[[], None]) -> None:
        """Offer the services; ``reset_counters`` runs between ticks."""
        self._engine, self._reset_counters = engine, reset_counters
        self._log = node.get_logger()
        for service, answer in (
            (interfaces.RESET, self.on_reset),
            (interfaces.PAUSE, self.on_pause),
            (interfaces.STEP, self.on_step),
            (interfaces.SET_JOINT_STATE, self.on_set_joint_state),
            (interfaces.SET_PAYLOAD, self.on_set_payload),
            (interfaces.SET_FRICTION, self.on_set_friction),
            (interfaces.RESET_COUNTERS, self.on_reset_counters),
        ):
            node.create_service(service.type, service.name, answer)

    def on_reset(self, request: Any, response: Any) -> Any:
        """Answer ``~/reset``: back to the initial state and time zero, without a command."""
        del request  # empty
        return self._between_ticks(response, self._engine.reset)

    def on_pause(self, request: Any, response: Any) -> Any:
        """Answer ``~/pause``: stop or go on."""
        return self._between_ticks(response, lambda: self._engine.pause(request.data))

    def on_step(self, request: Any, response: Any) -> Any:
        """Answer ``~/step``: advance by whole ticks while nothing else does."""
        self._between_ticks(response, lambda: self._engine.step(request.steps))
        response.time = self._engine.simulator.step_count * self._engine.simulator.dt
        return response

    def on_set_joint_state(self, request: Any, response: Any) -> Any:
        """Answer ``~/set_joint_state``: put joints where the request says, at once."""
        return self._between_ticks(response, lambda: self._set_joint_state(request))

    def on_set_payload(self, request: Any, response: Any) -> Any:
        """Answer ``~/set_payload``: another mass in the hand."""
        load = request.index, request.mass, request.com, request.inertia
        return self._change(response, lambda: payload_change(self._engine.simulator, *load))

    def on_set_friction(self, request: Any, response: Any) -> Any:
        """Answer ``~/set_friction``: other viscous friction."""
        simulator = self._engine.simulator

        def prepare() -> Callable[[], None]:
            joints = joint_indices(request.joint_names, simulator.joint_names)
            present = simulator.dynamics.model.viscous
            viscous = spread("viscous", request.viscous, joints, present)
            return friction_change(simulator, viscous)

        return self._change(response, prepare)

    def on_reset_counters(self, request: Any, response: Any) -> Any:
        """Answer ``~/reset_counters``: rate, misses, lateness and refusals begin anew."""
        del request  # empty
        return self._between_ticks(response, self._reset_counters)

    def _between_ticks(self, response: Any, action: Callable[[], Any]) -> Any:
        with answering(response, self._log):
            self._engine.queue.run(action)
        return response

    def _change(self, response: Any, prepare: Callable[[], Callable[[], None]]) -> Any:
        """Prepare a change here, which may take long, and put it in force between ticks."""
        with answering(response, self._log):
            change = prepare()
            self._engine.queue.run(lambda: self._engine.change(change))
        return response

    def _set_joint_state(self, request: Any) -> None:
        """Named joints take the positions, or keep theirs, and the velocities, or stop."""
        simulator = self._engine.simulator
        state = simulator.state
        joints = joint_indices(request.joint_names, simulator.joint_names)
        q = spread("position", request.position or state.q[joints], joints, state.q)
        v = spread("velocity", request.velocity or 0.0 * q[joints], joints, state.v)
        self._engine.change(lambda: simulator.set_state(q, v))
