# SPDX-License-Identifier: Apache-2.0
"""The study of intervals, with fewer recordings: they contain the truth as often as they say."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from samples import sampled

from arm_dynamics import Dynamics
from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput
from arm_studies.identification import JointRecord, identify
from benchmarks.identification import coverage
from benchmarks.identification.coverage import (
    ARMS,
    NOISE,
    RATE,
    RESOLUTION,
    recorded,
    true_arm,
)
from benchmarks.identification.lagrange import LagrangeArm

Fault = Callable[[Array, Array], None]
"""Changes positions and efforts of shape (k, 2) in place."""
ELBOW, SHARE, DURATION = 1, 0.05, 60.0
SPAN = slice(int(8.0 * RATE), int(10.0 * RATE))


def _lost(array: Array) -> None:
    array[np.random.default_rng(2).random(len(array)) < SHARE, ELBOW] = np.nan


def _stretch(effort: Array, value: float) -> None:
    effort[SPAN, ELBOW] = value


def _late(effort: Array, seconds: float) -> None:
    at = np.arange(len(effort)) - seconds * RATE
    effort[:, ELBOW] = np.interp(at, np.arange(len(effort)), effort[:, ELBOW])


def _times(effort: Array, factor: float) -> None:
    effort[:, ELBOW] *= factor


def _swapped(effort: Array) -> None:
    effort[:] = effort[:, ::-1].copy()


FAULTS: dict[str, Fault] = {
    "none": lambda q, effort: None,
    "5 % of the efforts missing": lambda q, effort: _lost(effort),
    "5 % of the positions missing": lambda q, effort: _lost(q),
    "efforts missing for 2 s": lambda q, effort: _stretch(effort, np.nan),
    "efforts frozen for 2 s": lambda q, effort: _stretch(effort, effort[SPAN.start, ELBOW]),
    "efforts 0 for 2 s": lambda q, effort: _stretch(effort, 0.0),
    "efforts late by 12 ms": lambda q, effort: _late(effort, 0.012),
    "efforts ahead by 12 ms": lambda q, effort: _late(effort, -0.012),
    "efforts late by 100 ms": lambda q, effort: _late(effort, 0.1),
    "efforts times 0.5": lambda q, effort: _times(effort, 0.5),
    "efforts times 3": lambda q, effort: _times(effort, 3.0),
    "efforts times 1000": lambda q, effort: _times(effort, 1000.0),
    "efforts reversed": lambda q, effort: _times(effort, -1.0),
    "columns of efforts swapped": lambda q, effort: _swapped(effort),
}


def told(fault: Fault, seed: int = 0) -> tuple[float | None, tuple[str, ...]]:
    """Error on the part held out, None if no scene is written; and what is said."""
    links = ARMS["two links"]
    arm, nominal = true_arm(links), LagrangeArm(links, *np.zeros((3, len(links))))
    t, q, tau = recorded(arm, DURATION)
    noise = np.random.default_rng(seed).standard_normal(tau.shape)
    effort = tau + NOISE * np.sqrt((tau**2).mean(axis=0)) * noise
    q = RESOLUTION * np.round(q / RESOLUTION)
    fault(q, effort)
    record = JointRecord.of(arm.names, t, q, effort)
    try:
        found = identify({"robot": {"urdf": nominal.urdf}}, record)
    except InvalidInput as refused:
        return None, (str(refused),)
    return found.error[0], found.notes


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
        ("efforts times 0.5", "'elbow': its efforts are scaled by about 0.5"),
    ], 2),
)  # fmt: skip
def test_faults_that_are_told(fault: str, said: str) -> None:
    error, notes = told(FAULTS[fault])
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
    error, refusal = told(FAULTS[fault])
    assert error is None and refusal[0].startswith(said)
