# SPDX-License-Identifier: Apache-2.0
"""Results of a demo run: numbers, a table, and whether the loop was closed."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_sim.cli.demo.observer import Seen
from arm_sim.cli.output import table
from arm_sim.figures import units

if TYPE_CHECKING:
    from rich.table import Table

    from arm_sim.cli.demo.motion import DemoMotion


# Requirements for a closed loop; a good run is far better than these.
LEAST_RATE = 0.8  # fraction of the ticks of real time
GOOD_RATE = 0.99  # fraction below which a remark is printed
MOST_LATE = 0.02  # fraction of late ticks from which on the machine is busy
LEAST_COMMANDS = 100  # commands per second of the motion
MOST_ERROR = 0.02  # [rad, m] RMS
ARRIVED = 0.02  # [rad, m] from the goal at the end


@dataclass(frozen=True)
class Numbers:
    """Results; times in [s], errors in ``unit``, energies in [J]."""

    robot: str
    joints: int
    unit: str
    duration: float
    ticks: int
    rate: float
    wanted_rate: float
    missed: int
    dropped: int
    lateness_p50: float
    lateness_p99: float
    lateness_max: float
    commands: int
    round_trip_p50: float
    round_trip_p99: float
    round_trip_max: float
    questions: int
    service_p50: float
    service_p99: float
    service_max: float
    torque_difference: float
    error_rms: float
    error_max: float
    goal_distance: float
    effort_share: float
    energy_moved: float
    energy_dissipated: float
    energy_balance: float


def numbers(motion: DemoMotion, seen: Seen, clock: dict[str, Any]) -> Numbers:
    """Collect the results; ``clock`` is the sim node's own report."""
    model, duration = motion.model, motion.trajectory.duration
    goal = np.asarray(motion.waypoints[-1].q)
    loop, trip = clock["loop"], clock["round_trip"]
    asked = len(seen.latencies)
    p50, p99, longest = np.percentile(seen.latencies if asked else np.nan, (50, 99, 100)).tolist()
    during = seen.time <= duration
    return Numbers(
        robot=model.pin.name, joints=model.n, duration=duration,
        unit=units(model.joint_types, "rad", "m", " or "),
        ticks=loop["ticks"], rate=loop["ticks"] / loop["elapsed"],
        wanted_rate=1.0 / model.scene.sim.dt,
        missed=loop["missed"], dropped=loop["dropped"],
        lateness_p50=loop["lateness"]["p50"], lateness_p99=loop["lateness"]["p99"],
        lateness_max=loop["lateness"]["max"],
        commands=trip["count"], round_trip_p50=trip["p50"], round_trip_p99=trip["p99"],
        round_trip_max=trip["max"],
        questions=asked, service_p50=p50, service_p99=p99, service_max=longest,
        torque_difference=_largest(seen.asked_effort - seen.asked_for),
        error_rms=float(np.sqrt(np.mean(seen.error[during] ** 2))),
        error_max=float(np.abs(seen.error[during]).max()),
        goal_distance=float(np.abs(seen.position[-1] - goal).max()),
        effort_share=motion.effort_share,
        energy_moved=float(np.abs(np.diff(seen.energy[:, 3])).sum()),
        energy_dissipated=float(seen.energy[:, 4].max(initial=0.0)),
        energy_balance=_largest(seen.energy[:, 5]),
    )  # fmt: skip


def _largest(values: Array) -> float:
    return float(np.abs(values).max()) if values.size else float("nan")


def complaints(n: Numbers) -> list[str]:
    """Reasons why the loop is not considered closed; empty if it is."""
    found = []
    if not n.rate >= LEAST_RATE * n.wanted_rate:
        found.append(_slow(n))
    if not n.commands >= LEAST_COMMANDS * n.duration:
        found.append(f"only {n.commands} of {n.ticks} states were answered by a command")
    if not n.questions:
        found.append("the dynamics node answered no torque query")
    if not n.error_rms <= MOST_ERROR:
        found.append(f"tracking error {n.error_rms:.3g} {n.unit} RMS; allowed: {MOST_ERROR:g}")
    if not n.goal_distance <= ARRIVED:
        found.append(
            f"the arm stopped {n.goal_distance:.3g} {n.unit} from its goal; allowed: {ARRIVED:g}"
        )
    return found


def remarks(n: Numbers) -> list[str]:
    """Deficiencies although the loop was closed."""
    return [_slow(n)] if n.rate < GOOD_RATE * n.wanted_rate else []


def cause(n: Numbers) -> str:
    """What complaints are due to: a busy machine, with what shows it, or the loop."""
    if os.getloadavg()[0] <= len(os.sched_getaffinity(0)) and n.missed <= MOST_LATE * n.ticks:
        return "the loop was not closed"
    return (
        f"this machine was too busy: {load()}; {n.missed} of {n.ticks} cycles were late by more "
        f"than a cycle, round trips took up to {1e3 * n.round_trip_max:.0f} ms"
    )


def load() -> str:
    """The load of the machine in the last minute."""
    return f"load {os.getloadavg()[0]:.1f} on {len(os.sched_getaffinity(0))} cores"


def _slow(n: Numbers) -> str:
    return (
        f"the simulator executed {n.rate:.1f} time steps per second instead of {n.wanted_rate:g}: "
        "this machine is too slow or too busy"
    )


def result_table(n: Numbers) -> Table:
    """The numbers as a table."""
    asked = f"within {n.torque_difference:.2g} N m of the command"
    balance = f"residual at most; actuator work {n.energy_moved:.3g} J"
    return table(("", f"{n.robot}, {n.joints} joints", ""), [
        ("control cycles", f"{n.ticks}", f"{n.missed} deadlines missed, {n.dropped} skipped"),
        ("rate", f"{n.rate:.2f} Hz", f"{n.wanted_rate:g} Hz expected"),
        ("lateness", *_times(n.lateness_p50, n.lateness_p99, n.lateness_max)),
        ("command round trip", *_times(n.round_trip_p50, n.round_trip_p99, n.round_trip_max)),
        ("commands", f"{n.commands}", f"of {n.ticks} states answered"),
        ("service latency", *_times(n.service_p50, n.service_p99, n.service_max)),
        ("torque queries", f"{n.questions}", asked),
        ("tracking error RMS", *_error(n.error_rms, n.unit)),
        ("tracking error max", *_error(n.error_max, n.unit)),
        ("energy balance", f"{n.energy_balance:.1e} J", balance),
    ], text=(0, 2))  # fmt: skip


def _times(p50: float, p99: float, longest: float) -> tuple[str, str]:
    return f"{1e6 * p50:.0f} µs", f"median; p99 {1e6 * p99:.0f} µs, max {1e6 * longest:.0f} µs"


def _error(value: float, unit: str) -> tuple[str, str]:
    degrees = f"{np.degrees(value):.1e} degrees" if unit == "rad" else ""
    return f"{value:.1e} {unit}", degrees
