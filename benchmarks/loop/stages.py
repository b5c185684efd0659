# SPDX-License-Identifier: Apache-2.0
"""What is measured, a stage each."""

import json
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any, Self

import numpy as np

from arm_dynamics import Dynamics
from arm_dynamics.arrays import Array
from arm_dynamics.client import ArmClient
from arm_dynamics.ros.common.caller import Caller
from arm_dynamics.ros.interfaces import INVERSE_DYNAMICS, MAX_POINTS, MAX_TERMS_POINTS
from arm_sim.cli.demo.processes import Processes
from benchmarks.loop.baseline import Client, spread
from benchmarks.measurement.watcher import processor_time

WARM = 3.0  # [s]
WARM_CALLS = 300  # of a service, whose answer is compiled meanwhile
PAUSE = 1e-3  # [s] between calls
Say = Callable[[str], None]
Record = dict[str, Any]


class Baseline:
    """One of the processes of ``baseline``, ended whatever happens."""

    def __init__(self, name: str, seconds: float, *more: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.loop.baseline", name, str(seconds), *more],
            stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        self._patience = seconds + 60.0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.communicate()

    def result(self) -> Record:
        output, _ = self._process.communicate(timeout=self._patience)
        measured: Record = json.loads(output)
        return measured


def closed_loop(
    scene: str, domain: int, seconds: float, logs: Path, say: Say, priority: int
) -> Record:
    """Sim, controller and dynamics node for a while, an ordinary bare thread beside them."""
    report = logs / "loop.json"
    wanted = ("--ros-args", "-p", f"priority:={priority}")
    with ExitStack() as stack:
        processes = stack.enter_context(Processes(logs))
        processes.start("dynamics", "dynamics", scene, "--with-parent")
        processes.start("controller", "controller", scene, "--with-parent", *wanted)
        processes.start("sim", "sim", scene, "--with-parent", "--report", str(report), *wanted)
        client = stack.enter_context(ArmClient(timeout=30.0, domain=domain))
        client.model_info()
        time.sleep(WARM)
        bare = stack.enter_context(Baseline("thread", seconds))
        ids = processes.ids
        client.reset_counters()
        used = lambda name: sum(processor_time(ids[name]).values())  # noqa: E731
        before = {name: used(name) for name in ids}
        say(f"closed loop, {seconds:.0f} s")
        began = time.monotonic()
        time.sleep(seconds)
        passed = time.monotonic() - began
        share = {name: (used(name) - start) / passed for name, start in before.items()}
        processes.stop("sim")
        beside = bare.result()
    result: Record = json.loads(report.read_text())
    return {
        "seconds": seconds,
        "priority": priority,
        "share": share,
        "thread": beside,
        **result,
    }


def ping_pong(seconds: float) -> list[int]:
    """Trips in [ns] of a joint state there and back by rclpy with its default executor."""
    with Baseline("echo", seconds + 20.0), Baseline("ping", seconds) as ping:
        trips: list[int] = ping.result()["trips"]
    return trips


def services(scene: str, domain: int, calls: int, logs: Path) -> Record:
    """Latency of one point, and points per second of batches."""
    rng = np.random.default_rng(0)
    with Processes(logs) as processes, ArmClient(timeout=60.0, domain=domain) as client:
        processes.start("dynamics", "dynamics", scene, "--with-parent")
        n = len(client.model_info().joint_names)
        q, v, a = rng.uniform(-1.0, 1.0, (3, MAX_POINTS, n))
        client.inverse_dynamics(q[0], v[0], a[0])
        result = one_point(domain, calls, q[0], v[0], a[0])
        asked = {
            "inverse": (client.inverse_dynamics, MAX_POINTS),
            "forward": (client.forward_dynamics, MAX_POINTS),
            "terms": (lambda q, v, _: client.dynamics_terms(q, v), MAX_TERMS_POINTS),
        }
        result["batches"] = {
            name: {str(points): _rate(ask, q[:points], v[:points], a[:points])
                   for points in (100, 1000, 10_000, MAX_POINTS) if points <= most}
            for name, (ask, most) in asked.items()
        }  # fmt: skip
    return result


def one_point(domain: int, calls: int, *point: Array) -> Record:
    """Latency of the running dynamics node, and of a service of rclpy as it comes, doing nothing.

    They are called in turn, a millisecond apart: a shared machine changes its speed, and who asks
    in a row finds everything in the caches.
    """
    q, v, a = (x.tolist() for x in point)
    request = INVERSE_DYNAMICS.type.Request(position=q, velocity=v, acceleration=a)
    with (
        Baseline("server", 60.0),
        closing(Caller(60.0, domain)) as caller,
        closing(Client(domain)) as client,
    ):
        ways = (
            lambda: caller.ask("dynamics", INVERSE_DYNAMICS, request),
            lambda: client.ask(request),
        )
        trips: list[list[float]] = [[] for _ in ways]
        for turn in range(calls + WARM_CALLS):
            for way, times in zip(ways, trips, strict=True):
                taken = _timed(way)
                if turn >= WARM_CALLS:
                    times.append(taken)
                time.sleep(PAUSE)
    ours, bare = ({"count": calls, **spread(1e9 * np.array(times))} for times in trips)
    return {**ours, "bare": bare}


def core(scene: str) -> Record:
    """Points per second of batches in Python."""
    dynamics, rng = Dynamics(scene), np.random.default_rng(0)
    q, v, a = rng.uniform(-1.0, 1.0, (3, MAX_POINTS, dynamics.n))
    few = q[:MAX_TERMS_POINTS], v[:MAX_TERMS_POINTS]
    return {
        "inverse": _rate(dynamics.inverse, q, v, a),
        "forward": _rate(dynamics.forward, q, v, a),
        "terms": _rate(lambda *state: _terms(dynamics, *state), *few),
    }


def _terms(dynamics: Dynamics, q: Array, v: Array) -> tuple[Array, ...]:
    """What ``~/dynamics_terms`` answers with."""
    return (
        dynamics.mass_matrix(q), dynamics.coriolis_matrix(q, v), dynamics.gravity(q),
        dynamics.friction(v, q=q), *dynamics.energy(q, v),
    )  # fmt: skip


def _rate(answer: Callable[..., object], *vectors: Array) -> float:
    answer(*vectors)
    return len(vectors[0]) / float(np.median([_timed(lambda: answer(*vectors)) for _ in "12345"]))


def _timed(action: Callable[[], object]) -> float:
    began = time.perf_counter()
    action()
    return time.perf_counter() - began
