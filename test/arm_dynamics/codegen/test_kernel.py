# SPDX-License-Identifier: Apache-2.0
"""Generated functions against Pinocchio, on every robot and on random trees."""

import casadi as ca
import numpy as np
import pytest
from samples import sampled

import models
from arm_dynamics import ArmModel, InvalidInput, KernelError, load_scene
from arm_dynamics.codegen import Kernel, operations
from arm_dynamics.equations import rigid_body
from arm_dynamics.equations.forward_dynamics import articulated_bodies
from arm_dynamics.equations.tree import Tree
from arm_dynamics.model.tree_builder import tree_of
from arm_sim.plant.plant import Plant
from models.oracle import Oracle
from models.random_tree import random_tree
from tolerances import ALGEBRA, BACKENDS, assert_close

STATES = 20
EACH = sampled(models.ROBOTS, 6)
Array = np.ndarray


def forward_error(oracle: Oracle, q: Array, v: Array, tau: Array, a: Array, bias: Array) -> float:
    """How far the torque that Pinocchio needs for ``a`` is from ``tau``, relative to the terms
    that make it up.
    """
    M = oracle.mass_matrix(q)
    terms = np.abs(M) @ np.abs(a) + np.abs(bias) + np.abs(tau)
    return float(np.abs(M @ a + bias - tau).max() / terms.max())


def parameters(plant: Plant, v: Array) -> Array:
    """Nominal values and, where joints may be held, the direction in which each slides."""
    slides = np.sign(v) if plant.model.has_dry_friction else np.ones(plant.layout.directions)
    return np.r_[plant.parameters.nominal, slides]


def laws(tree: Tree, n: int, gravity: tuple[float, ...]) -> ca.Function:
    """(q, v, a) -> inverse dynamics, M, gravity torque."""
    q, v, a = (ca.SX.sym(name, n) for name in "qva")
    g = ca.SX(ca.DM(list(gravity)))
    results = [rigid_body.inverse(tree, q, v, a, g), rigid_body.mass_matrix(tree, q),
               rigid_body.gravity_torque(tree, q, g)]  # fmt: skip
    return ca.Function("laws", [q, v, a], results)


def agrees(scene: object, oracle: Oracle, rng: np.random.Generator, regroup: bool = True) -> None:
    model = ArmModel(scene)
    function = laws(tree_of(model, regroup=regroup), model.n, model.scene.gravity)
    for _ in range(STATES):
        q, v, a = models.random_state(rng, model.n)
        tau, M, weight = (np.array(x) for x in function(q, v, a))
        assert_close(tau.ravel(), oracle.rigid(q, v, a), ALGEBRA)
        assert_close(M, oracle.mass_matrix(q), ALGEBRA)
        assert_close(weight.ravel(), oracle.gravity(q), ALGEBRA)


@pytest.mark.parametrize("robot", EACH)
def test_compiled_forward_dynamics(robot: str, rng: np.random.Generator) -> None:
    """Rigid body with friction, by the algorithm that was chosen for the robot."""
    plant, oracle = Plant(models.dynamics(robot).model), models.oracle(robot)
    call = Kernel([plant.mechanics.acceleration], backend="native").call("acceleration")
    for _ in range(STATES):
        q, v, tau = models.random_state(rng, oracle.n)
        (a,) = call(q, v, tau, parameters(plant, v))
        assert forward_error(oracle, q, v, tau, a, oracle.inverse(q, v, 0 * v)) < ALGEBRA


@pytest.mark.parametrize("robot", EACH)
def test_inverse_dynamics_M_and_gravity(robot: str, rng: np.random.Generator) -> None:
    agrees(models.scene(robot), models.oracle(robot), rng)


@pytest.mark.parametrize("regroup", [True, False], ids=["regrouped", "as built"])
@pytest.mark.parametrize("joints", sampled([1, 2, 4, 7, 12], 3))
def test_random_trees(joints: int, regroup: bool, rng: np.random.Generator) -> None:
    scene = load_scene(random_tree(rng, joints))
    agrees(scene, Oracle(scene), rng, regroup)


@pytest.mark.parametrize("joints", sampled([1, 3, 12, 6, 25], 3))
def test_both_forward_algorithms_on_random_trees(joints: int, rng: np.random.Generator) -> None:
    scene = load_scene(random_tree(rng, joints))
    model, oracle = ArmModel(scene), Oracle(scene)
    q, v, tau = (ca.SX.sym(name, model.n) for name in ("q", "v", "tau"))
    g = ca.SX(ca.DM(list(scene.gravity)))
    for law in (rigid_body.forward_dense, articulated_bodies):
        function = ca.Function("f", [q, v, tau], [law(tree_of(model), q, v, tau, g)])
        for _ in range(5):
            state = models.random_state(rng, model.n)
            a = np.array(function(*state)).ravel()
            bias = oracle.rigid(state[0], state[1], 0 * a)
            assert forward_error(oracle, *state, a, bias) < ALGEBRA


@pytest.mark.parametrize("name", sampled(["panda", "gripper", "z1", "skew_axes"], 2))
def test_virtual_machine_equals_native_code(name: str, rng: np.random.Generator) -> None:
    plant = Plant(models.dynamics(name).model)
    native, virtual = (
        Kernel([plant.mechanics.acceleration], backend=backend).call("acceleration")
        for backend in ("native", "vm")
    )
    for _ in range(STATES):
        q, v, tau = models.random_state(rng, plant.model.n)
        args = (q, v, tau, parameters(plant, v))
        assert_close(virtual(*args)[0], native(*args)[0], BACKENDS)


def test_backend_is_named() -> None:
    functions = [Plant(ArmModel(models.scene("gantry"))).mechanics.acceleration]
    assert Kernel(functions, backend="native").native
    assert not Kernel(functions, backend="vm").native
    with pytest.raises(InvalidInput, match=r"gpu.*native"):
        Kernel(functions, backend="gpu")


def test_what_the_virtual_machine_cannot_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where code has to be compiled, its lack is one error that says who needs it and what to
    do.
    """
    x = ca.SX.sym("x")
    functions = [ca.Function("f", [x], [x + 1])]
    assert Kernel(functions, needs_native="dry friction").native
    with pytest.raises(KernelError, match=r"'vm'.*dry friction needs compiled code.*auto, native"):
        Kernel(functions, backend="vm", needs_native="dry friction")
    monkeypatch.setenv("CC", "/no/such/compiler")
    for backend in ("auto", "native"):
        with pytest.raises(KernelError) as said:
            Kernel(functions, backend, needs_native="dry friction")
        for word in ("dry friction", "no C compiler", "apt install gcc", "./arm build SCENE",
                     "ARM_CACHE=DIR"):  # fmt: skip
            assert word in str(said.value)


def test_calls_are_independent() -> None:
    """Each bound call has memory of its own."""
    x = ca.SX.sym("x", 2)
    kernel = Kernel([ca.Function("twice", [x], [2 * x])])
    first, second = kernel.call("twice"), kernel.call("twice")
    (out,) = first(np.array([1.0, 2.0]))
    second(np.array([5.0, 6.0]))
    np.testing.assert_array_equal(out, [2.0, 4.0])


@pytest.mark.parametrize("backend", ["native", "vm"])
def test_matrices_and_empty_arguments(backend: str) -> None:
    x, none = ca.SX.sym("x", 3), ca.SX.sym("none", 0)
    kernel = Kernel([ca.Function("outer", [x, none], [x @ x[:2].T])], backend=backend)
    (out,) = kernel.call("outer")(np.array([1.0, 2.0, 3.0]), np.zeros(0))
    np.testing.assert_array_equal(out, np.outer([1, 2, 3], [1, 2]))


def test_operations_are_counted_through_calls() -> None:
    x = ca.SX.sym("x")
    inner = ca.Function("inner", [x], [x * x + 1])
    y = ca.MX.sym("y")
    assert operations(inner) == 2
    assert operations(ca.Function("outer", [y], [inner(inner(y)) * y])) == 5


def test_regrouping_saves_work_and_changes_nothing(rng: np.random.Generator) -> None:
    """Moving inertia to the parent where the joint cannot tell the difference only shortens the
    equations.
    """
    model = ArmModel(models.scene("panda"))
    short, whole = (
        laws(tree_of(model, regroup=r), model.n, model.scene.gravity) for r in (True, False)
    )
    assert operations(short) < operations(whole)
