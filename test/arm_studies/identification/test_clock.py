# SPDX-License-Identifier: Apache-2.0
"""Stamps that are off are put right only where all joints say so; repeated rows are left out."""

from dataclasses import replace

import numpy as np

from arm_studies.identification import JointRecord, prepare
from arm_studies.identification.clock import with_corrected_stamps, without_repeats

T = np.arange(0.0, 30.0, 0.03)
W = 2.0 * np.pi * np.array([0.2, 0.27, 0.31, 0.4])


def record(late, noise):
    q = np.sin(np.outer(T - late, W) + np.arange(4)) + noise
    return JointRecord.of("abcd", T, q, np.ones_like(q))


def test_late_stamps_are_put_right():
    late = 0.004 * np.random.default_rng(1).standard_normal(len(T))
    made = with_corrected_stamps(record(late, 0.0))
    left = (made.time - (T - late))[30:-30]
    assert np.std(left) < 0.4 * np.std(late)
    assert "time stamps were off by" in made.notes[-1]


def test_noise_of_each_joint_by_itself_is_not_blamed_on_the_clock():
    noise = 2e-3 * np.random.default_rng(2).standard_normal((len(T), 4))
    for told in (record(np.zeros_like(T), noise), record(np.zeros_like(T), 0.0)):
        assert with_corrected_stamps(told) is told


def test_samples_of_an_even_clock_under_stamps_of_the_transport():
    jitter = np.clip(0.006 * np.random.default_rng(3).standard_normal(len(T)), -0.014, 0.014)
    told = record(np.zeros_like(T), 0.0)
    made = with_corrected_stamps(replace(told, time=T + jitter))
    np.testing.assert_allclose(np.diff(made.time), 0.03, rtol=1e-3)
    assert "samples are evenly spaced" in made.notes[0]


def test_states_that_a_driver_publishes_again():
    """It publishes the newest state every 30 ms; states come every 30.3 ms, with noisy efforts."""
    source = np.arange(-1.0, 31.0, 0.0303)
    newest = np.searchsorted(source, T, side="right") - 1
    effort = np.random.default_rng(4).standard_normal((len(source), 4))
    q = np.sin(np.outer(source, W) + np.arange(4))
    told = JointRecord.of("abcd", T, q[newest], effort[newest])
    made = without_repeats(told)
    assert len(made.time) == len(np.unique(newest))
    assert f"{len(T) - len(made.time)} rows repeat the one before" in made.notes[0]
    motion, sampled = prepare(told, band=3.0), source[np.unique(newest)]
    assert len(motion.time) == len(sampled)
    np.testing.assert_allclose(motion.dt, 0.0303, rtol=2e-3)
    true = -(W**2) * np.sin(np.outer(sampled, W) + np.arange(4))
    assert abs(motion.a - true)[50:-50].max() < 0.05


def test_a_robot_at_rest_does_not_repeat_itself():
    q = np.sin(np.outer(np.maximum(T - 15.0, 0.0), W))
    told = JointRecord.of("abcd", T, q, np.cos(q))
    assert without_repeats(told) is told
