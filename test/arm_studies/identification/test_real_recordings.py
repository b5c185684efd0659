# SPDX-License-Identifier: Apache-2.0
"""Real arms: what ``identify`` leaves of the torques held out; least squares leave 7.0 and 2.1 %.

The recordings are the Automatic Control Group's (University of Salerno, BSD-3) and not part of
this repository; without them there is nothing to test.
"""

import os
from pathlib import Path

import pytest
from samples import always

from arm_studies.identification import identify
from arm_studies.identification.data import read_joint_record
from arm_studies.identification.regression import bodies

BESIDE = Path(__file__).parents[4] / "shared/data/identification"
FOLDER = Path(os.environ.get("ARM_RECORDINGS", BESIDE))
CASES = [
    ("ur10", 5.0, 0.029),
    ("ur10", None, 0.029),
    ("panda", 4.4, 0.021),
    ("panda", None, 0.018),
]


@pytest.mark.parametrize(("robot", "band", "most"), always(CASES, CASES[3]))
def test_little_is_left(robot: str, band: float | None, most: float) -> None:
    path = FOLDER / f"{robot}_exciting_trajectory.db3"
    if not path.exists():
        pytest.skip(f"no '{path}'; ARM_RECORDINGS names the folder of the recordings")
    found = identify(robot, read_joint_record(path), band=band)
    assert found.error[0] < most
    assert all(bodies.consistent(body) for body in found.bodies)
    if robot == "panda":
        assert any("14 rows repeat the one before" in note for note in found.notes)
        assert any("samples are evenly spaced" in note for note in found.notes)
