# SPDX-License-Identifier: Apache-2.0
"""Fits of given friction laws leave out what is impossible, and say so."""

from types import SimpleNamespace

import numpy as np
import pytest

from arm_dynamics import ArmModel, load_scene
from arm_studies.identification import JointRecord, prepare
from arm_studies.identification.regression.bodies import consistent
from arm_studies.identification.regression.estimation import Prior, Problem
from arm_studies.identification.regression.fit import fitted
from arm_studies.identification.regression.friction import VISCOUS, JointFit
from arm_studies.identification.regression.irregularities import without_outliers
from arm_studies.identification.regression.regressor import RigidRegressor
from arm_studies.identification.regression.rows.rows import Rows
from arm_studies.identification.regression.rows.samples import Samples

MODEL = ArmModel(load_scene("two_link"))


def moved(duration):
    """The arm's regressor, and times and states of a motion of both joints."""
    t = np.arange(0.0, duration, 0.01)
    q = np.column_stack([np.sin(2.1 * t), 0.7 * np.cos(1.3 * t)])
    v = np.column_stack([2.1 * np.cos(2.1 * t), -0.91 * np.sin(1.3 * t)])
    return RigidRegressor(MODEL), t, q, v, -q * [2.1**2, 1.3**2]


@pytest.mark.parametrize(("factor", "changed"), [(1.0, False), (-1.0, True)])
def test_bodies_that_cannot_be_are_changed_and_it_is_told(factor, changed):
    regressor, t, q, v, a = moved(10.0)
    theta = regressor.nominal.copy()
    theta[-6:] *= factor  # moments and products of inertia of the last body
    tau = regressor(q, v, a) @ theta + 0.2 * v + 0.1 * a  # with rotors
    tau += 0.01 * np.random.default_rng(1).normal(size=tau.shape)
    motion = prepare(JointRecord.of(MODEL.joint_names, t, q, tau, v, a), np.inf)
    rows = Rows(Samples(regressor, [motion]))
    found = fitted(
        Problem(rows, rows.samples.use, Prior.near(regressor.nominal, 0.05, 0.5)),
        [JointFit((VISCOUS,))] * 2, consistent=True,
    )  # fmt: skip
    assert found.changed == changed
    assert consistent(found.x[10:20])


@pytest.mark.parametrize(("joint", "cause"), [(0, "stiction, contact or"), (1, "its end stop")])
def test_outliers_at_an_end_stop_are_said_to_be_there(joint, cause):
    regressor, t, q, v, a = moved(20.0)
    tau = regressor(q, v, a) @ regressor.nominal
    motion = prepare(JointRecord.of(MODEL.joint_names, t, q, tau, v, a), np.inf)
    rows = Rows(Samples(regressor, [motion]))
    rows.samples.q[5:15, 1] = MODEL.stops.place[1, 1] - 1e-3
    residual = np.random.default_rng(1).normal(0.0, 1e-3, rows.samples.q.shape)
    residual[5:15, joint] = 1.0
    fit = SimpleNamespace(rows=rows, residual=residual)
    kept, (note,) = without_outliers(fit, rows.samples.valid)
    assert cause in note and MODEL.joint_names[joint] in note and not kept[5:15, joint].any()
