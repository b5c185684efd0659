# SPDX-License-Identifier: Apache-2.0
"""Which gains a loop carries whose torques act late, and what is said of others."""

import re

import numpy as np
import pytest

import models
from arm_dynamics import InvalidInput
from arm_dynamics.control import Settings
from arm_dynamics.control.factory import overreach, refuse_unsteady
from arm_dynamics.control.pole_placement import MARGIN, largest_delay
from arm_sim import ClosedLoop

TICK = Settings().dt
STEPS = 80  # of the delay


def growth(k: float, c: float, delay: float) -> float:
    """By how much errors grow in a short time, if the torque for them acts after a delay."""
    h, last = delay / STEPS, 2 * STEPS
    step = np.eye(2 * STEPS + 2, k=-2)  # the newest error first
    step[:2, :2] = [[1.0, h], [0.0, 1.0]]
    step[:2, last:] -= np.outer([0.5 * h**2, h], [k, c])
    return float(abs(np.linalg.eigvals(step)).max())


@pytest.mark.parametrize(("k", "c"), [(400.0, 40.0), (9e4, 180.0), (0.0, 50.0)])
def test_the_largest_delay_is_where_errors_begin_to_grow(k: float, c: float) -> None:
    most = float(largest_delay(k, c, 1.0))
    assert growth(k, c, 1.03 * most) > 1.0 + 1e-9 > growth(k, c, 0.97 * most)
    assert largest_delay(k, c) == pytest.approx(float(largest_delay(MARGIN * k, MARGIN * c, 1.0)))
    assert np.isinf(largest_delay(k, 0.0)), "without damping it is left to the arm"


@pytest.mark.parametrize("name", ["computed_torque", "operational_space"])
def test_the_largest_sensible_bandwidth_is_told(name: str) -> None:
    dynamics = models.dynamics("two_link")

    def said(bandwidth: float, delay: float = TICK, **more: float) -> str:
        return overreach(name, dynamics, Settings(bandwidth=bandwidth, **more), delay)

    assert said(239.0) == said(700.0, 0.0) == ""
    assert said(300.0).endswith("sensible: at most 239 rad/s")
    assert "at most 79.8 rad/s" in said(100.0, 4e-3)
    assert "at most 65.1 rad/s" in said(100.0, damping_ratio=4.0)


@pytest.mark.parametrize("name", ["pd", "joint_impedance"])
def test_gains_that_are_lowered_for_light_motions_are_told(name: str) -> None:
    dynamics = models.dynamics("panda")
    said = overreach(name, dynamics, Settings(bandwidth=30.0), 0.0)
    assert "for which gains are lowered; sensible: at most 10.8 rad/s" in said
    assert overreach(name, dynamics, Settings(bandwidth=10.0), 0.0) == ""


def test_stiffness_and_damping_are_compared_with_the_inertia() -> None:
    for name, given in (
        ("joint_impedance", {"damping": 0.5}),
        ("cartesian_impedance", {"stiffness": 1e6, "frame": "tool0", "axes": "position"}),
    ):
        said = overreach(name, models.dynamics("ur5e"), Settings(**given), TICK)
        assert re.search(r"sensible: at most 0\.\d+ of the stiffness, and 0\.\d+ of the dam", said)
        assert f"stiffness = {given.get('stiffness', 0.0)}" in said


def test_a_bandwidth_that_swings_any_arm_up_is_refused() -> None:
    refuse_unsteady(Settings(bandwidth=430.0))
    with pytest.raises(InvalidInput, match=r"at most 20, 432 rad/s.* most 20, 239"):
        refuse_unsteady(Settings(bandwidth=[20.0, 3000.0]))
    with pytest.raises(InvalidInput, match="as many as there are joints"):
        Settings(bandwidth=[1.0, 2.0, 3.0], damping_ratio=[1.0, 2.0])


def test_integrals_are_lowered_with_the_other_gains() -> None:
    pair = ClosedLoop(models.scene("panda"), "pid", Settings(bandwidth=1000.0), integrator="rk4")
    goal = pair.simulator.state.q.copy()
    pair.simulator.set_state(q=goal + 1e-3)
    assert abs(pair.run(0.5).q[-1] - goal).max() < 1e-3


def test_a_closed_loop_warns_of_its_delays(caplog: pytest.LogCaptureFixture) -> None:
    scene = models.scene("two_link")
    late = {"robot": {"urdf": scene.robot.urdf}, "sensors": {"delay": 4e-3}}
    ClosedLoop(late, settings=Settings(bandwidth=100.0))
    assert "bandwidth = 100.0 is too much for torques that act 0.004 s late" in caplog.text
