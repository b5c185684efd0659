# SPDX-License-Identifier: Apache-2.0
"""The study of intervals, with fewer recordings: they contain the truth as often as they say."""

import numpy as np
import pytest

from arm_dynamics import Dynamics
from benchmarks.identification import coverage


@pytest.mark.parametrize("name", coverage.ARMS)
def test_torques_by_lagrange_are_those_of_the_suite(name: str) -> None:
    """Two derivations that share nothing agree, so that the study has the right truth."""
    arm = coverage.true_arm(coverage.ARMS[name])
    q, v, a = np.random.default_rng(0).normal(size=(3, 20, len(arm.names)))
    suite = Dynamics(arm.scene).inverse(q, v, a)
    np.testing.assert_allclose(suite, arm.torque(q, v, a), atol=1e-11)


def test_intervals_contain_the_truth_as_often_as_they_say() -> None:
    """Of 130 intervals of ten recordings, many of them of the same noise; they are not wide."""
    found = [coverage.outcome("two links", coverage.LAGRANGE, seed) for seed in range(10)]
    names = sorted(set.intersection(*(set(one.errors) - one.scatter for one in found if one)))
    errors = 1.96 * np.array([[one.errors[name] for name in names] for one in found if one])
    assert errors.shape == (10, 13)
    assert np.mean(abs(errors) <= 1.96) >= 0.92
    assert np.sqrt(np.mean(errors**2)) > 0.6
    bias, chance = errors.mean(axis=0), errors.var(axis=0)
    assert np.mean(bias**2) - np.mean(chance) / len(found) < 0.3**2
