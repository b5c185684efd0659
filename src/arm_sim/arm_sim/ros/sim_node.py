# SPDX-License-Identifier: Apache-2.0
"""The sim node: a simulated arm that takes torques and says how it moves."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

from arm_dynamics.ros.common.diagnostics import Diagnosis
from arm_dynamics.ros.common.executor import run, surviving
from arm_dynamics.ros.common.params import declare, privileges, watch
from arm_sim.exceptions import SimulationDiverged
from arm_sim.ros import interfaces
from arm_sim.ros.commands.input import CommandInput, PushInput
from arm_sim.ros.commands.latest import Commands
from arm_sim.ros.diagnostics import Findings
from arm_sim.ros.energy_meter import Account
from arm_sim.ros.histogram import Percentiles
from arm_sim.ros.lockstep import Lockstep
from arm_sim.ros.outputs import Outputs
from arm_sim.ros.params import SimParams, simulator_of
from arm_sim.ros.realtime_loop import RealtimeLoop
from arm_sim.ros.services import SimServices
from arm_sim.ros.tick_queue import Errands

_PAUSED_PERIOD = 0.1  # [s] between joint states while time stands still
_PATIENCE = 1.0  # [s] after which a silent source is gone; a busy machine may well silence one


class SimNode(Node):
    """Integrates the arm from torque commands and publishes its joint states.

    With ``realtime`` a thread ticks by the clock; with ``lockstep`` the answer to a state makes
    the next tick; without either, whoever calls ``tick`` is the clock. What services ask for is
    done by the thread that ticks, between ticks.

    Attributes:
        simulator: The simulation.
        positions: Its joint positions in [rad] or [m] as they are now, shape (n,).
        commands: The slot for torques.
        params: Parameters in force.
        paused: Whether time stands still.
        trouble: Why the simulation stopped by itself, else empty.
        lockstep: What waits for answers, or None.
        loop: What ticks by the clock, and knows how well it was kept.
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
        self.params = params = declare(self, SimParams)
        self.simulator = simulator_of(scene, params)
        self.positions = self.simulator.x[: self.simulator.n]
        self.commands, self.errands = Commands(self.simulator.dynamics), Errands()
        self.paused, self.trouble, self._was_stale = params.paused, "", False
        self._privileges = privileges(params)
        self.refused_privileges: list[str] = []
        self.input = CommandInput(self, self.simulator, self.commands, self._ticks(_PATIENCE))
        pushed = self._ticks(params.wrench_timeout), params.wrench_reference
        self.push = PushInput(self, self.simulator, self.errands, *pushed)
        self._apply(params)
        self._outputs = Outputs(self, self.simulator, params)
        self.lockstep: Lockstep | None = None
        self.loop = self._make_loop()
        self._connect()
        watch(self, lambda: self.params, self._apply)
        self._start()

    def _connect(self) -> None:
        if self.params.lockstep:
            self.lockstep = Lockstep(self)
        else:
            self.input.open(self)
        for topic, callback in (
            (interfaces.COMMANDS, self.on_commands),
            (interfaces.WRENCH, self.push.on_wrench),
        ):
            self.create_subscription(
                topic.type, topic.name, surviving(self, callback), topic.subscribe
            )
        self.requests = SimServices(self)
        self.findings = Findings(self)
        self.diagnosis = Diagnosis(self, self.findings)

    def _make_loop(self) -> RealtimeLoop:
        factor = self.params.realtime_factor
        period = self.simulator.dt / factor if factor else 0.0
        return RealtimeLoop(
            self._tick_unattended, period, overrun=self.params.overrun, prepare=self._rise
        )

    def _start(self) -> None:
        self.publish_state()
        if self.lockstep is not None:
            self._rise()
            self.lockstep.wait()
        elif self.params.realtime:
            self.errands.served = True
            self.loop.start()

    def _apply(self, params: SimParams) -> None:
        timeout = self._ticks(params.command_timeout)
        self.commands.configure(timeout, params.stale_policy)
        self.input.arbiter.patience = max(timeout, self._ticks(_PATIENCE))
        self.params = params

    def _ticks(self, duration: float) -> int:
        return max(round(duration / self.simulator.dt), 1) if duration > 0.0 else 0

    def _rise(self) -> None:
        """Ask for what the thread that ticks is to have."""
        self.refused_privileges = self._privileges.claim()
        for refusal in self.refused_privileges:
            self.get_logger().warning(f"not granted: {refusal}")

    # --- ticking -------------------------------------------------------------------------------

    @property
    def driven_by(self) -> str:
        """What makes the simulation tick."""
        if self.lockstep is not None:
            return "lockstep"
        return "clock" if self.params.realtime else "hand"

    @property
    def running(self) -> bool:
        """Whether something else than a caller makes it tick."""
        return self.driven_by != "hand"

    def tick(self) -> None:
        """Do what was asked for since the last tick, then advance by one unless paused."""
        self.errands.serve()
        self.input.arbiter.tick()
        if self.paused:
            self.repeat(self.simulator.dt)
            return
        self.look_for_command()
        if self.params.wait_for_command and self.commands.empty:
            self.repeat(self.simulator.dt)
            return
        self.advance(self.commands.take(self.positions))
        if self.commands.stale is not self._was_stale:
            self._say_stale()

    def _tick_unattended(self) -> None:
        """Tick where nobody sees an exception."""
        try:
            self.tick()
        except Exception as error:
            self._stop(f"paused after an unexpected failure: {error!r}")

    def advance(self, tau: Sequence[float]) -> bool:
        """Make a tick with a torque; on divergence stop at the last good state and say False."""
        push = self.push.before_tick() if self.push.ready else None
        try:
            self.simulator.advance(tau)
        except SimulationDiverged as error:
            self._stop(
                f"paused, the last good state is kept; reset or set the joint state: {error}"
            )
            return False
        self._outputs.after_tick(push)
        return True

    def _stop(self, why: str) -> None:
        self.paused, self.trouble = True, why
        if self.context.ok():
            self.get_logger().error(why)

    def forget_trouble(self) -> None:
        """Forget why it stopped, and that commands were stale."""
        self.trouble, self._was_stale = "", False

    def _say_stale(self) -> None:
        self._was_stale = self.commands.stale
        if self._was_stale:
            self.get_logger().warning(
                f"no command for {self.params.command_timeout:g} s: "
                f"the policy '{self.params.stale_policy}' acts"
            )
        else:
            self.get_logger().info("commands are back")

    def tick_to_next_state(self) -> None:
        """Tick until the next state that is published."""
        self._tick_unattended()
        while not self.paused and self.simulator.step_count % self.params.publish_every:
            self._tick_unattended()

    def changed(self) -> None:
        """Tell partners and the energy account of a jump of the simulation."""
        self._outputs.restart()
        if self.lockstep is not None:
            self.lockstep.wait()

    def forget_counts(self) -> None:
        """Let all counters begin afresh."""
        self.loop.forget()
        self._outputs.round_trip.forget()
        self.commands.stale_count = self.input.passed_over = self.input.arbiter.refused = 0
        if self.lockstep is not None:
            self.lockstep.asked_again = self.lockstep.ignored = 0

    def repeat(self, call: float) -> None:
        """Publish the present state now and then; ``call`` is the time between calls in [s]."""
        self._outputs.repeat(_PAUSED_PERIOD, call)

    def publish_state(self) -> None:
        """Publish the present state now."""
        self._outputs.publish()

    @property
    def stamp(self) -> int:
        """Simulated time in [ns]."""
        return self._outputs.stamp()

    @property
    def executor_name(self) -> str:
        """Who dispatches this node's callbacks."""
        return type(self.executor).__name__ if self.executor is not None else "none"

    @property
    def command_topic(self) -> str:
        """Full name of the topic of commands."""
        return self.resolve_topic_name(interfaces.JOINT_COMMANDS.name)

    def command_publishers(self) -> int:
        """How many publish commands by joint name."""
        return self.count_publishers(self.command_topic)

    def energy_account(self) -> Account | None:
        """Energies since the account was opened; None before that."""
        self._outputs.audited = self.diagnosis.heard
        account: Account | None = self.errands.run(self._outputs.account)
        return account

    def round_trip(self) -> Percentiles:
        """How long commands took from state to effort."""
        return self._outputs.round_trip.percentiles()

    def destroy_node(self) -> None:
        """Stop ticking, say how it went, and take the node down."""
        self.loop.stop()
        self.errands.served = False
        self.input.close()
        if self.driven_by == "clock":
            loop, round_trip = self.loop.report(), self.round_trip()
            self.get_logger().info(
                f"{loop.ticks} ticks, {loop.rate:.2f} per second, {loop.missed} late by more than "
                f"a tick, {loop.dropped} dropped; lateness {loop.lateness}; "
                f"{round_trip.count} answers, round trip {round_trip}"
            )
        super().destroy_node()

    def look_for_command(self) -> None:
        """Take the commands that came since the last tick; the newest that is admitted counts.

        No newer one is sought behind the answer to the newest state, unless others command too:
        a look that finds nothing takes as long as one that finds something.
        """
        for _ in range(interfaces.MAX_COMMANDS):
            if (taken := self.input.next()) is None:
                return
            arrival, stamp = taken
            if stamp is None:
                continue
            self._outputs.round_trip.answered(stamp, arrival)
            if stamp and stamp == self._outputs.newest and self.input.arbiter.alone:
                return

    def on_joint_commands(self, raw: bytes, arrival: int = 0) -> int | None:
        """Take efforts by joint name from the JointState that came at ``arrival`` in [ns]."""
        stamp = self.input.joint_command(raw)
        if stamp is not None:
            self._outputs.round_trip.answered(stamp, arrival)
        return stamp

    def on_commands(self, message: Float64MultiArray) -> None:
        """Take efforts in model order."""
        self.input.bare_command(message)


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    sys.exit(run(SimNode, args))
