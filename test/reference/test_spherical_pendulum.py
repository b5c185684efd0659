# SPDX-License-Identifier: Apache-2.0
"""Spherical pendulum against its closed form: motion out of the plane, on a universal joint."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from arm_sim import Recording, Simulator
from tolerances import TRAJECTORY, assert_close

HERE = Path(__file__).parent
DATA = json.loads((HERE / "spherical_pendulum.json").read_text())


@cache
def motion() -> Recording:
    """Ten seconds from (sin 60°, 0, -0.5) m with (0, 2, 0) m/s."""
    sim = Simulator(HERE / "spherical_pendulum.urdf", integrator="rk4", dt=1e-3)
    sim.reset(q=[0.0, -np.pi / 3], v=[2.0 / 0.5, 0.0])
    return sim.run(10.0)


def place(q: np.ndarray) -> np.ndarray:
    a, b = q.T
    return np.stack([-np.sin(b), np.sin(a) * np.cos(b), -np.cos(a) * np.cos(b)], axis=-1)


@pytest.mark.parametrize("t", DATA["position"])
def test_rk4_at_1_ms(t: str) -> None:
    expected = [float(x) for x in DATA["position"][t]]
    assert_close(place(motion().q[1000 * int(t)]), expected, TRAJECTORY)


def test_vertical_angular_momentum_is_conserved() -> None:
    run = motion()
    h = 1e-3
    p = place(run.q)
    rate = (8 * (p[3:-1] - p[1:-3]) - (p[4:] - p[:-4])) / (12 * h)
    momentum = p[2:-2, 0] * rate[:, 1] - p[2:-2, 1] * rate[:, 0]
    assert_close(momentum, np.full_like(momentum, 2.0 * np.sin(np.pi / 3)), TRAJECTORY)
