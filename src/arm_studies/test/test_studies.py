# SPDX-License-Identifier: Apache-2.0
"""The installed package identifies a payload."""

import numpy as np
import pytest

from arm_dynamics import Dynamics, load_scene
from arm_studies.identification import JointRecord, identify_payload

SCENE = "puma560"  # comes with arm_sim, robot included


def test_a_payload_comes_out_of_a_recording() -> None:
    scene = load_scene(SCENE).model_dump(exclude_unset=True, mode="json")
    hand = Dynamics(SCENE).model.frame_names[-1]
    dynamics = Dynamics(scene | {"payloads": [{"frame": hand, "mass": 0.7, "com": (0, 0, 0.1)}]})
    t, w = np.arange(0.0, 8.0, 0.01), np.linspace(2.0, 3.5, 6)
    q, v = np.sin(np.outer(t, w)), w * np.cos(np.outer(t, w))
    a = -(w**2) * q
    record = JointRecord.of(dynamics.joint_names, t, q, dynamics.inverse(q, v, a), v, a)
    assert identify_payload(scene, record, hand).mass == pytest.approx(0.7, rel=1e-2)
