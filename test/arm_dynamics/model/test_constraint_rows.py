# SPDX-License-Identifier: Apache-2.0
"""Constraint rows: the generated ones against Pinocchio's kinematics and finite differences, and
constrained dynamics against Pinocchio's own constraint algorithm.
"""

from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from samples import sampled

import models
from arm_dynamics import ConstraintError, Dynamics, InvalidInput, load_scene
from arm_dynamics.equations import constraint
from arm_dynamics.model import Robot
from arm_dynamics.model.constraint_rows import ConstraintRows
from arm_dynamics.model.tree_builder import linkage_of, tree_of
from arm_dynamics.task_space import TaskSpace
from models.linkages import scene
from tolerances import ALGEBRA, FINITE_DIFF, assert_close

TYPES: dict[str, dict[str, Any]] = {
    "point": {"type": "point"},
    "frame": {"type": "frame", "rpy": [0.3, 1.0, -0.4]},
    "line": {"type": "line", "direction": [1, 2, 3]},
    "plane": {"type": "plane", "normal": [1, -1, 2], "height": 0.1},
    "distance": {"type": "distance", "distance": 0.4},
    "rolling ball": {"type": "rolling", "radius": 0.2},
    "rolling wheel": {
        "type": "rolling", "radius": 0.2, "axle": [1, 0.1, 0.4], "normal": [0, 1, 1]
    },
}  # fmt: skip
# Near half a turn, where this is 2, the axis of a rotation is ill-determined.
HALF_TURN = 1.9
# Two frames that move against each other, and one against the world; a tree, skew axes, followers.
FRAMES = [
    ("two_arms", ("left_lower", "right_slide")), ("skew_axes", ("world", "third")),
    ("gripper", ("right_jaw", "left_jaw")),
]  # fmt: skip


def model_with(urdf: str, **given: Any) -> Robot:
    """The robot with one constraint; it need not be closed."""
    urdf = load_scene({"robot": {"urdf": str(models.FOLDER / f"{urdf}.urdf")}}).robot.urdf
    return Robot(load_scene({"robot": {"urdf": urdf}, "constraints": [given]}))


def generated(model: Robot) -> ca.Function:
    q, v = ca.SX.sym("q", model.n), ca.SX.sym("v", model.n)
    linkage = linkage_of(model, {0: range(ConstraintRows(model).counts[0])})
    rows = constraint.rows(linkage, tree_of(model), q, v, lambda _: 1.0)
    values = [ca.densify(x) for x in (rows.residual, rows.jacobian, rows.drift)]
    return ca.Function("rows", [q, v], values)


@pytest.mark.parametrize(("urdf", "frames"), sampled(FRAMES, 2), ids=str)
@pytest.mark.parametrize("kind", TYPES)
def test_generated_rows_are_pinocchios(
    kind: str, urdf: str, frames: tuple[str, str], rng: np.random.Generator
) -> None:
    """Residual, A and γ, by differentiation there and from frame motions here."""
    points = [[0.1, 0.2, -0.3], [0.3, -0.1, 0.2]]
    model = model_with(urdf, **TYPES[kind], frames=list(frames), points=points)
    rows, law = ConstraintRows(model), generated(model)
    for _ in range(5):
        q, v = rng.uniform(-1.2, 1.2, model.n), rng.normal(size=model.n)
        wanted = rows.stacked(q, v, rows.names)
        if kind == "frame" and np.linalg.norm(wanted.residual[3:]) > HALF_TURN:
            continue
        residual, A, drift = (np.array(x) for x in law(q, v))
        assert_close(residual.ravel(), wanted.residual[: residual.size], ALGEBRA)
        assert_close(A, wanted.jacobian, ALGEBRA)
        scale = max(1.0, float(abs(A).max()))
        assert_close(drift.ravel() / scale, wanted.drift / scale, ALGEBRA)


@pytest.mark.parametrize("kind", [name for name in TYPES if "rolling" not in name])
def test_rows_are_the_residuals_rates(kind: str, rng: np.random.Generator) -> None:
    """A v and A a + γ are first and second derivative of the residual along a motion."""
    model = model_with("two_arms", **TYPES[kind], frames=["left_lower", "right_slide"])
    rows = ConstraintRows(model)
    q, v, a = rng.uniform(-1.0, 1.0, (3, model.n))
    h = 1e-4
    path = [rows.at(q + t * v + 0.5 * t**2 * a, v)[0].residual for t in (-h, 0.0, h)]
    row = rows.at(q, v)[0]
    assert_close(row.jacobian @ v, (path[2] - path[0]) / (2 * h), FINITE_DIFF)
    second = (path[2] - 2 * path[1] + path[0]) / h**2
    assert_close(row.jacobian @ a + row.drift, second, FINITE_DIFF)


def test_a_coupling_is_linear() -> None:
    model = model_with("planar_3r", type="coupling", joints=["joint1", "joint3"], ratio=-2.0)
    row = ConstraintRows(model).at(np.array([0.5, 9.0, 0.1]), np.ones(3))[0]
    assert_close(row.residual, [0.7], ALGEBRA)
    assert_close(row.jacobian, [[1.0, 0.0, 2.0]], ALGEBRA)


LOOPS = {
    "slider_crank": ("rod", "slider", [0.4, 0, 0], [0, 0, 0]),
    "four_bar": ("coupler", "rocker", [0.3, 0, 0], [0.25, 0, 0]),
    "five_bar": ("left_forearm", "right_forearm", [0.3, 0, 0], [0.3, 0, 0]),
}


def pinocchio_loop(model: pin.Model, kind: pin.ContactType, loop: tuple[Any, ...]) -> Any:
    """The loop as Pinocchio's constraint between two frames."""
    places = []
    for name, point in ((loop[0], loop[2]), (loop[1], loop[3])):
        frame = model.frames[model.getFrameId(name)]
        offset = pin.SE3(np.eye(3), np.array(point, dtype=float))
        places += [frame.parentJoint, frame.placement * offset]
    return pin.RigidConstraintModel(kind, model, *places, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)


@pytest.mark.parametrize("name", LOOPS)
def test_accelerations_are_pinocchios(name: str, rng: np.random.Generator) -> None:
    """``pin.constraintDynamics`` with a proximal term, for a planar loop has a redundant row."""
    dyn = Dynamics(models.SCENES / f"{name}.yaml")
    model, closure = dyn.model, dyn.constrained.closure
    loop = pinocchio_loop(model.pin, pin.ContactType.CONTACT_3D, LOOPS[name])
    data, loop_data = model.pin.createData(), loop.createData()
    pin.initConstraintDynamics(model.pin, data, [loop], [loop_data])
    for _ in range(5):
        q, v = closure.closed(model.q0 + rng.normal(0.0, 0.1, dyn.n), rng.normal(size=dyn.n))
        tau = rng.normal(size=dyn.n)
        settings = pin.ProximalSettings(1e-14, 1e-12, 50)
        wanted = pin.constraintDynamics(
            model.pin, data, model.configuration(q), v, tau, [loop], [loop_data], settings
        )
        a, _ = dyn.constrained_forward(q, v, tau)
        assert_close(a, wanted, 1e-9)


@pytest.mark.parametrize("angle", [0.0, np.pi])
def test_laid_flat_a_parallelogram_still_has_accelerations(angle: float) -> None:
    """There its rows hold no more than across the rods, to rounding: the rest is left out."""
    dyn = Dynamics(models.FOLDER.parent / "reference/parallelograms_1.yaml")
    q, rest, tau = np.array([angle, -angle, angle]), np.zeros(3), np.array([1.0, 2.0, -3.0])
    a, lam = dyn.constrained_forward(q, rest, tau)
    across = dyn.constrained.closure.rows.stacked(q, rest, ("point_0",)).jacobian[2]
    whole = np.block([[dyn.mass_matrix(q), across[:, None]], [across, np.zeros(1)]])
    wanted = np.linalg.solve(whole, np.append(tau - dyn.gravity(q), 0.0))
    assert_close(a, wanted[:3], 1e-9)
    assert_close(lam, [0.0, 0.0, wanted[3]], 1e-9)


def test_what_is_open_at_the_start_holds_where_it_is_closed() -> None:
    """Bricard's linkage, switched off at a start from which it cannot be closed."""
    closed = Dynamics(scene("bricard"))
    q, v = closed.constrained.closure.closed(closed.model.q0 + 0.1, np.ones(closed.n))
    rows = [
        {**row.model_dump(exclude_unset=True), "switchable": True, "active": False}
        for row in closed.model.scene.constraints
    ]
    apart = dict.fromkeys(closed.joint_names, 2.0)
    free = Dynamics(scene("bricard", constraints=rows, initial={"position": apart}))
    with pytest.raises(ConstraintError):
        free.constrained.closure.closed(free.model.q0, v, ("hinge", "axis"))
    tau = np.linspace(-1.0, 1.0, closed.n)
    found = free.constrained_forward(q, v, tau, ("hinge", "axis"))
    for ours, wanted in zip(found, closed.constrained_forward(q, v, tau), strict=True):
        assert_close(ours, wanted, ALGEBRA)


def test_pushing_takes_the_transposed_jacobian(rng: np.random.Generator) -> None:
    """A pen that rests on its sheet and pushes with f bears λ = f, and does not move."""
    dyn = Dynamics(models.SCENES / "panda_pen.yaml")
    q, rest = dyn.model.q0, np.zeros(dyn.n)
    push = dyn.contact_torque(q, [0.0, 0.0, -7.0])
    a, lam = dyn.constrained_forward(q, rest, dyn.gravity(q) + push)
    assert_close(lam, [-7.0], ALGEBRA)
    assert_close(a, rest, ALGEBRA)
    wrenches = rng.normal(size=(3, 6))
    many = dyn.contact_torque(np.tile(q, (3, 1)), wrenches, frame="panda_hand")
    jacobian = TaskSpace(dyn, "panda_hand", "local_world_aligned").jacobian(q)
    assert_close(many, wrenches @ jacobian, ALGEBRA)


def test_multipliers_belong_to_one_state_or_to_each_of_a_batch(rng: np.random.Generator) -> None:
    dyn = models.dynamics("four_bar")
    q, v, a = (np.tile(x, (4, 1)) for x in (dyn.model.q0, dyn.model.v0, rng.normal(size=dyn.n)))
    one = [1, -2, 3]  # whole numbers too
    single = dyn.constrained_inverse(q[0], v[0], a[0], one)
    assert_close(dyn.constrained_inverse(q, v, a, one), np.tile(single, (4, 1)), ALGEBRA)
    for lam in ([1.0, 2.0], np.ones((3, 3)), [1.0, np.nan, 3.0]):
        with pytest.raises(InvalidInput, match="^lam "):
            dyn.constrained_inverse(q, v, a, lam)
    with pytest.raises(InvalidInput, match="^lam "):
        dyn.constrained_inverse(q[0], v[0], a[0], np.ones((4, 3)))


def test_what_pushes_and_what_holds_must_be_said() -> None:
    """Fingertips touch a box that is a link of the same scene: no frame touches the world."""
    gripper, bar, pen = (models.dynamics(x) for x in ("lifting_gripper", "four_bar", "panda_pen"))
    for dyn in (gripper, bar):
        with pytest.raises(InvalidInput, match="frame is expected"):
            dyn.contact_torque(dyn.model.q0, [0, 0, 1])
    with pytest.raises(InvalidInput, match="no constraint 'lop'; allowed: loop"):
        bar.constrained_forward(bar.model.q0, bar.model.v0, bar.model.v0, active=["lop"])
    with pytest.raises(InvalidInput, match=r"shape \(2, 3\); a row for each of 3 pos"):
        pen.contact_torque([pen.model.q0] * 3, np.ones((2, 3)))
