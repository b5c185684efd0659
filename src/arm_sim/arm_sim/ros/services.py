# SPDX-License-Identifier: Apache-2.0
"""The sim node's services; what they ask for is done between two ticks."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from arm_dynamics import InvalidInput
from arm_dynamics.ros.common import convert
from arm_sim.exceptions import SimulationDiverged
from arm_sim.ros import interfaces
from arm_sim.ros.standard_services import StandardServices
from arm_sim.runtime_changes import friction_change, payload_change

if TYPE_CHECKING:
    from arm_sim.ros.sim_node import SimNode


class SimServices:
    """Answers requests to a sim node; a bad one changes nothing."""

    def __init__(self, node: SimNode) -> None:
        """Offer the services of ``node``."""
        self._node = node
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
        self.standard = StandardServices(node, self)

    def on_reset(self, request: Any, response: Any) -> Any:
        """Answer ``~/reset``: back to the initial state and time zero, without a command."""
        del request  # empty
        with convert.answering(response, self._node.get_logger()):
            self._node.errands.run(self._restart)
        return response

    def on_pause(self, request: Any, response: Any) -> Any:
        """Answer ``~/pause``: stop or go on."""
        with convert.answering(response, self._node.get_logger()):
            self._node.errands.run(lambda: self.pause(request.data))
        return response

    def on_step(self, request: Any, response: Any) -> Any:
        """Answer ``~/step``: advance by whole ticks while nobody else does."""
        with convert.answering(response, self._node.get_logger()):
            if not 1 <= request.steps <= interfaces.MAX_STEPS:
                raise InvalidInput(
                    f"steps = {request.steps}; allowed are 1 to {interfaces.MAX_STEPS}"
                )
            self._node.errands.run(lambda: self._step(request.steps))
        response.time = self._node.simulator.step_count * self._node.simulator.dt
        return response

    def on_set_joint_state(self, request: Any, response: Any) -> Any:
        """Answer ``~/set_joint_state``: put joints where the request wants them."""
        with convert.answering(response, self._node.get_logger()):
            self._node.errands.run(lambda: self._set_joint_state(request))
        return response

    def on_set_payload(self, request: Any, response: Any) -> Any:
        """Answer ``~/set_payload``: another mass in the hand."""
        with convert.answering(response, self._node.get_logger()):
            change = payload_change(
                self._node.simulator, request.index, request.mass, request.com, request.inertia
            )
            self._node.errands.run(lambda: self._change(change))
        return response

    def on_set_friction(self, request: Any, response: Any) -> Any:
        """Answer ``~/set_friction``: other viscous friction."""
        with convert.answering(response, self._node.get_logger()):
            simulator = self._node.simulator
            joints = convert.joint_indices(request.joint_names, simulator.joint_names)
            present = simulator.dynamics.model.viscous
            viscous = convert.spread("viscous", request.viscous, joints, present)
            change = friction_change(simulator, viscous)
            self._node.errands.run(lambda: self._change(change))
        return response

    def on_reset_counters(self, request: Any, response: Any) -> Any:
        """Answer ``~/reset_counters``: rate, misses, lateness and round trips begin afresh."""
        del request  # empty
        with convert.answering(response, self._node.get_logger()):
            self._node.errands.run(self._node.forget_counts)
        return response

    def pause(self, stop: bool) -> None:
        """Stop time, or let it go on."""
        node = self._node
        node.paused = stop
        if not stop:
            node.trouble = ""
        if node.lockstep is not None:
            node.publish_state()
            node.lockstep.wait()

    def _restart(self) -> None:
        node = self._node
        node.commands.clear()
        node.input.arbiter.forget()
        node.push.clear()
        node.forget_trouble()
        self._change(node.simulator.reset)

    def _change(self, action: Callable[[], Any]) -> None:
        action()
        self._node.changed()

    def _step(self, steps: int) -> None:
        node = self._node
        if node.running and not node.paused:
            raise InvalidInput("the simulation is running; allowed only while it is paused")
        node.look_for_command()
        for done in range(steps):
            if not node.advance(node.commands.held(node.positions)):
                raise SimulationDiverged(f"after {done} of {steps} steps; that state is kept")

    def _set_joint_state(self, request: Any) -> None:
        """Named joints take the positions, or keep theirs, and the velocities, or stop."""
        simulator = self._node.simulator
        state = simulator.state
        joints = convert.joint_indices(request.joint_names, simulator.joint_names)
        q = convert.spread("position", request.position or state.q[joints], joints, state.q)
        v = convert.spread("velocity", request.velocity or 0.0 * q[joints], joints, state.v)
        self._change(lambda: simulator.set_state(q, v))
