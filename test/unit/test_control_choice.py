# SPDX-License-Identifier: Apache-2.0
"""Controllers by name: all follow one kind of reference and can hand over to one another."""

from __future__ import annotations

import numpy as np
import pytest

import models
from arm_dynamics import InvalidInput
from arm_dynamics.control_choice import NAMES, Settings, make_controller
from arm_dynamics.control_run import DisturbanceObserver, Switch
from arm_dynamics.motion import Reference


@pytest.mark.parametrize("observer", [None, 30.0])
@pytest.mark.parametrize("name", NAMES)
def test_every_controller_holds_the_arm_at_rest(name: str, observer: float | None) -> None:
    """Each stays where it is, but PD and PID, which know no weight and sag at first."""
    sim = models.simulator("panda", dt=1e-3)
    q = sim.state.q.copy()
    still = Reference(q, np.zeros(7), np.zeros(7))
    settings = Settings(frame="panda_hand_tcp", observer=observer)
    control = make_controller(name, sim.dynamics, settings)
    assert isinstance(control, DisturbanceObserver) == (observer is not None)
    done = sim.run(0.3, lambda s: control.torque(s, still))
    moved = abs(done.q[-1] - q).max()
    sags = name in ("pd", "pid")
    assert (moved > 1e-3) if sags else (moved < 1e-6)


def test_all_hand_over_to_all_without_a_jump() -> None:
    sim = models.simulator("panda", dt=1e-3)
    goal = sim.state.q + 0.05
    reference = Reference(goal, np.zeros(7), np.zeros(7))
    settings = Settings(frame="panda_hand_tcp", bandwidth=8.0, friction=True)
    laws = [make_controller(name, sim.dynamics, settings) for name in NAMES if name != "float"]
    control, torques = Switch(laws[2], sim.dt, 0.05), []
    for k in range(60 * len(laws)):
        if k and k % 60 == 0:
            control.to(laws[k // 60])
        torques.append(control.torque(sim.state, reference))
        sim.step(torques[-1])
    torques = np.array(torques)
    for k in range(60, len(torques), 60):
        np.testing.assert_array_equal(torques[k], torques[k - 1])


def test_bad_choices_are_refused() -> None:
    dyn = models.dynamics("two_link")
    with pytest.raises(InvalidInput, match="controller = 'magic'; allowed: pd, pid"):
        make_controller("magic", dyn)
    with pytest.raises(InvalidInput, match="frame is not given; .* one of universe"):
        make_controller("operational_space", dyn)
    with pytest.raises(InvalidInput, match="frame 'paw' does not exist"):
        make_controller("motion_force", dyn, Settings(frame="paw"))
