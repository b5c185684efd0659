# SPDX-License-Identifier: Apache-2.0
"""The sim node: a simulated arm that accepts commands and publishes joint states."""

from __future__ import annotations

from ctypes import byref
from typing import TYPE_CHECKING, Any

from rclpy.node import Node
from std_msgs.msg import String

from arm_dynamics.ros.common.diagnostics import Diagnosis
from arm_dynamics.ros.common.endpoints import advertise, subscribe
from arm_dynamics.ros.common.params import declare, watch
from arm_dynamics.ros.common.robot_source import FROM_TOPIC, scene_for
from arm_dynamics.ros.common.threads.background import Background
from arm_dynamics.ros.common.threads.scheduling import MiddlewareThreads
from arm_dynamics.ros.interfaces import ROBOT_DESCRIPTION
from arm_sim.ros.commands.latest import in_force
from arm_sim.ros.diagnostics import SimDiagnostics
from arm_sim.ros.display import Display
from arm_sim.ros.inputs.competing_publishers import CompetingPublishers
from arm_sim.ros.inputs.inputs import Inputs
from arm_sim.ros.interfaces import COMMANDS, WRENCH
from arm_sim.ros.lockstep import Lockstep
from arm_sim.ros.node_library import library
from arm_sim.ros.outputs import Outputs
from arm_sim.ros.services import SimServices
from arm_sim.ros.sim_params import CLOCK, HAND, SimParams, greeting
from arm_sim.ros.standard.services import StandardServices
from arm_sim.ros.tick_engine import TickEngine
from arm_sim.ros.timing.realtime_loop import RealtimeLoop
from arm_sim.simulation.simulator import Simulator

if TYPE_CHECKING:
    from arm_sim.ros.record.ticks import TickRecorder


class SimNode(Node):
    """Integrates the arm from joint commands and publishes its joint states.

    With ``realtime`` a thread ticks in real time; with ``lockstep`` the answer to a state
    triggers the next tick; without either, the caller of ``tick`` advances time.

    Attributes:
        simulator: The simulation.
        params: Current parameters.
        engine: Advances the simulation; independent of ROS.
        inputs: Incoming commands and wrenches.
        outputs: Messages in the course of ticks.
        lockstep: Waits for answers, or None.
        competitors: Others who publish joint states of this arm.
        display: Publishes all joints and frames for visualization, or None.
        loop: Ticks in real time, and measures its timing.
        requests: The services.
        standard: The standard services of simulators.
        recorder: Records every tick, or None.
        diagnostics: Inspects all of these.
    """

    _complete = False  # a node that could not be built is destroyed, too, by Kilted's rclpy

    def __init__(self, scene: Any = None, **node_kwargs: Any) -> None:
        """Build the simulation and start it.

        Args:
            scene: Anything ``load_scene`` accepts; if None, the parameter ``scene``, else a robot
                description, from the parameter or topic ``robot_description``.
            **node_kwargs: For ``rclpy.node.Node``: context, namespace, parameter_overrides, …

        Raises:
            ArmError: If there is no scene, or a scene or parameter that cannot be used.
        """
        super().__init__("sim", **node_kwargs)
        self.params = params = declare(self, SimParams)
        robot_scene, source = scene_for(self, scene, params.scene, params)
        self.simulator = Simulator(
            robot_scene, params.integrator or None, params.dt or None, params.tolerance or None
        )
        self._background = Background("servos") if params.tick_source == CLOCK else None
        self.engine = engine = self._engine_of(params)
        self.outputs = outputs = Outputs(
            self, engine, params, account_read=lambda: self.diagnosis.has_subscribers
        )
        self.competitors = CompetingPublishers(
            self, outputs, engine.round_trip, self._note_competitors
        )
        self.inputs = inputs = Inputs(self, engine, self.competitors)
        if params.tick_source != HAND:
            self.competitors.refuse_if_any()
        arrays, rate = outputs.reported, params.display_rate
        self.display = Display(self, engine, params, arrays, outputs.stamp) if rate else None
        self.loop = self._loop_of(params)
        outputs.stamps.follow(self.loop.current)
        self.lockstep = (
            Lockstep(self, params, engine, inputs, outputs) if params.lockstep else None
        )
        if self.lockstep is None:
            inputs.polled.open(self)
        self.recorder = self._recorder_of(params)
        subscribe(self, COMMANDS, inputs.on_commands)
        subscribe(self, WRENCH, inputs.on_wrench)
        self.requests = SimServices(self, engine, self._reset_counters)
        self.standard = StandardServices(self, engine, params, outputs.stamp)
        self.diagnostics = SimDiagnostics(self)
        self.diagnosis = Diagnosis(self, self.diagnostics)
        if params.publish_description and source != FROM_TOPIC:
            advertise(self, ROBOT_DESCRIPTION).publish(String(data=robot_scene.description))
        watch(self, params, self._apply)
        self._complete = True
        self._start()

    def _engine_of(self, params: SimParams) -> TickEngine:
        engine = TickEngine(
            self.simulator, background=self._background,
            wrench_timeout=params.wrench_timeout, wrench_reference=params.wrench_reference,
            paused=params.paused, self_running=params.tick_source != HAND,
            wait_for_command=params.wait_for_command,
        )  # fmt: skip
        engine.configure(params.command_timeout, params.stale_policy)
        engine.on.failure.append(self._report_failure)
        engine.on.staleness.append(self._report_staleness)
        engine.on.pause.append(self._report_pause)
        return engine

    def _loop_of(self, params: SimParams) -> RealtimeLoop:
        factor = params.realtime_factor
        return RealtimeLoop(
            lambda due: self.engine.run(library().ticks_by_the_clock, byref(due)),
            self.simulator.dt / factor if factor else 0.0,
            overrun=params.overrun, prepare=self._claim_privileges,
        )  # fmt: skip

    def _recorder_of(self, params: SimParams) -> TickRecorder | None:
        if not params.record:
            return None
        from arm_sim.ros.record.node_recorder import attach_recorder  # not imported otherwise

        return attach_recorder(self, params.record, self.engine, self.inputs, self.outputs)

    def _start(self) -> None:
        params = self.params
        self.get_logger().info(greeting(self.simulator, params))
        if self.recorder is not None:
            self.get_logger().info(f"recording to {self.recorder.path}")
        if unused := params.unused:
            self.get_logger().warning(
                f"parameters without effect, since time steps are triggered by "
                f"{params.tick_source}: {', '.join(unused)}"
            )
        self.outputs.publish()
        self.outputs.stamps.release()  # building took time
        if self.lockstep is not None:
            self._claim_privileges()
            self.lockstep.await_answer()
        elif params.realtime:
            middleware = MiddlewareThreads()
            self.engine.arriving = lambda: middleware.busy
            self.engine.queue.is_served = True
            self.outputs.energy.watch(params.energy_period / (params.realtime_factor or 1.0))
            self.loop.start()

    def _apply(self, params: SimParams) -> None:
        self.engine.configure(params.command_timeout, params.stale_policy)
        if self.recorder is not None:
            self.recorder.note(f"parameters: {params}")
        self.params = params

    def _claim_privileges(self) -> None:
        """Request the privileges of the ticking thread."""
        self.diagnostics.refused_privileges = refusals = self.params.claim()
        for refusal in refusals:
            self.get_logger().warning(f"not granted: {refusal}")

    def _reset_counters(self) -> None:
        self.loop.reset()
        self.engine.commands.reset_counters()
        self.engine.arbiter.reset_counters()
        self.engine.round_trip.reset()
        self.inputs.reset_counters()
        if self.lockstep is not None:
            self.lockstep.reset_counters()

    def tick(self) -> None:
        """Run requests since the last tick, then advance by one tick unless paused."""
        self.engine.tick()

    def _report_failure(self) -> None:
        if self.context.ok():
            self.get_logger().error(self.engine.failure)

    def _report_pause(self) -> None:
        happened = "paused" if self.engine.paused else "running on"
        self.get_logger().info(f"{happened} at {1e-9 * self.engine.stamp:.3f} s")

    def _report_staleness(self) -> None:
        if self.engine.commands.stale:
            after, policy = self.params.command_timeout, in_force(self.params.stale_policy)
            self.get_logger().warning(f"no command for {after:g} s: {policy}")
        else:
            self.get_logger().info("commands have resumed")

    def _note_competitors(self) -> None:
        self.engine.queue.ring()  # C does not check whose states commands answer
        if self.recorder is not None:
            message = self.competitors.alarm.message
            self.recorder.note(message or "no other publisher of joint states")

    def destroy_node(self) -> None:
        """Stop ticking, log the timing, and destroy the node."""
        if self._complete:
            self._end()
        super().destroy_node()

    def _end(self) -> None:
        self.loop.stop()
        self.engine.queue.is_served = False
        self.outputs.energy.close()
        self.inputs.polled.close()
        self.competitors.close()
        self.standard.close()
        if self._background is not None:
            self._background.close()
        if self.recorder is not None:
            self.recorder.close()
            self.get_logger().info(
                f"recorded {self.recorder.ticks} time steps ({self.recorder.lost} lost), "
                f"{self.recorder.thread.written} bytes, to {self.recorder.path}"
            )
        if self.params.tick_source == CLOCK:
            loop, round_trip = self.loop.report(), self.engine.round_trip.histogram.percentiles()
            trips = f", round trip {round_trip}" if round_trip.count else ""
            self.get_logger().info(
                f"{loop.ticks} cycles, {loop.rate:.2f} per second, {loop.missed} deadlines "
                f"missed, {loop.dropped} dropped; lateness {loop.lateness}; "
                f"{round_trip.count} answers{trips}"
            )
