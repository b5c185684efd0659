# SPDX-License-Identifier: Apache-2.0
"""Columns of friction at a tenth of the measured times are those of all times, filtered."""

from types import SimpleNamespace

import numpy as np
import pytest

from arm_dynamics import ArmModel, load_scene
from arm_studies.identification import JointRecord, prepare
from arm_studies.identification.regression import friction
from arm_studies.identification.regression.irregularities import without_outliers
from arm_studies.identification.regression.regressor import RigidRegressor
from arm_studies.identification.regression.rows.rows import Rows
from arm_studies.identification.regression.rows.samples import Samples
from arm_studies.identification.signals.decimation import REACH, decimated, spread

STRIDE = 10


def test_what_would_fold_is_left_out_and_the_band_is_kept():
    t = np.arange(4000.0)
    for periods, gain in ((0.02, 1.0), (0.1, 1.0), (0.92, 0.0), (2.0, 0.0)):
        x = np.cos(2.0 * np.pi * periods * t / STRIDE)
        inside = slice(REACH, -REACH)
        rows = decimated(x, STRIDE)[inside]
        np.testing.assert_allclose(rows, gain * x[::STRIDE][inside], atol=3e-6)
    np.testing.assert_allclose(decimated(t, 1), t, atol=1e-11)


def test_weights_give_the_product_with_any_factor(rng):
    x, f = np.sign(rng.standard_normal(3000)), rng.standard_normal(300)
    product = decimated(x * np.interp(np.arange(3000.0) / STRIDE, np.arange(300), f), STRIDE)
    near = f[150 - REACH : 151 + REACH]
    np.testing.assert_allclose(spread(x, STRIDE)[150] @ near, product[150], atol=1e-13)


def test_friction_under_load_is_that_of_all_measured_times():
    t = np.arange(0.0, 20.0, 1e-3)
    q = np.column_stack([np.sin(2.1 * t), 0.7 * np.cos(1.3 * t)])
    (motion,) = (rows := rows_of(t, q)).samples.whole
    assert len(t) > 10 * len(rows.samples.v)
    kinds = friction.VISCOUS, friction.COULOMB, friction.EXCESS
    law = friction.JointFit(kinds, friction.Shape(0.1, 0.6, 3.0))
    load, v = 3.0 * np.sin(1.7 * t), motion.v[:, 0]
    growth, way = law.shape.growth(load), np.sign(v)
    dense = np.column_stack([v, way * growth, way * growth * np.exp(-((v / 0.1) ** 2))])
    stride = round((rows.samples.motions[0].time[1] - t[0]) / 1e-3)
    expected = motion.filtered(dense)[::stride]
    inside = rows.samples.valid.all(axis=1)
    found = rows.friction(law, 0, load[::stride])
    np.testing.assert_allclose(found[inside], expected[inside], atol=1e-3)


def rows_of(t, q):
    model = ArmModel(load_scene("two_link"))
    motion = prepare(JointRecord.of(model.joint_names, t, q, np.ones_like(q)), 8.0)
    return Rows(Samples(RigidRegressor(model), [motion]))


def test_a_joint_that_sticks_at_a_reversal_is_left_out():
    """The filtered velocity is not zero then: the filter rings."""
    t = np.arange(0.0, 8.25, 1e-3)
    way = np.where(t < 4.0, t, np.maximum(t - 0.25, 4.0))  # rests for a quarter of a second
    q = np.column_stack([1.0 - np.cos(0.5 * np.pi * way), np.sin(t)])
    rows = rows_of(t, q)
    at = rows.samples.motions[0].time
    resting, moving = (at > 4.0) & (at < 4.25), (at > 1.0) & (at < 3.9)
    assert abs(rows.samples.v[resting, 0]).max() > 1e-3
    assert not rows.samples.use[resting, 0].any()
    assert rows.samples.use[resting, 1].all()
    for j, reversal in enumerate((2.0, 0.5 * np.pi)):
        near = abs(at - reversal) < 0.3 / 8.0
        assert not rows.samples.use[near, j].any()
        assert rows.samples.use[moving & (abs(at - reversal) > 0.05), j].all()


def test_friction_of_a_joint_that_sticks_leaves_no_trace_in_cleared_rows(rng):
    """Whatever it is; the torques of its motion stay."""
    t = np.arange(0.0, 12.0, 1e-3)
    q = np.column_stack([np.sin(2.1 * t), 0.7 * np.cos(1.3 * t)])
    rows = rows_of(t, q)
    unknown = rows.filtered(rows.samples.still * rng.normal(size=rows.samples.still.shape))
    whitened = rows.whitened(np.ones(2), np.full(2, 1e-3))
    for j in range(2):
        use = rows.samples.use[:, j]
        assert abs(unknown[use, j]).max() > 0.1
        assert abs(whitened.whiten(unknown)[use, j]).max() < 3e-2
        left = np.linalg.norm(whitened.inertia[use, j]) / np.linalg.norm(rows.inertia[use, j])
        assert 0.5 < left < 0.99
    np.testing.assert_array_equal(whitened.unwhitened.effort, rows.effort)


def test_rows_of_a_joint_that_mostly_sticks_are_not_used():
    """Its unknowns would explain a few exactly, so that these would weigh more than all others."""
    t = np.arange(0.0, 12.0, 1e-3)
    for moving, used in ((0.5, False), (6.0, True)):
        rows = rows_of(t, np.column_stack([np.sin(2.1 * t), np.clip(t - 3.0, 0.0, moving)]))
        assert rows.samples.use[:, 0].any() and rows.samples.use[:, 1].any() == used


@pytest.mark.parametrize(("joint", "cause"), [(0, "stiction, contact or"), (1, "its end stop")])
def test_outliers_at_an_end_stop_are_said_to_be_there(joint, cause):
    t = np.arange(0.0, 20.0, 0.01)
    samples = (rows := rows_of(t, np.column_stack([np.sin(2.1 * t), np.cos(1.3 * t)]))).samples
    samples.q[100:110, 1] = samples.regressor.model.stops.place[1, 1] - 1e-3
    residual = np.random.default_rng(1).normal(0.0, 1e-3, samples.q.shape)
    residual[100:110, joint] = 1.0
    fit = SimpleNamespace(rows=rows, residual=residual)
    kept, (note,) = without_outliers(fit, samples.valid)
    assert cause in note and samples.names[joint] in note and not kept[100:110, joint].any()
