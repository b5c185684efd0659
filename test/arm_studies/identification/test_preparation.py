# SPDX-License-Identifier: Apache-2.0
"""Even times, no lag, derivatives; faults of a recording are reported or refused."""

import numpy as np
import pytest

from arm_dynamics.exceptions import InvalidInput
from arm_studies.identification import JointRecord, prepare
from arm_studies.identification.preparation.even_record import resampled
from arm_studies.identification.signals.cutoff import chosen_band
from arm_studies.identification.signals.filtering import ZeroPhase

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
    made, (_, _, a) = prepare(record(q=noisy)), motion()
    assert np.std((made.a - a)[made.valid.all(axis=1)]) < 1e-2
    assert made.independent == pytest.approx(2.0 * made.band / RATE)


def test_uneven_times_become_even():
    t = T + 0.3 / RATE * np.sin(np.arange(len(T)))
    made = prepare(record(t), band=20.0)
    np.testing.assert_allclose(np.diff(made.time), made.dt, rtol=1e-9)
    _, v, _ = motion(made.time)
    inside = made.valid.all(axis=1)
    np.testing.assert_allclose(made.v[inside], v[inside], atol=5e-3)


def test_a_gap_makes_two_stretches_and_nothing_is_used_near_it():
    there = (T < 4.0) | (T > 4.5)
    made = prepare(record().rows(there), band=20.0)
    assert len(made.stretches) == 2
    assert any("gaps (3.998 to 4.502 s after the start)" in note for note in made.notes)
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
    assert not made.valid[abs(effort[:, 1]) == 0.9, 1].any()
    assert any("'b': effort saturated" in note for note in made.notes)


def without(x, rows, joint=1):
    """The same values without some of a joint's."""
    found = x.copy()
    found[rows, joint] = np.nan
    return found


def test_rows_that_lack_an_effort_are_left_out_alone():
    """Between short holes everything is used; near a long one the filter has not settled."""
    rng = np.random.default_rng(5)
    effort = rng.normal(size=(len(T), 2))
    few = rng.random(len(T)) < 0.05
    plain = prepare(record(effort=effort), band=20.0)
    made = prepare(record(effort=without(effort, few)), band=20.0)
    np.testing.assert_array_equal(made.valid[:, 0], plain.valid[:, 0])
    np.testing.assert_array_equal(made.valid[:, 1], plain.valid[:, 1] & ~few)
    long = (T >= 3.0) & (T < 3.2)
    made = prepare(record(effort=without(effort, long)), band=20.0)
    assert not made.valid[abs(T - 3.1) < 0.1 + 0.04, 1].any()
    assert made.valid[(abs(T - 3.1) > 0.4) & plain.valid[:, 1], 1].all()
    told = "'b': no effort in 100 rows (3.000 to 3.198 s after the start); its efforts there"
    assert f"{told} are not used" in made.notes


def test_computed_recordings_keep_their_values_where_rows_lack_some():
    parts = dict(zip("qva", motion(), strict=True))
    few = np.arange(len(T)) % 50 == 25
    made = prepare(record(**parts | {"v": without(parts["v"], few)}))
    assert np.isinf(made.band)
    assert not made.valid[few].any() and made.valid[1:-1][~few[1:-1]].all()
    for key, array in parts.items():
        np.testing.assert_allclose(getattr(made, key)[~few], array[~few], atol=1e-12)
    told = "'b': no velocity in 100 rows (0.050 s, 0.150 s, 0.250 s and 97 times more, after"
    assert any(note.startswith(told) for note in made.notes)


@pytest.mark.parametrize(
    ("start", "end", "value"),
    [(9.5, 11.0, None), (3.0, 3.2, 0.0), (3.0, 3.0 + np.pi, None)],
)
def test_efforts_that_freeze_while_the_joint_moves(start, end, value):
    """For a moment, to the end, at zero, and until the effort is what it was."""
    rng, at = np.random.default_rng(6), (T >= start) & (T < end)
    effort = np.sin(np.outer(T, [1.0, 2.0])) + 0.5 + 0.01 * rng.normal(size=(len(T), 2))
    effort[at, 1] = effort[at, 1][0] if value is None else value
    made = prepare(record(effort=effort), band=20.0)
    assert made.valid[abs(T - 8.0) < 1.0].all() and made.valid[abs(T - 3.1) < 0.1, 0].all()
    assert not made.valid[at, 1][1:].any()
    (note,) = made.notes
    assert note.startswith(f"'b': effort frozen in {np.count_nonzero(at) - 1} rows (")


def test_what_only_looks_frozen():
    """Coarse sensors, slow ones, constant commands, and joints at rest or in uniform motion."""
    wave = 0.9 * np.sin(np.outer(T, [1.0, 2.0]))
    steps = np.sign(wave)
    trapezoid = np.clip(3.0 * np.sin(2.0 * T), -1.0, 1.0)
    still = np.column_stack([motion()[0][:, 0], np.full(len(T), 0.3)])
    uniform = np.column_stack([motion()[0][:, 0], np.cumsum(trapezoid) / RATE])
    held = wave.copy()
    held[(T > 3.0) & (T < 4.0), 1] = 0.3
    constant = np.where(abs(trapezoid) == 1.0, 0.5 * trapezoid, wave[:, 1])
    bounded = np.column_stack([wave[:, 0], constant])
    for q, effort in (
        (motion()[0], np.round(wave, 1)),
        (motion()[0], np.repeat(wave[::50], 50, axis=0)),
        (motion()[0], steps),
        (still, held),
        (uniform, bounded),
    ):
        assert not any("frozen" in note for note in prepare(record(q=q, effort=effort)).notes)


def still(*times):
    return record(np.array(times), q=np.zeros((len(times), 2)))


REFUSED = {
    "jumps back": lambda: still(*T[:10], *T[5:]),
    "finite times": lambda: still(*T[:10], np.nan),
    "no joint c; it has a, b": lambda: record().joints(["a", "c"]),
    "no row has a position": lambda: prepare(record(q=np.full((len(T), 2), np.nan))),
    "no stretch of 100 samples": lambda: prepare(record(T[:40])),
    "up to 200 Hz": lambda: prepare(record(), band=240.0),
}


@pytest.mark.parametrize("said", REFUSED)
def test_what_cannot_be_used_is_refused(said):
    with pytest.raises(InvalidInput, match=said):
        REFUSED[said]()


def test_the_motion_is_that_at_the_time_of_the_efforts():
    """Of half a sample before, if the recording states it, or if it is told so."""
    t = np.arange(0.0, 6.0, 0.01)
    q = np.sin(2.0 * t)[:, None]
    for stated, told in ((0.005, 0.0), (None, 0.005), (0.005, 0.3)):
        even = resampled(JointRecord.of(["a"], t, q, np.ones_like(q), effort_age=stated))
        found = even.filtered(10.0, told)
        inside = slice(60, -60)
        np.testing.assert_allclose(
            found.q[inside, 0], np.sin(2.0 * (t - 0.005))[inside], atol=1e-6
        )
        np.testing.assert_allclose(
            found.a[inside, 0], -4.0 * np.sin(2.0 * (t - 0.005))[inside], atol=1e-4
        )
        assert found.aged == (stated is not None)
