# SPDX-License-Identifier: Apache-2.0
"""Inertias that are possible for rigid bodies, and impossible ones."""

import logging

import numpy as np
import pinocchio as pin
import pytest

import models
from arm_dynamics import Dynamics, load_scene
from arm_dynamics.scene.inertia import fault, possible, six_of


def test_bodies_of_point_masses_are_possible(rng: np.random.Generator) -> None:
    """Any points with any masses: in a line, in a plane, in space."""
    for points in rng.normal(size=(50, 4, 3)) * [[1.0], [0.0], [1.0], [0.0]]:
        weights = rng.uniform(0.1, 1.0, 4)
        arms = points - weights @ points / weights.sum()
        tensor = sum(
            m * ((r @ r) * np.eye(3) - np.outer(r, r)) for m, r in zip(weights, arms, strict=True)
        )
        assert fault(weights.sum(), six_of(np.array(tensor))) is None


def test_a_moment_beyond_the_sum_of_the_others_is_not(rng: np.random.Generator) -> None:
    for excess, fine in ((0.0, True), (0.009, True), (0.011, False), (1.0, False)):
        R = pin.Quaternion(rng.normal(size=4)).normalized().matrix()
        tensor = R @ np.diag([0.3, 0.7, 1.0 / (1.0 - excess)]) @ R.T if excess < 1 else np.eye(3)
        if excess == 1.0:
            tensor = R @ np.diag([0.0, 0.0, 1.0]) @ R.T
        assert bool(possible(1.0, six_of(tensor))) is fine
        assert (fault(1.0, six_of(tensor)) is None) is fine


def test_no_mass_is_negative_or_not_a_number() -> None:
    for mass in (-1.0, np.nan):
        assert f"mass = {mass:g} kg" in str(fault(mass, [0.0] * 6))


def test_a_link_with_an_impossible_inertia_is_reported_and_used(
    caplog: pytest.LogCaptureFixture,
) -> None:
    text = (models.FOLDER / "planar_3r.urdf").read_text()
    old = '<inertia ixx="0" ixy="0" ixz="0" iyy="0.015" iyz="0" izz="0.015"/>'
    assert old in text
    text = text.replace(old, old.replace('izz="0.015"', 'izz="0.1"'))
    with caplog.at_level(logging.WARNING):
        dyn = Dynamics(load_scene(text))
    assert "link 'link2': no body has principal moments 0, 0.015, 0.1 kg m²" in caplog.text
    assert list(dyn.model.doubtful) == ["link2"]
    assert np.isfinite(dyn.forward(*np.zeros((3, 3)))).all()
