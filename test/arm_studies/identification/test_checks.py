# SPDX-License-Identifier: Apache-2.0
"""Refusals of recordings and of identified scenes, on both sides of every bound."""

from collections.abc import Callable
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import InvalidInput
from arm_studies.identification import checks
from arm_studies.identification.data import JointRecord

ARM = models.dynamics("two_link").model  # its joints reach 3.1 and 2.8 rad to either side
NAMES = ARM.joint_names


def recorded(step: float = 0.01, **columns: tuple[int, Any]) -> JointRecord:
    """Of two joints that move; ``columns`` replace that of one joint."""
    t = step * np.arange(50)
    parts = {key: np.stack([np.sin(t), np.cos(t)], axis=1) for key in ("q", "effort")}
    for key, (joint, value) in columns.items():
        parts[key][:, joint] = value
    return JointRecord.of(NAMES, t, **parts)


def reaching(joint: int, far: float) -> dict[str, Any]:
    """Positions from zero to one beyond or within a limit."""
    return {"q": (joint, np.linspace(0.0, far, 50))}


@pytest.mark.parametrize(("given", "said"), [
    ({"step": 0.19}, None),
    ({"step": 0.21}, "samples are 0.21 s apart"),
    (reaching(0, 3.29), None),
    (reaching(0, 3.31), "'shoulder' range from 0 to 3.31, but"),
    (reaching(1, -3.01), "'elbow' range from -3.01 to 0, but"),
    ({"effort": (1, np.append(np.full(48, np.nan), [1.0, 2.0]))}, None),
    ({"effort": (1, np.nan)}, "no effort of joint 'elbow'"),
    ({"effort": (1, -3.0)}, "effort of joint 'elbow' is constantly -3"),
])  # fmt: skip
def test_recordings_are_refused_beyond_a_bound(given: dict[str, Any], said: str | None) -> None:
    with nullcontext() if said is None else pytest.raises(InvalidInput, match=said):
        checks.check_record(recorded(**given), ARM)


def test_one_joint_that_moves_in_one_recording_is_enough() -> None:
    still, turned = np.zeros((9, 2)), np.zeros((9, 2))
    turned[4] = [-1.1e-3, 0.0]
    some: list[Any] = [SimpleNamespace(q=q) for q in (still, turned)]
    np.testing.assert_allclose(checks.moved(some), [1.1e-3, 0.0])
    some[1].q[4] *= 0.9 / 1.1
    with pytest.raises(InvalidInput, match="no joint moves: the largest range .* is 0.0009"):
        checks.moved(some)


def masses(factor: float) -> Callable[[], None]:
    """A check of bodies that are so many times heavier, beside one without nominal mass."""
    nominal = np.array([0.0, 1.0, 2.0, 3.0])
    found = np.array([9.0, 1.0, 2.0 * factor, 3.0 * factor])
    return lambda: checks.check_masses(found, nominal, NAMES, np.array([1.0, 5.1]))


def explained(error: float) -> Callable[[], None]:
    return lambda: checks.check_explained(error, 0.3, NAMES, np.array([0.19, 1.0]))


@pytest.mark.parametrize(("check", "said"), [
    (explained(0.599), None),
    (explained(0.6), "leaves 60% .* scene 30%.*efforts over nominal torques: shoulder 0.19"),
    (explained(np.nan), "unexplained"),
    (masses(4.9), None),
    (masses(0.21), None),
    (masses(5.0), "5 times their nominal mass .*efforts over nominal torques: elbow 5.1"),
    (masses(0.19), "0.19 times their nominal mass"),
    (lambda: checks.check_better(0.2, 0.1, 2.5), None),
    (lambda: checks.check_better(0.1, 0.1, 9.0), None),
    (lambda: checks.check_better(0.2, 0.1, 2.6), "leaves 20.* more than the nominal scene, 10"),
])  # fmt: skip
def test_scenes_are_refused_beyond_their_bounds(
    check: Callable[[], None], said: str | None
) -> None:
    with nullcontext() if said is None else pytest.raises(InvalidInput, match=said):
        check()


def test_too_few_independent_measurements_are_refused_by_the_joint() -> None:
    """Of filtered values only a part is independent; held-out rows do not count."""
    least = checks.LEAST_ROWS
    valid, train = np.ones((4000, 2), dtype=bool), np.arange(4000) < 3000
    names = ["hip", "knee"]
    rows: Any = SimpleNamespace(valid=valid, train=train, independent=0.1, names=names)
    checks.check_count(rows, [])
    valid[: 3000 - 10 * least, 1] = False
    checks.check_count(rows, [])
    valid[: 3000 - 9 * least, 1] = False
    share = valid[:, 1].mean()
    notes = ["'hip': odd", "'knee': effort saturated", "'knee': frozen"]
    said = f"joint 'knee': {share:.0%} of the samples can be used, which is {0.9 * least:.0f} "
    with pytest.raises(InvalidInput, match=said) as error:
        checks.check_count(rows, notes)
    assert str(error.value).endswith("; 'knee': effort saturated; 'knee': frozen")
