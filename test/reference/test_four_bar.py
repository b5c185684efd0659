# SPDX-License-Identifier: Apache-2.0
"""N four-bars in a row, reduced to their one coordinate, against Jacobi's amplitude: cranks that
go round for ever, built from a rod and payloads.
"""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from arm_sim import Recording, Simulator
from tolerances import CLOSED_FORM, TRAJECTORY, assert_close

HERE = Path(__file__).parent
DATA = json.loads((HERE / "four_bar.json").read_text())
CASES = [(N, t) for N in ("1", "2") for t in DATA[N]]


@cache
def simulator(N: str) -> Simulator:
    return Simulator(HERE / f"four_bar_{N}.yaml", integrator="rk4", dt=1e-3)


@cache
def motion(N: str) -> Recording:
    simulator(N).reset()
    return simulator(N).run(20.0)


@pytest.mark.parametrize("N", ["1", "2"])
def test_reduced_inertia_and_weight(N: str) -> None:
    """(N+1)/3 + N and g ((N+1)/2 + N) cos th, counted from the linkage's 2N + 1 rods."""
    dyn, n, th = simulator(N).dynamics, int(N), np.array([0.4])
    assert_close(dyn.mass_matrix(th), [[(n + 1) / 3 + n]], CLOSED_FORM)
    assert_close(dyn.gravity(th), [9.81 * ((n + 1) / 2 + n) * np.cos(0.4)], CLOSED_FORM)


@pytest.mark.parametrize(("N", "t"), CASES)
def test_rk4_at_1_ms(N: str, t: str) -> None:
    th, rate = (float(x) for x in DATA[N][t])
    run, k = motion(N), 1000 * int(t)
    # Twenty revolutions count as twenty: the angle itself must be right, not its size in turns.
    np.testing.assert_allclose(run.q[k], [th], rtol=0.0, atol=TRAJECTORY)
    np.testing.assert_allclose(run.v[k], [rate], rtol=0.0, atol=TRAJECTORY)
