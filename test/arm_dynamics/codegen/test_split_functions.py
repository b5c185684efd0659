# SPDX-License-Identifier: Apache-2.0
"""Long generated functions in pieces: different code, the same numbers."""

import os
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from arm_dynamics import ArmModel, load_scene
from arm_dynamics.codegen import Kernel, generate
from arm_dynamics.codegen import kernel as kernels
from arm_dynamics.codegen.split_functions import divided
from arm_sim.plant.plant import Plant
from benchmarks.robots.urdf import chain_urdf


@pytest.fixture(scope="module")
def rhs() -> ca.Function:
    """Equation of motion of five joints, some 500 operations."""
    return Plant(ArmModel(load_scene(chain_urdf(5)))).rhs


@pytest.mark.parametrize(("piece", "cores"), [(1, 1), (100, 1), (100, 3), (10_000, 1)])
def test_the_same_bits(
    rhs: ca.Function, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, piece: int, cores: int
) -> None:
    """Also of pieces that several processes compile."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(cores))
    whole = Kernel([rhs], "native").call("rhs")
    monkeypatch.setattr(kernels, "divided", lambda source: divided(source, 0, piece))
    pieces = Kernel([rhs], "native").call("rhs")
    for x in np.random.default_rng(1).normal(size=(20, 10)):
        np.testing.assert_array_equal(pieces(x, x[:5], [])[0], whole(x, x[:5], [])[0])


def test_what_is_no_list_of_assignments_stays_as_it_is() -> None:
    x = ca.MX.sym("x", 3)
    source = generate([ca.Function("f", [x], [ca.norm_2(x) * ca.sin(x)])])
    assert divided(source, 0, 1) == source


def test_arms_of_many_joints_come_in_pieces() -> None:
    assert "noinline" in generate([Plant(ArmModel(load_scene(chain_urdf(20)))).rhs])
