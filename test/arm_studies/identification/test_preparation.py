# SPDX-License-Identifier: Apache-2.0
"""Even times, no lag, derivatives; faults of a recording are reported or refused."""

import numpy as np
import pytest

from arm_dynamics.exceptions import InvalidInput
from arm_studies.identification import JointRecord, prepare
from arm_studies.identification.filtering import ZeroPhase, chosen_band

RATE = 500.0
T = np.arange(0.0, 10.0, 1.0 / RATE)
W = 2.0 * np.pi * np.array([0.3, 0.7])


def motion(t=T):
    q = np.sin(np.outer(t, W))
    return q, W * np.cos(np.outer(t, W)), -(W**2) * q


def record(t=T, q=None, effort=None, **more):
    return JointRecord.of(["a", "b"], t, motion(t)[0] if q is None else q,
                          np.ones((len(t), 2)) if effort is None else effort, **more)  # fmt: skip


def test_derivatives_of_a_clean_motion_are_exact_within_the_margins():
    q, v, a = motion()
    made = prepare(record())
    inside = made.valid.all(axis=1)
    assert inside.mean() > 0.85
    np.testing.assert_allclose(made.q[inside], q[inside], atol=1e-6)
    np.testing.assert_allclose(made.v[inside], v[inside], atol=1e-5)
    np.testing.assert_allclose(made.a[inside], a[inside], atol=1e-4)


def test_the_filter_has_no_lag_and_halves_the_amplitude_at_its_band():
    t = np.arange(0.0, 20.0, 0.002)
    low_pass = ZeroPhase(10.0, 0.002)
    for frequency, gain in ((1.0, 1.0), (10.0, 0.5), (30.0, 3.0**-8)):
        x = np.cos(2 * np.pi * frequency * t)[:, None]
        inside = slice(low_pass.margin(len(t)), -low_pass.margin(len(t)))
        np.testing.assert_allclose(low_pass(x)[inside], gain * x[inside], atol=2e-3)


def test_the_band_keeps_the_motion_and_leaves_the_noise():
    noisy = motion()[0] + 1e-4 * np.random.default_rng(1).standard_normal((len(T), 2))
    band = chosen_band(noisy, 1.0 / RATE)
    assert 1.0 < band < 8.0
    made, (_, v, a) = prepare(record(q=noisy)), motion()
    inside = made.valid.all(axis=1)
    assert np.std((made.v - v)[inside]) < 1e-3
    assert np.std((made.a - a)[inside]) < 1e-2


def test_uneven_times_become_even():
    t = T + 0.3 / RATE * np.sin(np.arange(len(T)))
    made = prepare(record(t), band=20.0)
    np.testing.assert_allclose(np.diff(made.time), made.dt, rtol=1e-9)
    q, v, _ = motion(made.time)
    inside = made.valid.all(axis=1)
    np.testing.assert_allclose(made.q[inside], q[inside], atol=1e-4)
    np.testing.assert_allclose(made.v[inside], v[inside], atol=5e-3)


def test_a_gap_makes_two_stretches_and_nothing_is_used_near_it():
    there = (T < 4.0) | (T > 4.5)
    made = prepare(record().rows(there), band=20.0)
    assert len(made.stretches) == 2 and "1 gaps" in made.notes
    assert not made.valid[abs(made.time - 4.25) < 0.25 + 0.04].any()
    _, v, _ = motion(made.time)
    inside = made.valid.all(axis=1)
    np.testing.assert_allclose(made.v[inside], v[inside], atol=1e-2)


def test_holes_and_saturation_of_the_effort_are_masked():
    effort = np.sin(np.outer(T, [1.0, 2.0]))
    effort[100:110, 0] = np.nan
    effort[:, 1] = np.clip(effort[:, 1], -0.9, 0.9)
    made = prepare(record(effort=effort), band=20.0)
    assert not made.valid[100:110, 0].any() and made.valid[100:110, 1].all()
    assert not made.valid[effort[:, 1] == 0.9, 1].any()
    assert any("'b': effort saturated" in note for note in made.notes)


def test_given_accelerations_are_used_unchanged():
    q, v, a = motion()
    made = prepare(record(q=q, v=v, a=a))
    assert np.isinf(made.band)
    for told, kept in ((q, made.q), (v, made.v), (a, made.a)):
        np.testing.assert_array_equal(told, kept)


def test_a_span_keeps_its_stretches():
    made = prepare(record().rows((T < 4.0) | (T > 4.5)), band=20.0)
    part = made.span(slice(1000, None))
    assert [s.start for s in part.stretches] == [0, made.stretches[0].stop - 1000]
    np.testing.assert_array_equal(part.q, made.q[1000:])


@pytest.mark.parametrize(
    ("times", "said"),
    [
        (np.r_[T[:10], T[5:]], "jumps back"),
        (np.r_[T[:10], np.nan], "finite times"),
        ([0.0], "k > 1"),
    ],
)
def test_a_clock_that_does_not_go_on_is_refused(times, said):
    with pytest.raises(InvalidInput, match=said):
        record(np.asarray(times), q=np.zeros((len(times), 2)))


def test_what_is_missing_is_named():
    with pytest.raises(InvalidInput, match="no joint c; it has a, b"):
        record().joints(["a", "c"])
    with pytest.raises(InvalidInput, match="no row has a position of every joint"):
        prepare(record(q=np.full((len(T), 2), np.nan)))
    with pytest.raises(InvalidInput, match="no stretch of 100 samples"):
        prepare(record(T[:40]))
    with pytest.raises(InvalidInput, match="up to 200 Hz"):
        prepare(record(), band=240.0)
