# SPDX-License-Identifier: Apache-2.0
"""The study of intervals, with fewer recordings: they contain the truth as often as they say."""

import numpy as np
import pytest
from samples import sampled

from arm_dynamics import Dynamics
from benchmarks.identification import coverage
from benchmarks.identification.faults import FAULTS, diagnosis


@pytest.mark.parametrize("name", coverage.ARMS)
def test_torques_by_lagrange_are_those_of_the_suite(name: str) -> None:
    """Two derivations that share nothing agree, so that the study has the right truth."""
    arm = coverage.true_arm(coverage.ARMS[name])
    q, v, a = np.random.default_rng(0).normal(size=(3, 20, len(arm.names)))
    suite = Dynamics(arm.scene).inverse(q, v, a)
    np.testing.assert_allclose(suite, arm.torque(q, v, a), atol=1e-11)


def test_intervals_contain_the_truth_as_often_as_they_say() -> None:
    """Of 150 intervals of ten recordings, many of them of the same noise; they are not wide."""
    found = [coverage.outcome("two links", coverage.LAGRANGE, seed) for seed in range(10)]
    errors = [1.96 * each for each in coverage.by_parameter("two links", found).values()]
    every = np.concatenate([each for each in errors if len(each) == len(found)])
    assert np.mean(abs(every) <= 1.96) >= 0.92
    assert np.sqrt(np.mean(every**2)) > 0.6
    means, chance = (np.array([f(each) for each in errors]) for f in (np.mean, np.var))
    assert np.mean(means**2) - np.mean(chance) / len(found) < 0.3**2


@pytest.mark.parametrize(
    ("fault", "said"),
    sampled([
        ("5 % of the positions missing", "'elbow': no position in 599 rows (0.245 s, "),
        ("efforts frozen for 2 s", "'elbow': effort frozen in 399 rows (8.005 to 9.995 s"),
        ("efforts 0 for 2 s", "'elbow': effort frozen in 399 rows (8.005 to 9.995 s"),
        ("efforts ahead by 12 ms", "'elbow': its efforts are ahead of the motion by 1"),
        ("efforts times 0.5", "'elbow': its efforts may be scaled by about 0.5"),
    ], 2),
)  # fmt: skip
def test_faults_that_are_told(fault: str, said: str) -> None:
    error, notes = diagnosis(FAULTS[fault])
    assert error is not None and error < 0.03
    assert any(note.startswith(said) for note in notes)


@pytest.mark.parametrize(
    ("fault", "said"),
    sampled([
        ("efforts late by 100 ms", "'elbow': its efforts are late by 100 ms"),
        ("efforts times 1000", "efforts over nominal torques: elbow 1.1e+03 ("),
        ("columns of efforts swapped", "the effort of 'shoulder' is that of 'elbow'"),
    ], 1),
)  # fmt: skip
def test_faults_that_are_refused(fault: str, said: str) -> None:
    error, refusal = diagnosis(FAULTS[fault])
    assert error is None and refusal[0].startswith(said)
