# SPDX-License-Identifier: Apache-2.0
"""Real arms: what least squares leave of the torques held out, and what ``identify`` leaves.

The recordings are the Automatic Control Group's (University of Salerno, BSD-3) and not part of
this repository; without them there is nothing to test.
"""

import os
from pathlib import Path

import numpy as np
import pytest
from samples import always

from arm_dynamics import ArmModel, load_scene
from arm_studies.identification import JointRecord, identify, mapped, prepare
from arm_studies.identification.data import read_joint_record
from arm_studies.identification.regression import bodies
from arm_studies.identification.regression.regressor import RigidRegressor
from arm_studies.identification.signals.filtering import ZeroPhase

BESIDE = Path(__file__).parents[4] / "shared/data/identification"
FOLDER = Path(os.environ.get("ARM_RECORDINGS", BESIDE))
CASES = {"ur10": 5.0, "panda": 4.4}  # low-passes in [Hz] with which least squares are known


def record(robot: str) -> JointRecord:
    path = FOLDER / f"{robot}_exciting_trajectory.db3"
    if not path.exists():
        pytest.skip(f"no '{path}'; ARM_RECORDINGS names the folder of the recordings")
    return read_joint_record(path)


def least_squares(robot: str, told: JointRecord, band: float) -> float:
    """Relative error on the last 30 % of bodies, Coulomb, viscous friction, offset, armature."""
    model = ArmModel(load_scene(robot))
    motion = prepare(mapped(told, model.joint_names), band)
    Y = RigidRegressor(model)(motion.q, motion.v, motion.a)
    own = [motion.a, motion.v, np.sign(motion.v), np.ones_like(motion.v)]
    A = np.concatenate([Y, *(x[:, :, None] * np.eye(model.n) for x in own)], axis=2)
    low_pass = ZeroPhase(band, motion.dt)
    A, y = low_pass(A), low_pass(motion.effort)
    rows = np.flatnonzero(motion.valid.all(axis=1))
    train, test = rows[rows < 0.7 * len(y)], rows[rows >= 0.7 * len(y)]
    x = np.linalg.lstsq(A[train].reshape(-1, A.shape[2]), y[train].ravel(), rcond=1e-10)[0]
    return float(np.linalg.norm((y - A @ x)[test]) / np.linalg.norm(y[test]))


@pytest.mark.parametrize("robot", always(CASES))
def test_less_is_left_than_by_least_squares(robot: str) -> None:
    told, band = record(robot), CASES[robot]
    found = identify(robot, told, band=band)
    assert all(bodies.consistent(body) for body in found.bodies)
    if robot == "ur10":
        assert found.error[0] < 0.5 * least_squares(robot, told, band)
    else:  # whose residual is the noise of the efforts by two thirds
        assert found.error[0] < 0.02
        assert any("14 rows repeat the one before" in note for note in found.notes)
        assert any("samples are evenly spaced" in note for note in found.notes)


@pytest.mark.parametrize(
    ("robot", "most"), always([("ur10", 0.029), ("panda", 0.018)], ("panda", 0.018))
)
def test_without_being_told_a_band(robot: str, most: float) -> None:
    found = identify(robot, record(robot))
    assert found.error[0] < most
