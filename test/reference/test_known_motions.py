# SPDX-License-Identifier: Apache-2.0
"""The problems of the accuracy report at 1 ms: motions that are known in closed form, in Jacobi's
elliptic functions, or by Taylor series of high order.
"""

from functools import cache

import numpy as np
import pytest
from scipy.special import ellipkm1

from arm_sim import Simulator
from benchmarks.accuracy.problems import REFERENCE, all_problems, numbers, reference, ring_rates
from tolerances import CLOSED_FORM, TRAJECTORY, assert_close

PROBLEMS = {problem.name: problem for problem in all_problems(TRAJECTORY)}


@cache
def speeds() -> dict[str, dict[float, np.ndarray]]:
    """Where the references have them, of the joints; of a top, its body's rates."""
    double, four, top = (reference(x) for x in ("double_pendulum", "four_bar", "free_top"))

    def elbow(motion: dict[str, list[str]]) -> dict[float, np.ndarray]:
        rates = {float(t): numbers(x[2:]) for t, x in motion.items()}
        return {t: np.array([first, second - first]) for t, (first, second) in rates.items()}

    return {
        "double pendulum": elbow(double["pi6_pi4"]),
        "double pendulum, wild": elbow(double["pi2_pi2"]),
        "stiff elbow": elbow(reference("stiff_elbow")["motion"]),
        "four-bar": {float(t): numbers(x[1:]) for t, x in four["1"].items()},
        "two four-bars": {float(t): numbers(x[1:]) for t, x in four["2"].items()},
        "free top": {float(t): numbers(x) for t, x in top["rates"].items()},
    }


@pytest.mark.parametrize("name", PROBLEMS)
def test_motion_at_1_ms(name: str) -> None:
    """To the gate of the problem at every time; angles of cranks count their revolutions."""
    problem = PROBLEMS[name]
    sim = Simulator(problem.scene, integrator=problem.gated, dt=1e-3)
    if problem.start:
        sim.reset(*problem.start)
    for time, wanted in sorted(problem.expected.items()):
        while sim.state.time < time:
            sim.run(min(100.0, time - sim.state.time))
        found = problem.observe(sim.state.q)
        np.testing.assert_allclose(found, wanted, rtol=0.0, atol=problem.gate)
        if name in speeds():
            rates = ring_rates(sim.state.q) if name == "free top" else np.eye(sim.n)
            assert_close(rates @ sim.state.v, speeds()[name][time], TRAJECTORY)


@pytest.mark.parametrize("dt", [1e-3, 0.25])
def test_a_panda_under_error_control(dt: float) -> None:
    """Its wrist reaches 40 rad/s within the second."""
    problem = PROBLEMS["Panda"]
    sim = Simulator(problem.scene, tolerance=1e-9, dt=dt)
    for time, wanted in problem.expected.items():
        sim.run(time - sim.state.time)
        np.testing.assert_allclose(sim.state.q, wanted, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize("N", [1, 2])
def test_reduced_inertia_and_weight_of_four_bars(N: int) -> None:
    """(N+1)/3 + N and g ((N+1)/2 + N) cos th, counted from the linkage's 2N + 1 rods."""
    dyn, th = Simulator(REFERENCE / f"four_bar_{N}.yaml").dynamics, np.array([0.4])
    assert_close(dyn.mass_matrix(th), [[(N + 1) / 3 + N]], CLOSED_FORM)
    assert_close(dyn.gravity(th), [9.81 * ((N + 1) / 2 + N) * np.cos(0.4)], CLOSED_FORM)


@pytest.mark.parametrize("degrees", [1, 90, 179])
def test_period_of_a_pendulum(degrees: int) -> None:
    """Relative to small swings it is 2 K(sin²(a/2))/π (Landau and Lifshitz, Mechanics, §11).

    After two quarters it turns on the other side; after five it passes its lowest point. Ticks
    divide a quarter.
    """
    swing = np.deg2rad(degrees)
    wanted = 2.0 * ellipkm1(np.cos(swing / 2) ** 2) / np.pi
    quarter = wanted * 2 * np.pi / np.sqrt(9.81) / 4
    ticks = round(quarter / 1e-3)
    sim = Simulator("pendulum", integrator="rk4", dt=quarter / ticks)
    sim.reset(q=[swing], v=[0.0])
    run = sim.run(5 * quarter)
    assert_close([run.q[2 * ticks, 0], run.v[2 * ticks, 0]], [-swing, 0.0], TRAJECTORY)
    assert run.q[2 * ticks, 0] == run.q[: 2 * ticks + 1].min()
    assert run.v[-1, 0] < 0.0, "a fifth quarter ends on the way down"
    late = run.q[-1, 0] / -run.v[-1, 0]
    assert_close(wanted * (1 + late / (5 * quarter)), wanted, TRAJECTORY)
