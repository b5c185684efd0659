# SPDX-License-Identifier: Apache-2.0
"""Parameters of the sim node that depend on each other."""

from typing import Any

import pytest
from harness import Ros
from sim_by_hand import by_hand

from arm_sim.ros.sim_params import SimParams

pytestmark = pytest.mark.ros


@pytest.mark.parametrize(
    ("given", "unused"),
    [
        ({"overrun": "skip", "realtime_factor": 2.0, "priority": 5}, ()),
        ({"lockstep_retry": 0.1}, ("lockstep_retry",)),
        ({"lockstep": True, "lockstep_retry": 0.1, "cpus": "0"}, ()),
        ({"lockstep": True, "overrun": "skip"}, ("overrun",)),
        ({"realtime": False, "overrun": "catch_up"}, ()),
        ({"realtime": False, "realtime_factor": 0.0, "cpus": "0"}, ("realtime_factor", "cpus")),
    ],
)
def test_parameters_without_effect_are_known(
    given: dict[str, Any], unused: tuple[str, ...]
) -> None:
    assert SimParams(**given).unused == unused


def test_parameters_without_effect_are_named_at_the_start(
    ros: Ros, capfd: pytest.CaptureFixture[str]
) -> None:
    by_hand(ros, overrun="skip")
    told = capfd.readouterr().err
    assert "parameters without effect, since time steps are triggered by hand: overrun" in told
