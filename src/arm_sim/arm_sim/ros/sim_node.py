# SPDX-License-Identifier: Apache-2.0
"""The sim node: a simulated arm that takes torques and says how it moves."""

from __future__ import annotations

import sys
from collections.abc import Callable
from concurrent.futures import Future
from queue import Empty, SimpleQueue
from typing import Any

import numpy as np
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

from arm_dynamics import InvalidInput
from arm_dynamics.ros import convert
from arm_dynamics.ros.executor import run, surviving
from arm_dynamics.ros.joint_state_bytes import JointStateReader
from arm_dynamics.ros.newest import Newest
from arm_dynamics.ros.params import declare, watch
from arm_sim.exceptions import SimulationDiverged
from arm_sim.ros import interfaces
from arm_sim.ros.commands import Commands
from arm_sim.ros.histogram import Percentiles
from arm_sim.ros.outputs import Outputs
from arm_sim.ros.params import SimParams
from arm_sim.ros.realtime_loop import LoopReport, RealtimeLoop
from arm_sim.simulator import Simulator

_THROTTLE = 2.0  # [s] between warnings of one kind
_ANSWER_TIMEOUT = 30.0  # [s] that a service waits for the simulation
_PAUSED_PERIOD = 0.1  # [s] between joint states while paused


class SimNode(Node):
    """Integrates the arm from torque commands and publishes its joint states.

    With ``realtime`` a thread ticks by the clock; without, whoever calls ``tick`` is the clock.
    What services ask for is done by the ticking thread, between ticks.

    Attributes:
        simulator: The simulation.
        commands: The slot for torques.
    """

    def __init__(self, scene: Any = None, **node_kwargs: Any) -> None:
        """Build the simulation and start it.

        Args:
            scene: Anything ``load_scene`` takes; the parameter ``scene`` when None.
            **node_kwargs: For ``rclpy.node.Node``: context, namespace, parameter_overrides, …

        Raises:
            ArmError: If there is no scene, or a scene or parameter that cannot be used.
        """
        super().__init__("sim", **node_kwargs)
        self._params = declare(self, SimParams)
        self.simulator = _simulator(scene, self._params)
        self.commands = Commands(self.simulator.dynamics)
        self._apply(self._params)
        self._limit = self.simulator.model.command_limit
        self._paused = self._params.paused
        self._was_stale = False
        self._requests: SimpleQueue[tuple[Callable[[], Any], Future[Any]]] = SimpleQueue()
        names = self.simulator.joint_names
        self._reader = JointStateReader(names, ("effort",), partial=True, extra=False)
        self._outputs = Outputs(self, self.simulator, self._params)
        self._connect()
        watch(self, lambda: self._params, self._apply)
        self._loop = RealtimeLoop(self._tick_unattended, self.simulator.dt)
        self._outputs.publish()
        if self._params.realtime:
            self._loop.start()

    def _connect(self) -> None:
        self._joint_commands = Newest(self, interfaces.JOINT_COMMANDS)
        topic = interfaces.COMMANDS
        self.create_subscription(
            topic.type, topic.name, surviving(self, self.on_commands), topic.subscribe
        )
        for service, answer in (
            (interfaces.RESET, self.on_reset),
            (interfaces.PAUSE, self.on_pause),
            (interfaces.STEP, self.on_step),
            (interfaces.SET_JOINT_STATE, self.on_set_joint_state),
        ):
            self.create_service(service.type, service.name, answer)

    def _apply(self, params: SimParams) -> None:
        timeout = round(params.command_timeout / self.simulator.dt)
        if params.command_timeout > 0.0:
            timeout = max(timeout, 1)
        self.commands.configure(timeout, params.stale_policy)
        self._params = params

    # --- ticking -------------------------------------------------------------------------------

    def tick(self) -> None:
        """Do what was asked for since the last tick, then advance by one unless paused."""
        self._serve()
        if self._paused:
            self._outputs.repeat(_PAUSED_PERIOD)
            return
        self._look_for_command()
        self._advance(self.commands.take(self.simulator.state.q))
        if self.commands.stale is not self._was_stale:
            self._say_stale()

    def _tick_unattended(self) -> None:
        """Tick in the loop's thread, where nobody sees an exception."""
        try:
            self.tick()
        except Exception as error:
            self._paused = True
            if self.context.ok():
                self.get_logger().error(f"paused after an unexpected failure: {error!r}")

    def _advance(self, tau: np.ndarray) -> bool:
        try:
            self.simulator.step(tau)
        except SimulationDiverged as error:
            self._paused = True
            self.get_logger().error(
                f"paused, the last good state is kept; reset or set the joint state: {error}"
            )
            return False
        self._outputs.after_tick()
        return True

    def _say_stale(self) -> None:
        self._was_stale = self.commands.stale
        if self._was_stale:
            self.get_logger().warning(
                f"no command for {self._params.command_timeout:g} s: "
                f"the policy '{self._params.stale_policy}' acts"
            )
        else:
            self.get_logger().info("commands are back")

    def _serve(self) -> None:
        while not self._requests.empty():
            try:
                action, future = self._requests.get_nowait()
            except Empty:
                return
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(action())
            except Exception as error:
                future.set_exception(error)

    def _between_ticks(self, action: Callable[[], Any]) -> Any:
        """Have the ticking thread do something and wait for it; do it here if there is none."""
        if not self._params.realtime:
            return action()
        future: Future[Any] = Future()
        self._requests.put((action, future))
        try:
            return future.result(_ANSWER_TIMEOUT)
        except TimeoutError:
            future.cancel()
            raise InvalidInput(f"the simulation gave no answer in {_ANSWER_TIMEOUT} s") from None

    def report(self) -> tuple[LoopReport, Percentiles]:
        """How well the clock has been kept, and how long commands took from state to effort."""
        return self._loop.report(), self._outputs.round_trip.percentiles()

    def destroy_node(self) -> None:
        """Stop ticking, say how it went, and take the node down."""
        self._loop.stop()
        self._joint_commands.close()
        if self._params.realtime:
            loop, round_trip = self.report()
            self.get_logger().info(
                f"{loop.ticks} ticks, {loop.rate:.2f} per second, {loop.missed} late by more than "
                f"a tick, {loop.dropped} dropped; lateness {loop.lateness}; "
                f"{round_trip.count} answers, round trip {round_trip}"
            )
        super().destroy_node()

    # --- commands ------------------------------------------------------------------------------

    def _look_for_command(self) -> None:
        taken = self._joint_commands.take()
        if taken is not None:
            self.on_joint_commands(*taken)

    def on_joint_commands(self, raw: bytes, arrival: int = 0) -> None:
        """Take efforts by joint name from the JointState that came at ``arrival`` in [ns]."""
        try:
            stamp, (tau,) = self._reader.read(raw)
        except InvalidInput as error:
            self._refuse(error)
            return
        self._outputs.round_trip.answered(stamp, arrival)
        self._accept(tau)

    def on_commands(self, message: Float64MultiArray) -> None:
        """Take efforts in model order."""
        tau = np.array(message.data, float)
        if tau.shape != (self.simulator.n,) or not np.isfinite(tau).all():
            self._refuse(
                f"{tau.size} numbers {tau[:10]}; allowed are {self.simulator.n} finite numbers"
            )
            return
        self._accept(tau)

    def _accept(self, tau: np.ndarray) -> None:
        over = np.abs(tau) > self._limit
        if over.any():
            joint = int(np.argmax(over))
            name = self.simulator.joint_names[joint]
            self.get_logger().warning(
                f"effort {tau[joint]:.6g} of joint '{name}' is beyond its limit "
                f"{self._limit[joint]:.6g} {self.simulator.model.command_unit[joint]} "
                "and is cut to it",
                throttle_duration_sec=_THROTTLE,
            )
        self.commands.put(tau)

    def _refuse(self, why: Any) -> None:
        self.get_logger().warning(f"command passed over: {why}", throttle_duration_sec=_THROTTLE)

    # --- services ------------------------------------------------------------------------------

    def on_reset(self, request: Any, response: Any) -> Any:
        """Answer ``~/reset``: back to the initial state and time zero, without a command."""
        del request  # empty
        with convert.answering(response, self.get_logger()):
            self._between_ticks(self._reset)
        return response

    def on_pause(self, request: Any, response: Any) -> Any:
        """Answer ``~/pause``: stop or go on."""
        with convert.answering(response, self.get_logger()):
            self._between_ticks(lambda: setattr(self, "_paused", request.data))
        return response

    def on_step(self, request: Any, response: Any) -> Any:
        """Answer ``~/step``: advance by whole ticks while nobody else does."""
        with convert.answering(response, self.get_logger()):
            if not 1 <= request.steps <= interfaces.MAX_STEPS:
                raise InvalidInput(
                    f"steps = {request.steps}; allowed are 1 to {interfaces.MAX_STEPS}"
                )
            self._between_ticks(lambda: self._step(request.steps))
        response.time = self.simulator.state.time
        return response

    def on_set_joint_state(self, request: Any, response: Any) -> Any:
        """Answer ``~/set_joint_state``: put joints where the request wants them."""
        with convert.answering(response, self.get_logger()):
            self._between_ticks(lambda: self._set_joint_state(request))
        return response

    def _reset(self) -> None:
        self.simulator.reset()
        self.commands.clear()
        self._was_stale = False
        self._outputs.restart()

    def _step(self, steps: int) -> None:
        if self._params.realtime and not self._paused:
            raise InvalidInput("the simulation is running; allowed only while it is paused")
        self._look_for_command()
        for done in range(steps):
            if not self._advance(self.commands.held(self.simulator.state.q)):
                raise SimulationDiverged(f"after {done} of {steps} steps; that state is kept")

    def _set_joint_state(self, request: Any) -> None:
        """Named joints take the positions, or keep theirs, and the velocities, or stop."""
        state = self.simulator.state
        joints = convert.joint_indices(request.joint_names, self.simulator.joint_names)
        q = convert.spread("position", request.position or state.q[joints], joints, state.q)
        v = convert.spread("velocity", request.velocity or 0.0 * q[joints], joints, state.v)
        self.simulator.set_state(q, v)
        self._outputs.restart()


def _simulator(scene: Any, params: SimParams) -> Simulator:
    scene = scene if scene is not None else params.scene or None
    if scene is None:
        raise InvalidInput("parameter 'scene' is empty; allowed is a scene file or a URDF")
    chosen = {"integrator": params.integrator, "dt": params.dt, "tolerance": params.tolerance}
    return Simulator(scene, **{name: value for name, value in chosen.items() if value})


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    sys.exit(run(SimNode, args))
