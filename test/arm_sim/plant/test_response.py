# SPDX-License-Identifier: Apache-2.0
"""Joints that stick in long arms: two ways to the same accelerations and reactions."""

from __future__ import annotations

import casadi as ca
import numpy as np

from arm_dynamics import ArmModel, load_scene
from arm_sim.plant.parameters import Parameters
from arm_sim.plant.plant import Plant
from arm_sim.plant.response import RecursiveResponse, Response
from arm_sim.plant.symbols import Joints, Symbols
from models.large import mobile, snake
from tolerances import INVERSE_PAIR, assert_close

DRY = {"*": {"friction": {"coulomb": 0.3, "viscous": 0.1}}}


def test_recursion_and_mass_matrix_agree(rng: np.random.Generator) -> None:
    model = ArmModel(load_scene({"robot": {"urdf": mobile(rng, 20)}, "joints": DRY}))
    s = Symbols(model, Parameters(model))
    joints = Joints(model, s)
    answers = []
    for kind in (Response, RecursiveResponse):
        response = kind(model, s, joints)
        a = response.accelerations(response.load)
        results = [a, response.reactions(response.load, a)]
        answers.append(ca.Function("answer", [s.q, s.v, s.tau, joints.p], results))
    for _ in range(5):
        state, direction = rng.uniform(-1.0, 1.0, (3, 20)), rng.integers(-1, 2, 20)
        dense, recursive = (answer(*state, direction) for answer in answers)
        for ours, theirs in zip(recursive, dense, strict=True):
            assert_close(np.array(ours), np.array(theirs), INVERSE_PAIR)
        np.testing.assert_array_equal(np.array(recursive[0]).ravel()[direction == 0], 0.0)


def test_long_arms_take_the_recursion(rng: np.random.Generator) -> None:
    methods = [
        Plant(ArmModel(load_scene({"robot": {"urdf": snake(rng, n)}, "joints": DRY}))).method
        for n in (3, 18)
    ]
    assert [method.split(",")[0] for method in methods] == [
        Response.algorithm,
        RecursiveResponse.algorithm,
    ]
