# SPDX-License-Identifier: Apache-2.0
"""How an arm of many joints starts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from arm_sim import Simulator
from arm_sim.plant import plant
from models.large import snake

JOINTS = 17  # one more than arms whose equations are written at once


class WrittenAnew(Exception):
    """Equations are written although their code is there."""


@pytest.fixture
def unwritten(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> pytest.MonkeyPatch:
    """An empty cache; ``setattr`` lets the writing of equations fail from then on."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return monkeypatch


def refuse(*_: object) -> None:
    raise WrittenAnew


def test_the_second_start_writes_no_equations(unwritten: pytest.MonkeyPatch) -> None:
    urdf = snake(np.random.default_rng(5), JOINTS)
    tau = np.linspace(-1.0, 1.0, JOINTS)
    scene = {"robot": {"urdf": urdf}}
    first = Simulator(scene).run(0.02, tau)
    unwritten.setattr(plant, "Mechanics", refuse)
    again = Simulator(scene)
    np.testing.assert_array_equal(again.run(0.02, tau).v, first.v)
    assert again.n == JOINTS
    for other in (
        {**scene, "gravity": [0.0, 0.0, -1.62]},
        {**scene, "joints": {"*": {"friction": {"viscous": 0.3}}}},
        {**scene, "sim": {"integrator": "dop853"}},
    ):
        with pytest.raises(WrittenAnew):
            Simulator(other)
