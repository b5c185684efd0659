# SPDX-License-Identifier: Apache-2.0
"""Stamps that are off are put right only where all joints say so."""

import numpy as np

from arm_dynamics.identification import JointRecord
from arm_dynamics.identification.clock import repaired

T = np.arange(0.0, 30.0, 0.03)
W = 2.0 * np.pi * np.array([0.2, 0.27, 0.31, 0.4])


def record(late, noise):
    q = np.sin(np.outer(T - late, W) + np.arange(4)) + noise
    return JointRecord.of("abcd", T, q, np.ones_like(q))


def test_late_stamps_are_put_right():
    late = 0.004 * np.random.default_rng(1).standard_normal(len(T))
    made = repaired(record(late, 0.0))
    left = (made.time - (T - late))[30:-30]
    assert np.std(left) < 0.4 * np.std(late)
    assert "time stamps were off by" in made.notes[-1]


def test_noise_of_each_joint_by_itself_is_not_blamed_on_the_clock():
    noise = 2e-3 * np.random.default_rng(2).standard_normal((len(T), 4))
    told = record(np.zeros_like(T), noise)
    assert repaired(told) is told


def test_a_clean_recording_stays_as_it_is():
    told = record(np.zeros_like(T), 0.0)
    assert repaired(told) is told
