# SPDX-License-Identifier: Apache-2.0
"""The problems of the accuracy report at 1 ms: motions that are known in closed form, in Jacobi's
elliptic functions, or by Taylor series of high order.
"""

from typing import Any

import numpy as np
import pytest
from scipy.special import ellipkm1

from arm_sim import SimulationDiverged, Simulator
from benchmarks.accuracy.problems import REFERENCE, all_problems
from tolerances import CLOSED_FORM, TRAJECTORY, assert_close

PROBLEMS = {problem.name: problem for problem in all_problems(TRAJECTORY)}


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


# A double pendulum whose elbow hardly gives: explicit methods need steps far below what the motion
# asks for, the implicit one does not.
STIFF = PROBLEMS["stiff elbow"]


@pytest.mark.parametrize(
    ("options", "error"), [({}, TRAJECTORY), ({"integrator": "dop853", "tolerance": 1e-9}, 1e-8)]
)
def test_a_stiff_elbow_in_steps_of_10_ms(options: dict[str, Any], error: float) -> None:
    sim = Simulator(STIFF.scene, dt=1e-2, **options)
    assert options or sim.plan.integrator == "implicit"
    for time, wanted in STIFF.expected.items():
        sim.run(time - sim.state.time)
        np.testing.assert_allclose(sim.state.q, wanted, rtol=0.0, atol=error)


def test_rk4_at_1_ms_is_beyond_its_stability() -> None:
    """And says so: no numbers that look like a motion."""
    with pytest.raises(SimulationDiverged):
        Simulator(STIFF.scene, integrator="rk4", dt=1e-3).run(1.0)
