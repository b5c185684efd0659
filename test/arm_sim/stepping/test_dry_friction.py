# SPDX-License-Identifier: Apache-2.0
"""Dry friction: a joint below its level stays exactly still, breaks away at the right torque,
stops at the right time and place, and never chatters.
"""

from typing import Any

import numpy as np
import pytest

from arm_sim import Simulator
from models.rotor import rotor
from tolerances import CLOSED_FORM, assert_close

J, FC, B = 0.1, 0.5, 0.2
OPTIONS: dict[str, dict[str, Any]] = {
    "rk4 1 ms": {"integrator": "rk4", "dt": 1e-3},
    "nystrom4 10 ms": {"integrator": "nystrom4", "dt": 1e-2},
    "error control": {"tolerance": 1e-10, "dt": 1e-2},
}
ALL = pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)


def wheel(options: dict[str, Any], **friction: float) -> Simulator:
    return Simulator(rotor(J, **(friction or {"coulomb": FC, "viscous": B})), **options)


@ALL
def test_stays_exactly_still_to_its_level_and_breaks_away_above(
    options: dict[str, Any],
) -> None:
    """Without viscous friction the acceleration is (tau - Fc) / J from the first instant."""
    sim = wheel(options, coulomb=FC, viscous=0.0)
    for tau in (0.0, 0.499, -0.499, FC, -FC):
        sim.reset(q=[0.3])
        run = sim.run(0.5, [tau])
        assert (run.q == 0.3).all() and not run.v.any()
    for sign in (1.0, -1.0):
        sim.reset()
        run = sim.run(0.5, [sign * (FC + 0.01)])
        assert_close(run.v[:, 0], sign * 0.1 * run.time, CLOSED_FORM)


@pytest.mark.parametrize("name", ["rk4 1 ms", "error control"])
def test_friction_that_rises_from_a_lower_level_at_rest(name: str) -> None:
    """It holds to the lower level; beyond it, a joint creeps where friction equals the torque.

    That is at Fc - (Fc - Fs) exp(-(v/vs)²) = τ; at Fc without it, friction would hold.
    """
    fs, vs, tau = 0.2, 0.5, 0.4
    sim = wheel(OPTIONS[name], coulomb=FC, static=fs, stribeck_velocity=vs)
    assert not sim.run(0.5, [fs * (1.0 - 1e-12)]).q.any()
    v = vs * np.sqrt(np.log((FC - fs) / (FC - tau)))
    assert_close(sim.run(5.0, [tau]).v[-1], [v], 1e-9)


def test_stopping_keeps_the_order_of_the_method() -> None:
    """The instant of the stop is found, so the place is right to the fourth order all the same."""
    errors = []
    for dt in (0.1, 0.05):
        sim = wheel({"integrator": "rk4", "dt": dt})
        sim.reset(q=[0.0], v=[5.0])
        errors.append(abs(sim.run(1.0).q[-1, 0] - 1.12673463916486289))
    assert errors[1] < errors[0] / 2**3.5
