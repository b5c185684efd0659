# SPDX-License-Identifier: Apache-2.0
"""The study of intervals, with fewer recordings: they contain the truth as often as they say."""

from __future__ import annotations

import numpy as np
import pytest
from samples import sampled

from arm_dynamics import Dynamics
from benchmarks.identification import coverage, imperfect


@pytest.mark.parametrize("name", coverage.ARMS)
def test_torques_by_lagrange_are_those_of_the_suite(name: str) -> None:
    """Two derivations that share nothing agree, so that the study has the right truth."""
    arm = coverage.true_arm(coverage.ARMS[name])
    joints = {
        link: {"armature": rotor, "friction": {"viscous": viscous, "coulomb": coulomb}}
        for link, rotor, viscous, coulomb in zip(
            arm.names, arm.armature.tolist(), arm.viscous.tolist(), arm.coulomb.tolist(),
            strict=True,
        )
    }  # fmt: skip
    q, v, a = np.random.default_rng(0).normal(size=(3, 20, len(arm.names)))
    suite = Dynamics({"robot": {"urdf": arm.urdf}, "joints": joints}).inverse(q, v, a)
    np.testing.assert_allclose(suite, arm.torque(q, v, a), atol=1e-11)


def test_intervals_contain_the_truth_as_often_as_they_say() -> None:
    """Of 150 intervals of ten recordings, many of them of the same noise; they are not wide."""
    found = coverage.study("two links", seeds=10)
    assert found.held.mean() >= 0.92
    assert np.sqrt(np.mean(np.concatenate(found.errors) ** 2)) > 0.6
    assert found.bias < 0.3


def test_the_truth_of_a_sum_of_parameters() -> None:
    truth = {"a.m": 2.0, "a.mx": 0.5, "b.Izz": 1.0}
    assert coverage.combined("b.Izz - 0.4 a.mx + a.m", truth) == pytest.approx(2.8)
    assert coverage.combined("b.coulomb_skew", truth) == 0.0


@pytest.mark.parametrize(
    ("fault", "said"),
    sampled([
        ("5 % of the positions missing", "'elbow': no position in 599 rows (0.245 s, "),
        ("efforts frozen for 2 s", "'elbow': effort frozen in 399 rows (8.005 to 9.995 s"),
        ("efforts 0 for 2 s", "'elbow': effort frozen in 399 rows (8.005 to 9.995 s"),
        ("efforts ahead by 12 ms", "'elbow': its efforts are ahead of the motion by 1"),
        ("efforts times 0.5", "'elbow': its efforts are scaled by about 0.5"),
    ], 2),
)  # fmt: skip
def test_faults_that_are_told(fault: str, said: str) -> None:
    error, notes = imperfect.outcome(imperfect.FAULTS[fault])
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
    error, refusal = imperfect.outcome(imperfect.FAULTS[fault])
    assert error is None and refusal[0].startswith(said)
