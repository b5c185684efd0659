# SPDX-License-Identifier: Apache-2.0
"""Efforts are matched with the motions that explain them; bodies and friction are unknown."""

from itertools import product

import numpy as np
import pytest
from samples import sampled

from arm_dynamics import ArmModel, load_scene
from arm_studies.identification import JointRecord, prepare
from arm_studies.identification.regression.effort_faults import ColumnMatch, delays, scales, swaps
from arm_studies.identification.regression.estimation import Prior, Problem
from arm_studies.identification.regression.regressor import RigidRegressor
from arm_studies.identification.regression.rows.rows import Rows
from arm_studies.identification.regression.rows.samples import Samples


def recorded(scene: str, heavier: float, change, moving=None):
    """Rows of an arm of much friction whose last body is ``heavier`` than nominal; and a prior."""
    model, t = ArmModel(load_scene(scene)), np.arange(0.0, 12.0, 0.01)
    regressor, n = RigidRegressor(model), model.n
    rng = np.random.default_rng(4)
    w = rng.uniform(1.0, 4.0, (3, n))
    phase = rng.uniform(0.0, 6.0, (3, n))
    moves = np.ones(n) if moving is None else np.array(moving)
    angle = [x * t[:, None] + p for x, p in zip(w, phase, strict=True)]
    q = 0.4 * moves * sum(np.sin(x) for x in angle)
    v = 0.4 * moves * sum(x * np.cos(y) for x, y in zip(w, angle, strict=True))
    a = -0.4 * moves * sum(x**2 * np.sin(y) for x, y in zip(w, angle, strict=True))
    theta = regressor.nominal.copy()
    theta[-10:] *= heavier
    tau = regressor(q, v, a) @ theta + 0.8 * v + 1.5 * np.sign(v)
    tau += 0.05 * tau.std(axis=0) * rng.normal(size=tau.shape)
    record = JointRecord.of(model.joint_names, t, q, change(tau), v, a)
    rows = Rows(Samples(regressor, [prepare(record, np.inf)]))
    return Problem(rows, rows.samples.use, Prior.near(regressor.nominal, 0.12, 0.2))


def late(by: int):
    """A change of torques, of which the second joint's come some samples of 10 ms late."""
    return lambda tau: np.column_stack([tau[:, 0], np.roll(tau[:, 1], by), *tau.T[2:]])


@pytest.mark.parametrize(
    ("scene", "heavier"), sampled(product(["two_link", "panda"], [0.3, 1.0, 5.0]), 2)
)
def test_signs_and_delays_whatever_the_bodies(scene, heavier):
    right = recorded(scene, heavier, lambda tau: tau)
    assert swaps(right) == delays(right) == []
    signs = np.ones(ArmModel(load_scene(scene)).n)
    signs[1] = -1.0
    assert swaps(recorded(scene, heavier, lambda tau: tau * signs)) == [ColumnMatch(1, 1, -1)]
    for by in (-12, 40):
        (found,) = delays(recorded(scene, heavier, late(by)))
        assert found.joint == 1
        assert found.lag == pytest.approx(0.01 * by, abs=2e-3)
        assert found.remainder == pytest.approx(0.05, abs=0.02)  # the noise


def noisy(tau):
    return tau + 0.4 * tau.std(axis=0) * np.random.default_rng(7).normal(size=tau.shape)


@pytest.mark.parametrize(("change", "moving"), [
    (lambda tau: 1e-3 * tau, [1, 1]), (lambda tau: tau, [1, 0]), (noisy, [1, 1]),
])  # fmt: skip
def test_units_rest_and_noise_are_no_mismatch(change, moving):
    assert swaps(recorded("two_link", 1.0, change, moving)) == []


def test_scales_whose_interval_has_the_truth():
    """None of bodies within their prior, or where friction dominates."""
    (found,) = scales(recorded("panda", 1.0, lambda tau: tau * [1, 3, 1, 1, 1, 1, 1]))
    assert found.joint == 1 and found.low < 3.0 < found.high
    assert found.factor == pytest.approx(3.0, rel=0.2)
    assert scales(recorded("panda", 1.2, lambda tau: tau)) == []
    assert scales(recorded("panda", 1.0, lambda tau: tau * [1, 1, 1, 1, 1, 1, 3])) == []
