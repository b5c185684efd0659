# SPDX-License-Identifier: Apache-2.0
"""A body that tumbles freely about its centre of mass, against Jacobi's closed form; gravity must
not matter.
"""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from arm_sim import Recording, Simulator
from tolerances import TRAJECTORY, assert_close

HERE = Path(__file__).parent
DATA = json.loads((HERE / "free_top.json").read_text())
INERTIA = np.array([float(x) for x in DATA["inertia"]])


def numbers(name: str, t: str) -> np.ndarray:
    return np.array([float(x) for x in DATA[name][t]])


def attitude(q: np.ndarray) -> np.ndarray:
    """Rx(a) Ry(b) Rz(c), written out."""
    (ca, cb, cc), (sa, sb, sc) = np.cos(q), np.sin(q)
    return np.array([
        [cb * cc, -cb * sc, sb],
        [ca * sc + sa * sb * cc, ca * cc - sa * sb * sc, -sa * cb],
        [sa * sc - ca * sb * cc, sa * cc + ca * sb * sc, ca * cb],
    ])  # fmt: skip


def body_rates(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Angular velocity in body axes: each ring's rate about its axis, in the axes of the body."""
    _, b, c = q
    axis_a = [np.cos(b) * np.cos(c), -np.cos(b) * np.sin(c), np.sin(b)]
    return np.column_stack([axis_a, [np.sin(c), np.cos(c), 0.0], [0.0, 0.0, 1.0]]) @ v


@cache
def motion() -> Recording:
    """Ten seconds from the attitude and rates at time zero."""
    R = numbers("attitude", "0").reshape(3, 3)
    q = np.array(
        [np.arctan2(-R[1, 2], R[2, 2]), np.arcsin(R[0, 2]), np.arctan2(-R[0, 1], R[0, 0])]
    )
    to_rates = np.column_stack([body_rates(q, e) for e in np.eye(3)])
    sim = Simulator(HERE / "free_top.urdf", integrator="rk4", dt=1e-3)
    sim.reset(q, np.linalg.solve(to_rates, numbers("rates", "0")))
    return sim.run(10.0)


@pytest.mark.parametrize("t", ["1", "2", "5", "10"])
def test_rates(t: str) -> None:
    run, k = motion(), 1000 * int(t)
    assert_close(body_rates(run.q[k], run.v[k]), numbers("rates", t), TRAJECTORY)


@pytest.mark.parametrize("t", ["1", "2", "5", "10"])
def test_attitude(t: str) -> None:
    assert_close(attitude(motion().q[1000 * int(t)]).ravel(), numbers("attitude", t), TRAJECTORY)


def test_angular_momentum_keeps_its_direction() -> None:
    run = motion()
    momentum = [
        attitude(q) @ (INERTIA * body_rates(q, v))
        for q, v in zip(run.q[::100], run.v[::100], strict=True)
    ]
    assert_close(momentum, np.tile([0.0, 0.0, 0.19], (len(momentum), 1)), TRAJECTORY)
