# SPDX-License-Identifier: Apache-2.0
"""What the sim node finds out about itself, for ``/diagnostics``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from arm_dynamics.ros.common.diagnostics import ERROR, WARN, Finding
from arm_dynamics.ros.joint_state.compiled import native

if TYPE_CHECKING:
    from arm_sim.ros.sim_node import SimNode


class Findings:
    """Looks at a sim node; counts that grew since the last look are complained about."""

    def __init__(self, node: SimNode) -> None:
        """Prepare to look at ``node``."""
        self._node = node
        self._before: dict[str, int] = {}

    def __call__(self) -> list[Finding]:
        """Look at every part."""
        found = [self._loop(), self._commands(), self._simulation()]
        return [*found, self._lockstep()] if self._node.lockstep is not None else found

    def _grown(self, name: str, count: int) -> int:
        before, self._before[name] = self._before.get(name, 0), count
        return count - before

    def _loop(self) -> Finding:
        node = self._node
        report, found = node.loop.report(), Finding("loop")
        found.values = {
            "rate [Hz]": report.rate, "ticks": report.ticks, "missed": report.missed,
            "dropped": report.dropped, "lateness p50 [s]": report.lateness.p50,
            "lateness p99 [s]": report.lateness.p99, "lateness max [s]": report.lateness.max,
            "realtime factor": node.params.realtime_factor, "overrun": node.params.overrun,
            "driven by": node.driven_by, "executor": node.executor_name,
            "messages": "in C" if native() is not None else "in Python",
        }  # fmt: skip
        if missed := self._grown("missed", report.missed):
            found.complain(WARN, f"{missed} ticks began after the next one was due")
        if dropped := self._grown("dropped", report.dropped):
            found.complain(WARN, f"{dropped} ticks dropped")
        for refusal in node.refused_privileges:
            found.complain(WARN, refusal)
        return found

    def _commands(self) -> Finding:
        node, found = self._node, Finding("commands")
        arbiter, commands, trip = node.input.arbiter, node.commands, node.round_trip()
        publishers = node.command_publishers()
        found.values = {
            "age [s]": commands.age * node.simulator.dt, "stale": commands.stale,
            "stale count": commands.stale_count, "policy": node.params.stale_policy,
            "passed over": node.input.passed_over, "sources": ", ".join(arbiter.sources),
            "publishers": publishers, "answers": trip.count, "round trip p50 [s]": trip.p50,
            "round trip p99 [s]": trip.p99, "pushed frames": ", ".join(node.push.active),
            "wrenches passed over": node.push.refused,
        }  # fmt: skip
        stopped = self._grown("stale", commands.stale_count)
        if commands.stale:
            found.complain(WARN, f"commands stopped: the policy '{node.params.stale_policy}' acts")
        elif stopped:
            found.complain(WARN, "commands stopped, and are back")
        if passed := self._grown("passed", node.input.passed_over):
            found.complain(WARN, f"{passed} commands passed over")
        if pushes := self._grown("pushes", node.push.refused):
            found.complain(WARN, f"{pushes} wrenches passed over")
        if self._grown("conflicts", arbiter.refused) or arbiter.conflict:
            found.complain(ERROR, arbiter.words)
        elif publishers > 1 and len(arbiter.sources) < 2:
            found.complain(WARN, f"{publishers} publishers on {node.command_topic}")
        return found

    def _simulation(self) -> Finding:
        node, found = self._node, Finding("simulation")
        state, account = node.errands.run(lambda: node.simulator.state), node.energy_account()
        found.values = {
            "time [s]": state.time, "paused": node.paused, "diverged": bool(node.trouble),
            "method": node.simulator.choice.method.name, "error estimate": state.error,
            "energy balance [J]": "closed" if account is None else account.balance,
            "energy [J]": "closed" if account is None else account.total,
        }  # fmt: skip
        if node.trouble:
            found.complain(ERROR, node.trouble)
        return found

    def _lockstep(self) -> Finding:
        lockstep, found = self._node.lockstep, Finding("lockstep")
        assert lockstep is not None
        found.values = {
            "asked again": lockstep.asked_again, "ignored": lockstep.ignored,
            "partner gone": lockstep.gone,
        }  # fmt: skip
        if again := self._grown("again", lockstep.asked_again):
            found.complain(WARN, f"{again} states had to be published again")
        if lockstep.gone:
            found.complain(ERROR, "the partner gives no answer; time stands still")
        return found
