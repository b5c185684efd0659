# SPDX-License-Identifier: Apache-2.0
"""Single figures: published robots, periods, a spring, and in what way equal runs are equal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from arm_dynamics import Dynamics, Term, load_scene
from arm_sim import Simulator, State
from benchmarks.accuracy.problems import REFERENCE, ROOT, SCENES, numbers, reference
from benchmarks.accuracy.sweep import Row, verdict

PANDA = ROOT / "test/models/panda_free.yaml"
ARMS, STEPS = 37, 200  # 37: groups of 8, 4 and 2 arms all leave a rest
OPTIONS: dict[str, dict[str, Any]] = {
    "rk4": {"integrator": "rk4"},
    "tolerance 1e-9": {"tolerance": 1e-9},
}


def checks(gates: Any) -> dict[str, Callable[[], Iterator[Row]]]:
    """Groups of checks by name; ``gates`` is the tests' module of tolerances."""
    return {
        "Puma 560": lambda: _puma(gates.PUMA),
        "periods": lambda: _periods(gates.TRAJECTORY),
        "spring": lambda: _spring(gates.TRAJECTORY),
        "same input": _same_input,
        "lanes": lambda: _lanes(gates.BACKENDS),
        "virtual machine": lambda: _virtual_machine(gates.BACKENDS),
    }


def _puma(gate: float) -> Iterator[Row]:
    data, dyn = reference("puma560"), Dynamics(load_scene(SCENES / "puma560.yaml"))
    rigid, worst = Term.INERTIA | Term.CORIOLIS | Term.GRAVITY, 0.0
    for case in data["torques"]:
        v, a = np.full(6, case["v"]), np.full(6, case["a"])
        found = dyn.inverse(case["q"], v, a, terms=rigid)
        worst = max(worst, _relative(found, np.array(case["tau"])))
    yield verdict("Puma 560, published joint torques, relative", worst, gate)
    case = data["inertia_diagonal"]
    found = np.diag(dyn.mass_matrix(case["q"]))
    yield verdict("Puma 560, published inertias, relative", _relative(found, case["M"]), gate)


def _periods(gate: float) -> Iterator[Row]:
    """Ticks of about 1 ms that divide the quarter: what is left then is the error."""
    worst = 0.0
    for degrees, ratio in reference("pendulum_periods")["ratio"].items():
        quarter = float(ratio) * np.pi / 2 / np.sqrt(9.81)
        dt = quarter / round(quarter / 1e-3)
        sim = Simulator(SCENES / "pendulum.yaml", integrator="rk4", dt=dt)
        sim.reset([np.deg2rad(float(degrees))], [0.0])
        sim.run(5 * quarter)
        worst = max(worst, abs(sim.state.q[0] / sim.state.v[0]) / (5 * quarter))
    yield verdict("pendulum, periods of swings of 1° to 179°, rk4 at 1 ms, relative", worst, gate)


def _spring(gate: float) -> Iterator[Row]:
    """The spring is a controller: felt once a tick, pulling as in the tick's middle."""
    data = reference("coulomb")["oscillator"]
    for ticks in (100, 314, 1000):
        h = float(data["half_period"]) / ticks
        sim = Simulator(REFERENCE / "slider.yaml", integrator="rk4", dt=h)

        def spring(state: State, h: float = h) -> np.ndarray:
            return -100.0 * (state.q + 0.5 * h * state.v)

        run = sim.run(5 * ticks * h, spring)
        turns = run.q[[ticks, 2 * ticks, 3 * ticks], 0]
        error = float(np.abs(turns - numbers(data["turning_points"])).max())
        what = f"mass on a spring with dry friction, turning points [m], rk4 at {h * 1e3:.2g} ms"
        yield verdict(what, error, gate)
    moved = float(np.ptp(run.q[3 * ticks :]))
    yield verdict("the same mass, once it sticks, moves by [m]", moved, 0.0)


def _same_input() -> Iterator[Row]:
    tau = 5.0 * np.sin(np.outer(np.arange(STEPS), np.arange(1, 8)) / 7.0)
    for label, options in OPTIONS.items():
        sim, other = (Simulator(PANDA, **options) for _ in range(2))
        first = sim.run(STEPS * 1e-3, tau)
        sim.reset()
        stepped = np.array([sim.step(row).q for row in tau])
        sim.reset()
        for name, q in (
            ("again", sim.run(STEPS * 1e-3, tau).q[1:]),
            ("another instance", other.run(STEPS * 1e-3, tau).q[1:]),
            ("step by step", stepped),
        ):
            differ = float(np.count_nonzero(q != first.q[1:]))
            yield verdict(f"Panda, {label}, {name}: numbers that differ in a bit", differ, 0.0)


def _lanes(gate: float) -> Iterator[Row]:
    sim, rng = Simulator(PANDA, integrator="rk4"), np.random.default_rng(2)
    q, v, tau = rng.uniform(-1, 1, (3, ARMS, 7))
    alone = []
    for i in range(ARMS):
        sim.reset(q[i], v[i])
        run = sim.run(STEPS * sim.dt, tau[i])
        alone.append(np.hstack([run.q, run.v]))
    for lanes in (1, 2, 4, 8):
        found = sim.rollout(q, v, tau, STEPS, lanes=lanes)
        what = f"Panda, {STEPS} steps, one arm against {lanes} side by side, relative"
        yield verdict(what, _relative(found, np.array(alone)), gate)
    order = rng.permutation(ARMS)
    differ = 0
    for part, threads in ((order, 1), (order, 2), (order[:5], 1), (order[:1], 1)):
        again = sim.rollout(q[part], v[part], tau[part], STEPS, threads=threads)
        differ += np.count_nonzero(again != sim.rollout(q, v, tau, STEPS)[part])
    what = "Panda, other order, company and threads: numbers that differ in a bit"
    yield verdict(what, float(differ), 0.0)


def _virtual_machine(gate: float) -> Iterator[Row]:
    tau = 2.0 * np.sin(np.outer(np.arange(STEPS), np.arange(1, 8)) / 7.0)
    for label, options in OPTIONS.items():
        native, virtual = (
            Simulator(PANDA, backend=backend, **options).run(STEPS * 1e-3, tau)
            for backend in ("native", "vm")
        )
        both = [np.hstack([run.q, run.v]) for run in (virtual, native)]
        what = f"Panda, {label}, {STEPS} steps, virtual machine against compiled, relative"
        yield verdict(what, _relative(*both), gate)


def _relative(found: np.ndarray, wanted: Any) -> float:
    """As ``assert_close`` of the tests has it: relative to the largest number, or to one."""
    scale = max(1.0, float(np.abs(wanted).max()))
    return float(np.abs(found - np.asarray(wanted)).max()) / scale
