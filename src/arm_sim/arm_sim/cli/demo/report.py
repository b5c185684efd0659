# SPDX-License-Identifier: Apache-2.0
"""Results of a demo run: numbers, a table, a figure, and whether the loop was closed."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_sim.cli.demo.observer import Observations
from arm_sim.cli.output import table
from arm_sim.figures import COLORS, WIDTH, figure, joint_words, units, widest_columns

if TYPE_CHECKING:
    from rich.table import Table

    from arm_sim.cli.demo.motion import DemoMotion

Numbers = dict[str, Any]

# Requirements for a closed loop; a good run is far better than these.
LEAST_RATE = 0.8  # fraction of the ticks of real time
GOOD_RATE = 0.99  # fraction below which a remark is printed
MOST_LATE_TICKS = 0.02  # fraction of late ticks from which on the machine is busy
LEAST_COMMANDS = 100  # commands per second of the motion
MOST_ERROR = 0.02  # [rad, m] RMS
GOAL_TOLERANCE = 0.02  # [rad, m] from the goal at the end

DOTS = 30  # number of service answers that are drawn
COINCIDENCE = 5e-3  # of all positions: references that are closer to them are not drawn
SMALL_TORQUE = 0.1  # of the largest torque: joints with less are drawn in a panel of their own
CIRCLES: dict[str, Any] = {"ls": "", "marker": "o", "mfc": "white", "ms": 3.0, "mew": 0.8}


def numbers(motion: DemoMotion, observed: Observations, clock: dict[str, Any]) -> Numbers:
    """The results by name: times in [s], errors in ``unit``, energies in [J].

    ``clock`` is the sim node's own report.
    """
    model, duration = motion.model, motion.trajectory.duration
    loop, trip, latencies = clock["loop"], clock["round_trip"], observed.latencies
    percentiles = np.percentile(latencies if len(latencies) else np.nan, (50, 99, 100))
    p50, p99, longest = percentiles.tolist()
    error = observed.error[observed.time <= duration]
    return {
        "robot": model.pin.name, "joints": model.n,
        "unit": units(model.joint_types, "rad", "m", " or "), "duration": duration,
        "ticks": loop["ticks"], "rate": loop["ticks"] / loop["elapsed"],
        "wanted_rate": 1.0 / model.scene.sim.dt,
        "missed": loop["missed"], "dropped": loop["dropped"],
        **{f"lateness_{name}": loop["lateness"][name] for name in ("p50", "p99", "max")},
        "commands": trip["count"],
        **{f"round_trip_{name}": trip[name] for name in ("p50", "p99", "max")},
        "questions": len(latencies),
        "service_p50": p50, "service_p99": p99, "service_max": longest,
        "torque_difference": _largest(observed.query_effort - observed.query_command),
        "error_rms": float(np.sqrt(np.mean(error**2))), "error_max": float(abs(error).max()),
        "goal_distance": _largest(observed.position[-1] - np.asarray(motion.waypoints[-1].q)),
        "effort_share": motion.effort_share,
        "energy_moved": float(abs(np.diff(observed.work)).sum()),
        "energy_dissipated": float(np.diff(observed.heat).sum()),
        "energy_balance": _largest(observed.residual - observed.residual[:1]),
    }  # fmt: skip


def _largest(values: Array) -> float:
    return float(abs(values).max()) if values.size else float("nan")


def complaints(n: Numbers) -> list[str]:
    """Reasons why the loop is not considered closed; empty if it is."""
    error = f"{n['error_rms']:.3g} {n['unit']} RMS"
    distance = f"{n['goal_distance']:.3g} {n['unit']}"
    required = {
        _slow(n): n["rate"] >= LEAST_RATE * n["wanted_rate"],
        f"only {n['commands']} of {n['ticks']} states were answered by a command":
            n["commands"] >= LEAST_COMMANDS * n["duration"],
        "the dynamics node answered no torque query": n["questions"],
        f"tracking error {error}; allowed: {MOST_ERROR:g}": n["error_rms"] <= MOST_ERROR,
        f"the arm stopped {distance} from its goal; allowed: {GOAL_TOLERANCE:g}":
            n["goal_distance"] <= GOAL_TOLERANCE,
    }  # fmt: skip
    return [complaint for complaint, holds in required.items() if not holds]


def remarks(n: Numbers) -> list[str]:
    """Deficiencies although the loop was closed."""
    texts = [_slow(n)] if n["rate"] < GOOD_RATE * n["wanted_rate"] else []
    return [*texts, _busy(n)] if _late(n) else texts


def _slow(n: Numbers) -> str:
    return (
        f"the simulator executed {n['rate']:.1f} time steps per second instead of "
        f"{n['wanted_rate']:g}: this machine is too slow or too busy"
    )


def cause(n: Numbers) -> str:
    """What complaints are due to: a busy machine, with what shows it, or the loop."""
    idle = os.getloadavg()[0] <= len(os.sched_getaffinity(0)) and not _late(n)
    return "the loop was not closed" if idle else _busy(n)


def _late(n: Numbers) -> bool:
    return bool(n["missed"] > MOST_LATE_TICKS * n["ticks"])


def _busy(n: Numbers) -> str:
    return (
        f"this machine was too busy: {load()}; {n['missed']} of {n['ticks']} cycles were late by "
        f"more than a cycle, round trips took up to {1e3 * n['round_trip_max']:.0f} ms"
    )


def load() -> str:
    """The load of the machine in the last minute."""
    return f"load {os.getloadavg()[0]:.1f} on {len(os.sched_getaffinity(0))} cores"


def result_table(n: Numbers) -> Table:
    """The numbers as a table."""

    def times(name: str) -> tuple[str, str]:
        p50, p99, longest = (1e6 * n[f"{name}_{key}"] for key in ("p50", "p99", "max"))
        return f"{p50:.0f} µs", f"median; p99 {p99:.0f} µs, max {longest:.0f} µs"

    def error(name: str) -> tuple[str, str]:
        degrees = f"{np.degrees(n[name]):.1e} degrees" if n["unit"] == "rad" else ""
        return f"{n[name]:.1e} {n['unit']}", degrees

    ahead = ", catching up" if n["rate"] > 1.001 * n["wanted_rate"] else ""
    missed = f"{n['missed']} deadlines missed, {n['dropped']} skipped"
    difference = f"within {n['torque_difference']:.2g} N m of the command"
    moved = f"residual at most; actuator work {n['energy_moved']:.3g} J"
    return table(("", f"{n['robot']}, {n['joints']} joints", ""), [
        ("control cycles", f"{n['ticks']}", missed),
        ("rate", f"{n['rate']:.2f} Hz", f"{n['wanted_rate']:g} Hz expected{ahead}"),
        ("lateness", *times("lateness")),
        ("command round trip", *times("round_trip")),
        ("commands", f"{n['commands']}", f"of {n['ticks']} states answered"),
        ("service latency", *times("service")),
        ("torque queries", f"{n['questions']}", difference),
        ("tracking error RMS", *error("error_rms")),
        ("tracking error max", *error("error_max")),
        ("energy balance", f"{n['energy_balance']:.1e} J", moved),
    ], text=(0, 2))  # fmt: skip


def draw(
    file: Path, run: Observations, names: Sequence[str], types: Sequence[str], n: Numbers
) -> None:  # fmt: skip
    """Draw a PNG; ``types`` are the joint types, ``n`` the results by name."""
    prefix, scale = ("m", 1e3) if abs(run.error).max() > 1e-4 else ("µ", 1e6)
    unit = units(types, f"{prefix}rad", f"{prefix}m")
    title = (
        f"{n['robot']}: computed torque at {n['wanted_rate']:g} Hz, tracking error "
        f"{scale * n['error_rms']:.3g} {unit} RMS"
    )
    joints = widest_columns(run.position)
    short = [joint_words(names)[i] for i in joints]
    effort, answers = run.effort[:, joints], run.query_effort[:, joints]
    largest, every = np.max(abs(effort), axis=0), max(1, len(answers) // DOTS)
    weak = largest < SMALL_TORQUE * largest.max()  # their curves would coincide at zero
    panels, size = (4, 7.0) if weak.any() else (3, 6.0)
    with figure(file, panels, 1, (WIDTH, size), sharex=True) as (position, error, *torques):
        position.plot(run.time, run.position[:, joints], label=short)
        if abs(run.error).max() > COINCIDENCE * np.ptp(run.position):
            wide = {"color": "0.8", "lw": 3.5, "zorder": 1.5}
            position.plot(run.time, run.reference[:, joints], label="reference", **wide)
        position.set(title=title, ylabel=f"position [{units(types, 'rad', 'm')}]")
        error.plot(run.time, scale * run.error[:, joints], lw=1.0)
        error.set_ylabel(f"error [{unit}]")
        for torque, drawn in zip(torques, (~weak, weak), strict=False):
            for i in np.flatnonzero(drawn):
                torque.plot(run.time, effort[:, i], color=COLORS[i])
                dots = run.query_time[::every], answers[::every, i]
                torque.plot(*dots, color=COLORS[i], **CIRCLES)
            size = "small torque" if drawn is weak else "torque"
            torque.set_ylabel(f"{size} [{units(types, 'N m', 'N')}]")
        torques[0].plot([], [], color="0.4", label="answer of the dynamics service", **CIRCLES)
        torques[-1].set(xlabel="time [s]", xlim=(0.0, max(n["duration"], float(run.time[-1]))))
