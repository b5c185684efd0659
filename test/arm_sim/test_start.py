# SPDX-License-Identifier: Apache-2.0
"""How an arm starts for the second time."""

from pathlib import Path

import numpy as np
import pytest

from arm_sim import Simulator
from arm_sim.plant import plant
from models.large import snake


class WrittenAnew(Exception):
    """Equations are written although their code is there."""


def refuse(*_: object) -> None:
    raise WrittenAnew


def test_the_second_start_writes_no_equations(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, hasty: dict[str, str]
) -> None:
    """From an empty cache; other scenes write theirs."""
    for name, value in {"XDG_CACHE_HOME": str(tmp_path), **hasty}.items():
        monkeypatch.setenv(name, value)
    joints = 17  # more than 16 have other equations
    urdf = snake(np.random.default_rng(5), joints)
    tau = np.linspace(-1.0, 1.0, joints)
    loose = {"*": {"limits": {"stop": False}}}  # which takes less to compile
    scene = {"robot": {"urdf": urdf}, "joints": loose, "sim": {"integrator": "euler"}}
    first = Simulator(scene).run(0.02, tau)
    monkeypatch.setattr(plant, "Mechanics", refuse)
    again = Simulator(scene)
    np.testing.assert_array_equal(again.run(0.02, tau).v, first.v)
    assert again.n == joints
    for other in (
        {**scene, "gravity": [0.0, 0.0, -1.62]},
        {**scene, "joints": {"*": {"friction": {"viscous": 0.3}}}},
        {**scene, "sim": {"integrator": "dop853"}},
        again.model.with_friction(again.model.friction.with_viscous(np.full(joints, 0.3))),
    ):
        with pytest.raises(WrittenAnew):
            Simulator(other)
