# SPDX-License-Identifier: Apache-2.0
"""Generated functions against Pinocchio, on every robot and on random trees."""

import casadi as ca
import numpy as np
import pytest
from samples import sampled

import models
from arm_dynamics import ArmModel, InvalidInput, KernelError, load_scene
from arm_dynamics.codegen import Kernel
from arm_dynamics.equations import rigid_body
from arm_dynamics.equations.forward_dynamics import articulated_bodies
from arm_dynamics.model.tree_builder import tree_of
from arm_sim.plant.plant import Plant
from models.oracle import Oracle
from models.random_tree import random_tree
from tolerances import ALGEBRA, BACKENDS, assert_close

STATES = 10
Array = np.ndarray


def forward_error(oracle: Oracle, q: Array, v: Array, tau: Array, a: Array, bias: Array) -> float:
    """How far the torque that Pinocchio needs for ``a`` is from ``tau``, relative to the terms
    that make it up.
    """
    M = oracle.mass_matrix(q)
    terms = np.abs(M) @ np.abs(a) + np.abs(bias) + np.abs(tau)
    return float(np.abs(M @ a + bias - tau).max() / terms.max())


@pytest.mark.parametrize("robot", sampled(models.ROBOTS, 4))
def test_compiled_forward_dynamics(robot: str, rng: np.random.Generator) -> None:
    """Rigid body with friction, by the algorithm that was chosen for the robot."""
    plant, oracle = Plant(models.dynamics(robot).model), models.oracle(robot)
    native, virtual = (
        Kernel([plant.mechanics.acceleration], backend=backend).call("acceleration")
        for backend in ("native", "vm")
    )
    for _ in range(STATES):
        q, v, tau = models.random_state(rng, oracle.n)
        # Where joints may be held, the direction in which each slides.
        slides = np.sign(v) if plant.model.has_dry_friction else np.ones(plant.layout.directions)
        p = np.r_[plant.parameters.nominal, slides]
        (a,), (same,) = (call(q, v, tau, p) for call in (native, virtual))
        assert forward_error(oracle, q, v, tau, a, oracle.inverse(q, v, 0 * v)) < ALGEBRA
        assert_close(same, a, BACKENDS)


@pytest.mark.parametrize("regroup", [True, False], ids=["regrouped", "as built"])
@pytest.mark.parametrize("joints", sampled([1, 4, 12], 2))
def test_random_trees(joints: int, regroup: bool, rng: np.random.Generator) -> None:
    """Inverse dynamics, mass matrix and weight, and forward dynamics by both algorithms."""
    scene = load_scene(random_tree(rng, joints))
    model, oracle = ArmModel(scene), Oracle(scene)
    q, v, x = (ca.SX.sym(name, model.n) for name in "qvx")
    tree, g = tree_of(model, regroup=regroup), ca.SX(ca.DM(list(scene.gravity)))
    laws = [rigid_body.inverse_dynamics(tree, q, v, x, g), rigid_body.mass_matrix(tree, q),
            rigid_body.gravity_torque(tree, q, g), rigid_body.forward_dense(tree, q, v, x, g),
            articulated_bodies(tree, q, v, x, g)]  # fmt: skip
    function = ca.Function("laws", [q, v, x], laws)
    for _ in range(STATES):
        state = models.random_state(rng, model.n)
        tau, M, weight, *accelerations = (np.array(y) for y in function(*state))
        assert_close(tau.ravel(), oracle.rigid(*state), ALGEBRA)
        assert_close(M, oracle.mass_matrix(state[0]), ALGEBRA)
        assert_close(weight.ravel(), oracle.gravity(state[0]), ALGEBRA)
        bias = oracle.rigid(*state[:2], 0 * state[2])
        for a in accelerations:
            assert forward_error(oracle, *state, a.ravel(), bias) < ALGEBRA


def test_what_the_virtual_machine_cannot_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """The lack of compiled code is one error that says who needs it and what to do."""
    x = ca.SX.sym("x")
    functions = [ca.Function("f", [x], [x + 1])]
    assert Kernel(functions, needs_native="dry friction").native
    with pytest.raises(InvalidInput, match=r"gpu.*native"):
        Kernel(functions, backend="gpu")
    with pytest.raises(KernelError, match=r"'vm'.*dry friction needs compiled code.*auto, native"):
        Kernel(functions, backend="vm", needs_native="dry friction")
    monkeypatch.setenv("CC", "/no/such/compiler")
    with pytest.raises(KernelError, match=r"dry friction.*no C compiler.*install gcc.*ARM_CACHE"):
        Kernel(functions, "auto", needs_native="dry friction")


@pytest.mark.parametrize("backend", ["native", "vm"])
def test_calls_are_independent(backend: str) -> None:
    """Each bound call has memory of its own; matrices and empty arguments keep their shapes."""
    x, none = ca.SX.sym("x", 3), ca.SX.sym("none", 0)
    kernel = Kernel([ca.Function("outer", [x, none], [x @ x[:2].T])], backend=backend)
    first, second = kernel.call("outer"), kernel.call("outer")
    (out,) = first(np.array([1.0, 2.0, 3.0]), np.zeros(0))
    second(np.array([5.0, 6.0, 7.0]), np.zeros(0))
    np.testing.assert_array_equal(out, np.outer([1, 2, 3], [1, 2]))
