# SPDX-License-Identifier: Apache-2.0
"""Mechanisms of IFToMM's library of computational benchmark problems, by their names there.

The simple pendulum (A01) against its closed form, in every simulator; closed chains by this suite:
two four-bars in a row (A02) against their closed form, Andrews' mechanism (A03) against its
published solution (test/reference), Bricard's mechanism (A04) by its energy, and the stiff flyball
governor (A05) against its three coordinates. Problems: González, Dopico, Lugrís, Cuadrado, "A
benchmarking system for MBS simulation software", Multibody System Dynamics 16, 2006.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from arm_sim import Recording, SimulationDiverged, Simulator
from benchmarks.accuracy.problems import REFERENCE, reference
from benchmarks.measurement.timing import Cost, Job, steady
from benchmarks.peers.base import OURS, Contestant, decades, halvings
from benchmarks.robots.models import Robot
from benchmarks.studies.bench import Bench, Record

TARGET = 1e-6  # [rad], [m], or [J] of energy
MASS, LENGTH, OWN, GRAVITY = 1.0, 1.0, 1e-6, 9.81  # [kg], [m], [kg m²], [m/s²]
PENDULUM = f"""<robot name="pendulum"><link name="link0"/>
<link name="rod"><inertial><origin xyz="0 0 {-LENGTH}"/><mass value="{MASS}"/>
<inertia ixx="{OWN}" ixy="0" ixz="0" iyy="{OWN}" iyz="0" izz="{OWN}"/></inertial></link>
<joint name="pivot" type="continuous"><parent link="link0"/><child link="rod"/>
<axis xyz="0 1 0"/></joint></robot>"""
STEPS, TOLERANCES = halvings(16e-3, 6e-5), decades(-3, -12)
ANDREWS = 0.1581077119629904e2  # [rad], angle of the crank after 0.03 s
TORQUE = 0.033  # [N m] of its motor
Error = Callable[[Recording], float]


def run(bench: Bench) -> Record:
    """Least time of each to come within ``TARGET``."""
    jobs: dict[tuple[str, str], Job] = {}
    errors: dict[tuple[str, str], float] = {}
    task = f"A01, simple pendulum, 10 s to {TARGET:g} rad"
    robot = Robot("simple pendulum", PENDULUM, np.array([np.pi / 2]))
    for who in bench.each("IFToMM A01", bench.contestants):
        if found := _first(_swings(who, robot)):
            errors[task, who.name], jobs[task, who.name] = found
    chains = {
        f"A02, two four-bars, 10 s to {TARGET:g} rad": (
            REFERENCE / "parallelograms_2.yaml", 10.0, (), _four_bars()),
        f"A03, Andrews' mechanism, 0.03 s to {TARGET:g} rad": (
            "andrews", 0.03, (TORQUE,), _off("beta", ANDREWS)),
        f"A04, Bricard's mechanism, 10 s to {TARGET:g} J": (
            "bricard", 10.0, (), lambda run: float(np.ptp(run.energy))),
        f"A05, stiff governor, 10 s to {TARGET:g} m": (
            REFERENCE / "governor.yaml", 10.0, (), _governor()),
    }  # fmt: skip
    for task, chain in bench.each("IFToMM A02 to A05", list(chains.items())):
        for who, ways in _ways().items():
            if found := _first(_moves(*chain, ways)):
                errors[task, who], jobs[task, who] = found
    costs = bench.time("IFToMM's mechanisms", jobs)
    return {"rows": [_row(*key, costs[key], errors[key]) for key in jobs]}


def _row(task: str, who: str, cost: Cost, error: float) -> Record:
    return {"task": task, "who": who, "seconds": cost.median, "error": error,
            "rounds_s": list(cost.samples)}  # fmt: skip


def _first(tries: Iterator[tuple[float, Job]]) -> tuple[float, Job] | None:
    """The coarsest that is exact enough."""
    return next(((error, job) for error, job in tries if error <= TARGET), None)


def _swings(who: Contestant, robot: Robot) -> Iterator[tuple[float, Job]]:
    still = np.zeros(1)
    for setting in who.settings:
        trial = who.build(robot, setting)
        trial.reset(robot.q0, still)
        trial.advance(10.0)
        error = abs(float(trial.state()[0][0]) - _swung(10.0))
        yield error, steady(lambda t=trial: t.reset(robot.q0, still),
                            lambda t=trial: t.advance(10.0))  # fmt: skip


def _swung(t: float) -> float:
    """Angle from hanging of a pendulum that was let go at rest, horizontal, by Jacobi's sn."""
    from scipy.special import ellipj, ellipk

    m = 0.5  # sin² of half the largest angle
    rate = np.sqrt(MASS * GRAVITY * LENGTH / (MASS * LENGTH**2 + OWN))
    sn = ellipj(ellipk(m) - rate * t, m)[0]
    return float(2.0 * np.arcsin(np.sqrt(m) * sn))


def _ways() -> dict[str, list[dict[str, Any]]]:
    """Settings from coarse to fine, by the name of the method."""
    fixed = {f"{OURS} {name}": [{"integrator": name, "dt": dt} for dt in STEPS]
             for name in ("rk4", "nystrom4", "dop853", "implicit")}  # fmt: skip
    return fixed | {
        f"{OURS} {name}, adaptive": [
            {"integrator": name, "dt": 1e-3, "tolerance": tolerance} for tolerance in TOLERANCES
        ]
        for name in ("dopri5", "dop853", "implicit")
    }


def _moves(
    scene: str | Path, duration: float, torque: tuple[float, ...], error: Error,
    ways: list[dict[str, Any]],
) -> Iterator[tuple[float, Job]]:  # fmt: skip
    for way in ways:
        sim = Simulator(scene, **way)
        ticks = max(1, round(duration / sim.dt))
        if abs(ticks * sim.dt - duration) > 1e-9:
            continue
        tau = np.zeros(sim.n)
        tau[: len(torque)] = torque

        def moved(sim: Simulator = sim, tau: np.ndarray = tau) -> Recording:
            return sim.run(duration, tau)

        try:
            sim.reset()
            yield error(moved()), steady(sim.reset, moved)
        except SimulationDiverged:
            continue


def _four_bars() -> Error:
    return _off("pivot0", float(reference("four_bar")["2"]["10"][0]))


def _governor() -> Error:
    return _off("lift", float(reference("governor")["motion"]["10"][1]))


def _off(joint: str, expected: float) -> Error:
    """Error of a joint at the end."""
    return lambda run: abs(float(run.q[-1, run.joint_names.index(joint)]) - expected)
