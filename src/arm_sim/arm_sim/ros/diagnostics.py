# SPDX-License-Identifier: Apache-2.0
"""Condition of the parts of the sim node, for ``/diagnostics``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from rclpy.node import Node

from arm_dynamics.exceptions import known_names
from arm_dynamics.ros.common.diagnostics import ERROR, WARN, Finding, Growth, Lateness
from arm_dynamics.ros.interfaces import JOINT_COMMANDS
from arm_sim.ros.commands.latest import in_force
from arm_sim.ros.competing_publishers import CompetingPublishers
from arm_sim.ros.display import Display
from arm_sim.ros.inputs import Inputs
from arm_sim.ros.lockstep import Lockstep
from arm_sim.ros.outputs import Outputs
from arm_sim.ros.sim_params import SimParams
from arm_sim.ros.tick_engine import TickEngine
from arm_sim.ros.timing.realtime_loop import RealtimeLoop

if TYPE_CHECKING:
    from arm_sim.ros.record.ticks import TickRecorder

UNBALANCED = 1e-3
"""Error of the energy balance, relative to the energy that moved, that is worth a warning."""


@dataclass
class SimDiagnostics:
    """Inspects the parts of a sim node; reports counts that grew since the last inspection."""

    node: Node
    params: SimParams
    engine: TickEngine
    loop: RealtimeLoop
    inputs: Inputs
    outputs: Outputs
    display: Display
    lockstep: Lockstep | None
    recorder: TickRecorder | None
    competitors: CompetingPublishers
    lateness: Lateness
    refused_privileges: Sequence[str] = ()  # since the ticking thread has begun
    growth: Growth = field(default_factory=Growth)

    def __call__(self) -> list[Finding]:
        """Inspect every part."""
        findings = [self._check_loop(), self._check_commands(), self._check_simulation()]
        if self.recorder is not None:
            findings.append(self._check_recorder(self.recorder))
        if self.lockstep is not None:
            findings.append(self._check_lockstep(self.lockstep))
        return findings

    def _check_loop(self) -> Finding:
        report, params, finding = self.loop.report(), self.params, Finding("loop")
        finding.values = {
            "rate [Hz]": report.rate, "ticks": report.ticks, "missed": report.missed,
            "dropped": report.dropped, "lateness p50 [s]": report.lateness.p50,
            "lateness p99 [s]": report.lateness.p99, "lateness max [s]": report.lateness.max,
            "realtime factor": params.realtime_factor, "overrun": params.overrun,
            "driven by": params.tick_source,
            "messages": "in C", "ticks made": "in C",
        }  # fmt: skip
        self.growth.warn(finding, report.missed, "time step", "began after the next one was due")
        self.growth.warn(finding, report.dropped, "time step", "dropped")
        for refusal in self.refused_privileges:
            finding.add(WARN, refusal)
        return finding

    def _check_commands(self) -> Finding:
        engine, finding = self.engine, Finding("commands")
        arbiter, slot, policy = engine.arbiter, engine.commands, engine.stale_policy
        inputs, trip = self.inputs, self.engine.round_trip.histogram.percentiles()
        topic = self.node.resolve_topic_name(JOINT_COMMANDS.name)
        publishers = self.node.count_publishers(topic)
        finding.values = {
            "age [s]": slot.age * engine.simulator.dt, "stale": bool(slot.stale),
            "stale count": slot.stale_count, "extended": slot.extended, "policy": policy,
            "held": engine.held,
            "passed over": inputs.refused,
            "sources": known_names(arbiter.sources), "publishers": publishers,
            "oldest [s]": self.lateness.longest,
            "answers": trip.count, "round trip p50 [s]": trip.p50,
            "round trip p99 [s]": trip.p99, "pushed frames": ", ".join(engine.wrenches.active),
            "wrenches passed over": inputs.refused_wrenches,
        }  # fmt: skip
        stopped = self.growth.of("stale", slot.stale_count)
        if slot.stale:
            finding.add(WARN, f"commands stopped: {in_force(policy)}")
        elif stopped:
            finding.add(WARN, "commands stopped, and have resumed")
        late = "with an old command: the middleware has to catch up"
        self.growth.warn(finding, slot.extended, "time step", late)
        finding.add(WARN, self.lateness.message)
        self.growth.warn(finding, inputs.refused, "command", "ignored")
        self.growth.warn(finding, inputs.refused_wrenches, "wrench message", "ignored")
        if self.growth.of("conflicts", arbiter.refused) or arbiter.conflict:
            finding.add(ERROR, arbiter.last_refusal)
        elif publishers > 1 and len(arbiter.sources) < 2:
            finding.add(WARN, f"{publishers} publishers on {topic}")
        return finding

    def _check_simulation(self) -> Finding:
        engine, finding = self.engine, Finding("simulation")
        state, stops = engine.queue.run(
            lambda: (engine.simulator.state, engine.simulator.stop_torque)
        )
        names, account = engine.simulator.joint_names, self.outputs.energy.account()
        pushed = [f"{name} {x:.4g}" for name, x in zip(names, stops, strict=True) if x != 0.0]
        finding.values = {
            "time [s]": state.time, "stamps": self.outputs.stamps.name, "tf": self.display.frames,
            "paused": engine.paused, "diverged": bool(engine.failure),
            "at stops": ", ".join(pushed) or "none",
            "method": engine.simulator.choice.method.name,
            "error estimate": state.error,
            "time-stepped ticks": state.time_stepped,
            "energy balance [J]": "closed" if account is None else account.balance,
            "energy [J]": "closed" if account is None else account.total,
        }  # fmt: skip
        piled_up = "of first order: too many events"
        self.growth.warn(finding, state.time_stepped, "time step", piled_up)
        if self.outputs.clock is not None:
            finding.add(ERROR, self.outputs.clock.alarm.message)
        finding.add(ERROR, self.competitors.alarm.message)
        finding.add(ERROR, engine.failure)
        if (error := engine.energy.error) > UNBALANCED:
            finding.add(
                WARN,
                f"the energy account is off by {error:.2g} of the energy that moved, more than "
                f"{UNBALANCED:g}: with time steps of {engine.simulator.dt:g} s reduce dt or set a "
                "tolerance",
            )
        return finding

    def _check_recorder(self, recorder: TickRecorder) -> Finding:
        finding, thread = Finding("recording"), recorder.thread
        finding.values = {
            "path": str(recorder.path), "ticks": recorder.ticks, "ticks lost": recorder.lost,
            "messages lost": thread.lost, "written [B]": thread.written,
        }  # fmt: skip
        for count, item in ((recorder.lost, "time step"), (thread.lost, "message")):
            self.growth.warn(finding, count, item, f"not in the recording: {thread.trouble}")
        finding.add(ERROR, thread.failure)
        return finding

    def _check_lockstep(self, lockstep: Lockstep) -> Finding:
        finding = Finding("lockstep")
        finding.values = {
            "asked again": lockstep.repeated, "ignored": lockstep.waiting.ignored,
            "partner gone": lockstep.gone,
        }  # fmt: skip
        self.growth.warn(finding, lockstep.repeated, "state", "published again")
        if lockstep.gone:
            finding.add(ERROR, "the partner does not answer; time stands still")
        return finding
