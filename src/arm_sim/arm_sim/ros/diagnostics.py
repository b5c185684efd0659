# SPDX-License-Identifier: Apache-2.0
"""Condition of the parts of the sim node, for ``/diagnostics``."""

from typing import Any

from arm_dynamics.exceptions import known_names
from arm_dynamics.ros.common.diagnostics import ERROR, WARN, Finding, Growth, Lateness
from arm_dynamics.ros.interfaces import JOINT_COMMANDS
from arm_sim.ros.commands.latest import in_force

# Error of the energy balance, relative to the energy that moved, that is worth a warning
UNBALANCED = 1e-3


class SimDiagnostics:
    """Inspects the parts of a sim node; reports counts that grew since the last inspection.

    Args:
        node: The ``SimNode``, which has all of its parts.

    Attributes:
        refused_privileges: Those that its ticking thread was not granted.
    """

    def __init__(self, node: Any) -> None:
        self._node, self._growth, self.refused_privileges = node, Growth(), list[str]()
        period, trip = node.params.publish_every * node.simulator.dt, node.engine.round_trip
        text = "commands were up to {:.2g} s old"
        self._lateness = Lateness(node, trip.take_oldest, period, text)

    def __call__(self) -> list[Finding]:
        """Inspect every part."""
        findings = [self._check_loop(), self._check_commands(), self._check_simulation()]
        if self._node.recorder is not None:
            findings.append(self._check_recorder())
        if self._node.lockstep is not None:
            findings.append(self._check_lockstep())
        return findings

    def _check_loop(self) -> Finding:
        report, params, finding = self._node.loop.report(), self._node.params, Finding("loop")
        finding.values = {
            "rate [Hz]": report.rate, "ticks": report.ticks, "missed": report.missed,
            "dropped": report.dropped, "lateness p50 [s]": report.lateness.p50,
            "lateness p99 [s]": report.lateness.p99, "lateness max [s]": report.lateness.max,
            "realtime factor": params.realtime_factor, "overrun": params.overrun,
            "driven by": params.tick_source,
        }  # fmt: skip
        self._growth.warn(finding, report.missed, "time step", "began after the next one was due")
        self._growth.warn(finding, report.dropped, "time step", "dropped")
        for refusal in self.refused_privileges:
            finding.add(WARN, refusal)
        return finding

    def _check_commands(self) -> Finding:
        node, engine, finding = self._node, self._node.engine, Finding("commands")
        arbiter, slot, policy = engine.arbiter, engine.commands, engine.stale_policy
        inputs, trip = node.inputs, node.engine.round_trip.histogram.percentiles()
        topic = node.resolve_topic_name(JOINT_COMMANDS.name)
        publishers = node.count_publishers(topic)
        finding.values = {
            "age [s]": slot.age * engine.simulator.dt, "stale": bool(slot.stale),
            "stale count": slot.stale_count, "extended": slot.extended, "policy": policy,
            "held": engine.held,
            "passed over": inputs.refused,
            "sources": known_names(arbiter.sources), "publishers": publishers,
            "oldest [s]": self._lateness.longest,
            "answers": trip.count, "round trip p50 [s]": trip.p50,
            "round trip p99 [s]": trip.p99, "pushed frames": ", ".join(engine.wrenches.active),
            "wrenches passed over": inputs.refused_wrenches,
        }  # fmt: skip
        stopped = self._growth.update("stale", slot.stale_count)
        if slot.stale:
            finding.add(WARN, f"commands stopped: {in_force(policy)}")
        elif stopped:
            finding.add(WARN, "commands stopped, and have resumed")
        extended = "with an old command: the middleware has to catch up"
        self._growth.warn(finding, slot.extended, "time step", extended)
        finding.add(WARN, self._lateness.message)
        self._growth.warn(finding, inputs.refused, "command", "ignored")
        self._growth.warn(finding, inputs.refused_wrenches, "wrench message", "ignored")
        if self._growth.update("conflicts", arbiter.refused) or arbiter.has_conflict:
            finding.add(ERROR, arbiter.last_refusal)
        elif publishers > 1 and len(arbiter.sources) < 2:
            finding.add(WARN, f"{publishers} publishers on {topic}")
        return finding

    def _check_simulation(self) -> Finding:
        node, engine, finding = self._node, self._node.engine, Finding("simulation")
        simulator = engine.simulator
        state, stops = engine.queue.run(lambda: (simulator.state, simulator.stop_torque))
        names, account = simulator.joint_names, node.outputs.energy.account()
        pushed = [f"{name} {x:.4g}" for name, x in zip(names, stops, strict=True) if x != 0.0]
        finding.values = {
            "time [s]": state.time, "stamps": node.outputs.stamps.name,
            "tf": node.display.frames if node.display else "off", "paused": engine.paused,
            "diverged": bool(engine.failure), "at stops": ", ".join(pushed) or "none",
            "method": simulator.choice.method.name,
            "error estimate": state.error,
            "time-stepped ticks": state.time_stepped,
            "energy balance [J]": "closed" if account is None else account.balance,
            "energy [J]": "closed" if account is None else account.total,
        }  # fmt: skip
        piled_up = "of first order: too many events"
        self._growth.warn(finding, state.time_stepped, "time step", piled_up)
        if node.outputs.clock is not None:
            finding.add(ERROR, node.outputs.clock.alarm.message)
        finding.add(ERROR, node.competitors.alarm.message)
        finding.add(ERROR, engine.failure)
        if (error := engine.energy.error) > UNBALANCED:
            finding.add(
                WARN,
                f"the energy account is off by {error:.2g} of the energy that moved, more than "
                f"{UNBALANCED:g}: with time steps of {simulator.dt:g} s reduce dt or set a "
                "tolerance",
            )
        return finding

    def _check_recorder(self) -> Finding:
        finding, recorder = Finding("recording"), self._node.recorder
        thread = recorder.thread
        finding.values = {
            "path": str(recorder.path), "ticks": recorder.ticks, "ticks lost": recorder.lost,
            "messages lost": thread.lost, "written [B]": thread.written,
        }  # fmt: skip
        for count, item in ((recorder.lost, "time step"), (thread.lost, "message")):
            self._growth.warn(finding, count, item, f"not in the recording: {thread.trouble}")
        finding.add(ERROR, thread.failure)
        return finding

    def _check_lockstep(self) -> Finding:
        finding, lockstep = Finding("lockstep"), self._node.lockstep
        finding.values = {
            "asked again": lockstep.repeat_count, "ignored": lockstep.waiting.ignored,
            "partner gone": lockstep.is_partner_gone,
        }  # fmt: skip
        self._growth.warn(finding, lockstep.repeat_count, "state", "published again")
        if lockstep.is_partner_gone:
            finding.add(ERROR, "the partner does not answer; time stands still")
        return finding
