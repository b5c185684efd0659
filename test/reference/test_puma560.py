# SPDX-License-Identifier: Apache-2.0
"""Published joint torques and inertias of the Puma 560, rotors included, friction apart."""

from __future__ import annotations

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


@pytest.mark.parametrize("case", DATA["torques"], ids=lambda case: case["name"])
def test_forward_dynamics(case: dict[str, Any]) -> None:
    dyn = models.dynamics("puma560")
    v = np.full(6, case["v"])
    found = dyn.forward(case["q"], v, np.array(case["tau"]) + dyn.friction(v))
    assert_close(found, np.full(6, case["a"]), PUMA)


def test_inertia_seen_by_each_joint() -> None:
    case = DATA["inertia_diagonal"]
    assert_close(np.diag(models.dynamics("puma560").mass_matrix(case["q"])), case["M"], PUMA)


def test_friction_at_the_joint_is_the_motors_times_the_gear_squared() -> None:
    """Waist: B = 1.48e-3 N m s/rad at the motor, G = 62.6111, Coulomb 0.395 and 0.435 N m in the
    two directions.
    """
    expected = 1.48e-3 * 62.6111**2 * 2.0 + 62.6111 * (0.395 + 0.435) / 2
    assert_close(models.dynamics("puma560").friction(2.0 * np.eye(6)[0])[0], expected, PUMA)
