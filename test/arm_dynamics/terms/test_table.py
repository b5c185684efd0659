# SPDX-License-Identifier: Apache-2.0
"""Each entry of the table: code that is wrong anywhere is refused, whatever it is of."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, KernelError, load_scene
from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.terms.arm import NumericArm, SymbolicArm
from arm_dynamics.terms.compiled import Request, function, rows, verify
from arm_dynamics.terms.table import CONSTRAINT_ROWS, TERMS, Entry
from tolerances import ALGEBRA

JOINT = {"friction": {"viscous": 0.3, "coulomb": 0.2}, "spring": {"stiffness": 2.0, "rest": 0.1}}
QUERIES = [(x, ("tip",) if x.selectors else ()) for x in TERMS] + [(CONSTRAINT_ROWS, (("loop",),))]
Values = Callable[[Mapping[str, np.ndarray]], np.ndarray]


def arm(entry: Entry, stiffness: float = 1.0, mass: float = 0.0) -> ArmModel:
    name = "four_bar" if entry is CONSTRAINT_ROWS else "planar_3r"
    scene: dict[str, Any] = models.scene(name).model_dump(exclude_unset=True)
    if name == "planar_3r":
        spring = JOINT["spring"] | {"stiffness": 2.0 * stiffness}
        scene["joints"] = {"*": JOINT | {"spring": spring}}
        if mass:
            frame = models.dynamics(name).model.frame_names[-1]
            scene["payloads"] = [{"frame": frame, "mass": mass, "com": [0.0, 0.0, 0.0]}]
    return ArmModel(load_scene(scene))


def numbers(model: ArmModel) -> NumericArm:
    return NumericArm(model, SteadyFriction.of(model))


@one_at_a_time
def evaluated(model: ArmModel, query: Request) -> tuple[Values, list[str]]:
    """Results of the expression, and its arguments."""
    point = function(SymbolicArm(model, SteadyFriction.of(model)), model.n, "f", [query], ())

    def values(arguments: Mapping[str, np.ndarray]) -> np.ndarray:
        states = zip(*(arguments[x] for x in point.name_in()), strict=True)
        results = (point.call(list(state)) for state in states)
        return np.array([np.hstack([x.full().ravel(order="F") for x in y]) for y in results])

    return values, point.name_in()


@pytest.mark.parametrize("query", QUERIES, ids=lambda query: query[0].name)
def test_an_error_of_one_part_in_a_million_is_refused(query: Request) -> None:
    model = arm(query[0])
    if query[0].selectors == ("frame",):
        query = query[0], (model.frame_names[-1],)
    right, names = evaluated(model, query)
    assert verify(numbers(model), *query, right, names) < ALGEBRA
    with pytest.raises(KernelError, match="differs from Pinocchio by 1.00e-06|by [0-9.]+e-0[67]"):
        verify(numbers(model), *query, lambda x: right(x) * (1 + 1e-6), names)
    with pytest.raises(KernelError, match="differs from Pinocchio by nan"):
        verify(numbers(model), *query, lambda x: right(x) + np.nan, names)
    parts = right({x: np.ones((1, 5 if x == "chosen" else model.n)) for x in names})[0]
    for i in np.flatnonzero(parts):
        off = 1.0 + 1e-5 * (np.arange(len(parts)) == i)
        with pytest.raises(KernelError):
            verify(numbers(model), *query, lambda x, off=off: right(x) * off, names)


def test_springs_are_compared_with_pinocchio_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    """Their numbers are of the same expression as the code."""
    entry = next(entry for entry in TERMS if entry.name == "spring")
    model = models.dynamics("spring_balanced_arm").model
    right, names = evaluated(model, (entry, ()))
    assert verify(numbers(model), entry, (), right, names) < ALGEBRA
    torque = RigidTerms.spring
    monkeypatch.setattr(RigidTerms, "spring", lambda self, q, v: torque(self, q, v) * (1 + 1e-6))
    with pytest.raises(KernelError, match="generated springs differs from Pinocchio"):
        verify(numbers(model), entry, (), lambda x: right(x) * (1 + 1e-6), names)


@pytest.mark.parametrize("change", [{"stiffness": 1.0 + 1e-6}, {"mass": 1e-6}], ids=str)
def test_another_arm_is_refused(
    change: dict[str, float], caplog: pytest.LogCaptureFixture
) -> None:
    entry = next(entry for entry in TERMS if entry.name == "energy")
    right, names = evaluated(arm(entry, **change), (entry, ()))
    with pytest.raises(KernelError, match="generated energy differs from Pinocchio"):
        verify(numbers(arm(entry)), entry, (), right, names)
    wrong = replace(entry, compared=lambda arm, result, *_: (result, 0.0 * result + 1.0))
    with caplog.at_level(logging.WARNING):
        assert rows(arm(entry), SteadyFriction.of(arm(entry)), [(wrong, ())]) is None
    assert "computed by Pinocchio, which is slower" in caplog.text
