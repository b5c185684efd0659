# SPDX-License-Identifier: Apache-2.0
"""Published joint torques and inertias of the Puma 560, rotors included, friction apart."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import Term
from tolerances import PUMA, assert_close

DATA = json.loads(Path(__file__).with_name("puma560.json").read_text())
RIGID = Term.INERTIA | Term.CORIOLIS | Term.GRAVITY


@pytest.mark.parametrize("case", DATA["torques"], ids=lambda case: case["name"])
def test_inverse_dynamics(case: dict[str, Any]) -> None:
    v, a = np.full(6, case["v"]), np.full(6, case["a"])
    assert_close(
        models.dynamics("puma560").inverse(case["q"], v, a, terms=RIGID), case["tau"], PUMA
    )


def test_inertia_seen_by_each_joint() -> None:
    case = DATA["inertia_diagonal"]
    assert_close(np.diag(models.dynamics("puma560").mass_matrix(case["q"])), case["M"], PUMA)


GEAR = np.array([-62.6111, 107.815, -53.7063, 76.0364, 71.923, 76.686])
VISCOUS = np.array([1.48e-3, 0.817e-3, 1.38e-3, 71.2e-6, 82.6e-6, 36.7e-6])  # [N m s/rad], motor
COULOMB = {  # [N m], at the motor, by the sign of the joint's velocity
    1.0: np.array([0.395, 0.126, 0.132, 11.2e-3, 9.26e-3, 3.96e-3]),
    -1.0: np.array([0.435, 0.071, 0.105, 16.9e-3, 14.5e-3, 10.5e-3]),
}


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_friction_at_the_joint_is_the_motors_through_the_gear(way: float) -> None:
    """G² B q̇ + |G| Tc of the way in which the joint turns, for every sign of G; the numbers and
    the rule are those of Corke's Robotics Toolbox, ``Link.friction``.
    """
    v = way * np.array([2.0, 0.5, 1.0, 0.1, 3.0, 1.0])
    expected = GEAR**2 * VISCOUS * v + way * abs(GEAR) * COULOMB[way]
    assert_close(models.dynamics("puma560").friction(v), expected, PUMA)


def test_breaks_away_by_direction() -> None:
    """The waist, which carries no weight, holds what friction holds in either direction."""
    sim = models.simulator("puma560", stops=False)
    weight = sim.dynamics.gravity(sim.state.q)
    for way, levels in COULOMB.items():
        for share, moves in ((0.9999, False), (1.0001, True)):
            sim.reset()
            push = way * share * abs(GEAR[0]) * levels[0] * np.eye(6)[0]
            sim.step(weight + push)
            assert bool(way * sim.state.v[0] > 0.0) is moves, (way, share)
            assert not sim.state.v[1:].any() or moves
