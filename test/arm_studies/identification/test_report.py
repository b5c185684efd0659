# SPDX-License-Identifier: Apache-2.0
"""The words of a report say of each joint what is known of it, and no more."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from arm_dynamics import Dynamics
from arm_studies.identification import Identification, JointRecord, identify
from arm_studies.identification.regression.bodies import consistent
from arm_studies.identification.report import friction_words, joint_rows, text
from arm_studies.identification.validation import Errors


@pytest.fixture(scope="module")
def found() -> Identification:
    t = np.arange(0.0, 12.0, 0.01)
    w = np.array([2.1, 3.3])
    q, v = 0.9 * np.sin(t[:, None] * w), 0.9 * w * np.cos(t[:, None] * w)
    a = -q * w**2
    true = {
        "robot": {"urdf": "package://arm_sim/scenes/two_link.urdf"},
        "joints": {"*": {"friction": {"viscous": 0.4, "coulomb": 0.6}}},
    }
    tau = Dynamics(true).inverse(q, v, a)
    return identify("two_link", JointRecord.of(["shoulder", "elbow"], t, q, tau, v, a))


def test_bodies_that_cannot_be_are_changed_and_it_is_told(found: Identification) -> None:
    assert any("unconstrained fit is physically inconsistent" in note for note in found.notes)
    assert all(map(consistent, found.bodies))


def test_an_unknown_error_is_not_a_number(found: Identification) -> None:
    unknown = Errors(np.nan, np.nan)
    elbow = replace(found.joints[1], errors=unknown, residual=np.nan)
    rests = replace(found, error=unknown, joints=(found.joints[0], elbow))
    assert joint_rows(rests, 1)[1][2:4] == ["unknown", "unknown"]
    page = text(rests, Path("arm.yaml"), ["run"], [Path("a.png"), Path("b.png")])
    assert "**unknown**" in page and "nan" not in page
    assert "of the nominal scene unknown" in f"{replace(found, error=Errors(0.01, np.nan))!r}"
    assert friction_words(None) == "unchanged: the joint did not move"


def rows_of(page: str, heading: str) -> list[list[str]]:
    """Rows of the first table after a heading."""
    parts = page.partition(heading)[2].split("\n\n")
    lines = next(part for part in parts if part.startswith("|")).splitlines()
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines[2:]]


def test_the_report_has_each_parameter_with_its_interval_and_each_body(
    found: Identification,
) -> None:
    page = text(found, Path("x/arm.yaml"), ["run", "other"], [Path("a.png"), Path("b.png")])
    assert page.startswith("# arm: identified from run, other\n")
    rows = {row[0]: row[1:] for row in rows_of(page, "## Identified parameters")}
    assert len(rows) == len(found.parameters.keys() - found.missing.keys())
    value, interval, scene, nominal = rows["elbow: Coulomb"]
    assert (float(value), nominal) == (pytest.approx(0.6, rel=1e-2), "")
    low, high = map(float, interval.split(" to "))
    assert (low, high) == pytest.approx(found.intervals["elbow.coulomb"], rel=1e-3)
    assert float(scene) == pytest.approx(found.written["elbow.coulomb"], rel=1e-4)
    reasons = rows_of(page, "## Not identified")
    assert [row[1] for row in reasons] == list(found.missing.values())
    for row, name, body in zip(
        rows_of(page, "## Bodies"), found.body_names, found.bodies, strict=True
    ):
        assert row[0] == name and float(row[1]) == pytest.approx(body[0], rel=1e-3)
        centre = [float(x) for x in row[2].split(",")]
        np.testing.assert_allclose(centre, body[1:4] / body[0], rtol=1e-3, atol=1e-9)
