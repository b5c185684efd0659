# SPDX-License-Identifier: Apache-2.0
"""Outliers that an end stop may cause are said to be there."""

from types import SimpleNamespace

import numpy as np
import pytest

from arm_dynamics import ArmModel, load_scene
from arm_studies.identification import JointRecord, prepare
from arm_studies.identification.regression.irregularities import without_outliers
from arm_studies.identification.regression.regressor import RigidRegressor
from arm_studies.identification.regression.rows.rows import Rows
from arm_studies.identification.regression.rows.samples import Samples


@pytest.mark.parametrize(("joint", "cause"), [(0, "stiction, contact or"), (1, "its end stop")])
def test_outliers_at_an_end_stop_are_said_to_be_there(joint, cause):
    model, t = ArmModel(load_scene("two_link")), np.arange(0.0, 20.0, 0.01)
    q = np.column_stack([np.sin(2.1 * t), 0.7 * np.cos(1.3 * t)])
    record = JointRecord.of(model.joint_names, t, q, np.cos(q), np.cos(q), -np.sin(q))
    motion = prepare(record, np.inf)
    rows = Rows(Samples(RigidRegressor(model), [motion]))
    rows.samples.q[5:15, 1] = model.stops.place[1, 1] - 1e-3
    residual = np.random.default_rng(1).normal(0.0, 1e-3, rows.samples.q.shape)
    residual[5:15, joint] = 1.0
    fit = SimpleNamespace(rows=rows, residual=residual)
    kept, (note,) = without_outliers(fit, rows.samples.valid)
    assert cause in note and model.joint_names[joint] in note and not kept[5:15, joint].any()
