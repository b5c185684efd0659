# SPDX-License-Identifier: Apache-2.0
"""The words of a report say of each joint what is known of it, and no more."""

from dataclasses import replace

import numpy as np
import pytest

from arm_dynamics import Dynamics
from arm_studies.identification import Identification, JointRecord, identify
from arm_studies.identification.regression.friction_columns import JointFit
from arm_studies.identification.report import friction_words, residual, share, text


@pytest.fixture(scope="module")
def found() -> Identification:
    t = np.arange(0.0, 12.0, 0.01)
    w = np.array([2.1, 3.3])
    q, v, a = 0.9 * np.sin(t[:, None] * w), 0.9 * w * np.cos(t[:, None] * w), None
    a = -q * w**2
    true = {
        "robot": {"urdf": "package://arm_sim/scenes/two_link.urdf"},
        "joints": {"*": {"friction": {"viscous": 0.4, "coulomb": 0.6}}},
    }
    tau = Dynamics(true).inverse(q, v, a)
    return identify("two_link", JointRecord.of(["shoulder", "elbow"], t, q, tau, v, a))


def test_only_a_joint_at_rest_did_not_move(found: Identification) -> None:
    without = replace(found, friction=(None, JointFit(())))
    assert friction_words(without, 0) == "unchanged: the joint did not move"
    assert friction_words(without, 1) == "none that opposes the motion was found"
    assert friction_words(found, 1) == "viscous 0.4, coulomb 0.6"


def test_an_unknown_error_is_not_a_number(found: Identification, tmp_path) -> None:
    rests = replace(
        found, error=(np.nan, np.nan), torque_error=found.torque_error | {"elbow": np.nan},
        torque_residual=found.torque_residual | {"elbow": np.nan},
    )  # fmt: skip
    assert share(rests.torque_error["elbow"], 1) == residual(rests, "elbow") == "unknown"
    assert share(0.0123, 1) == "1.2%"
    page = text(rests, tmp_path / "arm.yaml", ["run"], [tmp_path / "a.png", tmp_path / "b.png"])
    assert "**unknown**" in page and "nan" not in page
