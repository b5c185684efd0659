# SPDX-License-Identifier: Apache-2.0
"""Joints that stick in long arms: two ways to the same accelerations and reactions."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

from arm_dynamics import ArmModel, load_scene
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_sim.plant.parameters import Parameters
from arm_sim.plant.plant import Plant
from arm_sim.plant.response import RecursiveResponse, Response
from arm_sim.plant.symbols import Joints, Symbols
from models.large import mobile, snake
from tolerances import INVERSE_PAIR, assert_close

DRY = {"*": {"friction": {"coulomb": 0.3, "viscous": 0.1}}}


@pytest.mark.parametrize("joints", [DRY, {"*": {}}], ids=["dry", "rigid stops"])
@one_at_a_time
def test_recursion_and_mass_matrix_agree(
    joints: dict[str, dict[str, Any]], rng: np.random.Generator
) -> None:
    model = ArmModel(load_scene({"robot": {"urdf": mobile(rng, 17)}, "joints": joints}))
    s = Symbols(model, Parameters(model))
    does = Joints(model, s)
    push, change = ca.SX.sym("push", 17), ca.SX.sym("change", 17)
    answers = []
    for kind in (Response, RecursiveResponse):
        response = kind(model, s, does)
        a = response.accelerations(response.load)
        results = [a, response.reactions(response.load, a), *response.impact(push, change)]
        given = [s.q, s.v, s.tau, does.p, push, change]
        answers.append(ca.Function("answer", given, results))
    for _ in range(5):
        state, modes = rng.uniform(-1.0, 1.0, (3, 17)), rng.integers(-1, 2, does.p.shape[0])
        slide = ca.Function("sliding", [does.p], [does.sliding])  # 0 for joints that are held
        held = np.array(slide(modes)).ravel() == 0.0
        blow = rng.uniform(-1.0, 1.0, 17), rng.uniform(-1.0, 1.0, 17) * held
        dense, recursive = (answer(*state, modes, *blow) for answer in answers)
        for ours, theirs in zip(recursive, dense, strict=True):
            assert_close(np.array(ours), np.array(theirs), INVERSE_PAIR)
        a, _, gain, _ = (np.array(answer).ravel() for answer in recursive)
        np.testing.assert_array_equal(a[held], 0.0)
        np.testing.assert_array_equal(gain[held], blow[1][held])


def test_long_arms_take_the_recursion(rng: np.random.Generator) -> None:
    arms = ({"robot": {"urdf": snake(rng, n)}, "joints": DRY} for n in (3, 18))
    plants = (Plant(ArmModel(load_scene(arm))) for arm in arms)
    methods = [plant.mechanics.method.split(",")[0] for plant in plants]
    assert methods == [Response.algorithm, RecursiveResponse.algorithm]
