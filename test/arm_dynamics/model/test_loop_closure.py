# SPDX-License-Identifier: Apache-2.0
"""States that satisfy the constraints, and clear errors if there are none."""

import logging
import re
from typing import Any

import numpy as np
import pytest
import yaml

import models
from arm_dynamics import ArmModel, ConstraintError, Dynamics, SceneError, load_scene
from arm_dynamics.model.loops.loop_closure import Closure
from models import loops
from models.linkages import scene
from tolerances import CLOSURE, assert_close

TWO_LINK = str(models.SCENES / "two_link.urdf")
TIP = {"frames": ["tip", "world"]}


def robot(*constraints: dict[str, Any], **more: Any) -> dict[str, Any]:
    urdf = {"urdf": TWO_LINK, "lock": more.pop("lock", [])}
    return {"robot": urdf, "constraints": list(constraints), **more}


@pytest.mark.parametrize("elbow", [0.7, -0.7])
def test_the_branch_of_the_guess_is_kept(elbow: float) -> None:
    """The tip can reach a point with the elbow up or down."""
    held = {"type": "point", "points": [[0, 0, 0], [0.7, 0, 0.1]], **TIP}
    dyn = Dynamics(robot(held, initial={"position": {"shoulder": -elbow / 2, "elbow": elbow}}))
    assert np.sign(dyn.model.q0[1]) == np.sign(elbow)


def test_the_nearest_state_in_the_metric_of_mass() -> None:
    """The way to it is M-orthogonal to every motion that the constraints leave."""
    dyn = Dynamics(models.SCENES / "five_bar.yaml")
    closure, q0 = dyn.constrained.closure, dyn.model.q0
    off = q0 + 1e-5 * np.array([1.0, -2.0, 0.5, 1.5])
    q, v = closure.closed(off, np.array([1.0, 2.0, 3.0, 4.0]))
    A = closure.rows.stacked(q, v, ("tool",)).jacobian
    free = np.eye(4) - np.linalg.pinv(A) @ A
    M = dyn.mass_matrix(q)
    np.testing.assert_allclose(free @ M @ (q - off), 0.0, atol=1e-11)
    np.testing.assert_allclose(free @ M @ (v - [1.0, 2.0, 3.0, 4.0]), 0.0, atol=1e-12)
    np.testing.assert_allclose(A @ v, 0.0, atol=1e-14)


def test_out_of_reach_says_by_how_much() -> None:
    """0.5 m and 0.4 m do not reach 1.2 m: 0.3 m are missing."""
    held = {"type": "point", "name": "nail", "points": [[0, 0, 0], [1.2, 0, 0]], **TIP}
    with pytest.raises(ConstraintError, match="'nail' by 0.3") as error:
        Dynamics(robot(held, initial={"position": {"elbow": 0.5, "shoulder": -0.2}}))
    assert_close(error.value.residuals["nail"], 0.3, 1e-3)
    assert isinstance(error.value, SceneError)


def test_no_joint_leaps_on_the_way_to_a_closed_position() -> None:
    """By steps of any length, Newton's method would take two of them round once more."""
    closure, far = models.dynamics("four_bar").constrained.closure, np.array([1.8, -0.5, 0.2])
    q, _ = closure.closed(far, np.zeros(3))
    assert abs(q - far).max() < 2.0


def test_constraints_that_contradict_each_other() -> None:
    heights = [{"type": "plane", "height": h, **TIP} for h in (0.1, 0.2)]
    with pytest.raises(ConstraintError, match=r"'plane_0' by 0\.05, 'plane_1' by 0\.05"):
        Dynamics(robot(*heights))


def test_the_first_link_moves_against_the_world() -> None:
    for frames in (["upper_arm", "world"], ["world", "upper_arm"]):
        held = {"type": "plane", "frames": frames, "normal": [1, 0, 0]}
        assert list(ArmModel(load_scene(robot(held))).constraint_rows) == [0]


OVERCONSTRAINED = {"bricard": 4, "slider_crank": 2, "parallel_gripper": 5, "panda_pen": 1}


@pytest.mark.parametrize(("name", "rank"), OVERCONSTRAINED.items())
def test_rows_that_depend_on_others_are_left_out(name: str, rank: int) -> None:
    """Of equal ones the first is kept: rounding, which machines differ in, must not choose."""
    rows = models.dynamics(name).model.constraint_rows
    assert sum(len(kept) for kept in rows.values()) == rank
    assert name != "bricard" or rows == {0: (0, 1, 2), 1: (2,)}


def test_a_doubled_constraint_is_left_out_unless_the_other_can_go() -> None:
    both = [{"type": "plane", "name": name, **TIP} for name in ("a", "b")]
    assert ArmModel(load_scene(robot(*both))).constraint_rows == {0: (0,), 1: ()}
    both[0]["switchable"] = True
    assert ArmModel(load_scene(robot(*both))).constraint_rows == {0: (), 1: (0,)}
    both[1]["switchable"] = True
    assert ArmModel(load_scene(robot(*both))).constraint_rows == {0: (0,), 1: (0,)}


def slider_crank(crank: float, speed: float, **initial: Any) -> ArmModel:
    given = {"position": {"pivot": crank, "knuckle": -crank, "rail": 0.4},
             "velocity": {"pivot": speed}}  # fmt: skip
    return ArmModel(scene("slider_crank", initial=given | initial))


@pytest.mark.parametrize("crank", [0.3, -0.8])
def test_a_joint_that_is_held_keeps_its_position_and_speed(crank: float) -> None:
    """Knuckle and rail follow from the triangle of 0.15 and 0.4 m, and its derivative."""
    model = slider_crank(crank, 2.0, hold=["pivot"])
    lean = -np.arcsin(0.15 * np.sin(crank) / 0.4)
    turn = -2.0 * 0.15 * np.cos(crank) / (0.4 * np.cos(lean))
    rail = 0.15 * np.cos(crank) + 0.4 * np.cos(lean)
    pace = -0.15 * 2.0 * np.sin(crank) - 0.4 * turn * np.sin(lean)
    assert (model.q0[0], model.v0[0]) == (crank, 2.0)
    assert_close(model.q0, [crank, lean - crank, rail], CLOSURE)
    assert_close(model.v0, [2.0, turn - 2.0, pace], CLOSURE)
    assert slider_crank(crank, 2.0).q0[0] != crank


def test_where_a_held_joint_leaves_no_closed_position_it_is_named() -> None:
    """0.5 and 0.4 m: with the shoulder level, 0.7 m straight up are out of reach."""
    held = {"type": "point", "points": [[0, 0, 0], [0, 0, 0.7]], "name": "nail", **TIP}
    start = {"position": {"shoulder": 0.1, "elbow": 0.9}}
    assert Dynamics(robot(held, initial=start)).constrained.closure
    with pytest.raises(
        ConstraintError, match=r"while 'shoulder' at 0\.1 is held; left open.*nail"
    ):
        Dynamics(robot(held, initial={**start, "hold": ["shoulder"]}))


PLANE = {"type": "plane", **TIP}
GRIPPER = {
    "robot": {"urdf": str(models.FOLDER / "gripper.urdf")},
    "constraints": [{"type": "plane", "frames": ["left_jaw", "world"]}],
    "initial": {"hold": ["right_slide"]},
}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (robot({"type": "point", "frames": ["tip", "tip"]}), "two different names"),
        (robot({"type": "point", "active": False, **TIP}), "switchable: true"),
        (robot({"type": "point", "frames": ["forearm", "tip"]}), "cannot move relative to each"),
        (robot({"type": "plane", "frames": ["upper_arm", "world"]}, lock=["shoulder"]), "locked"),
        (robot(initial={"hold": ["elbow"]}), "'initial.hold' = .'elbow'.*no constraint"),
        (robot(PLANE, initial={"hold": ["wrist"]}), "'wrist', which does not"),
        (robot(PLANE, initial={"hold": ["elbow"]}, lock=["elbow"]), "'elbow', which is locked"),
        (GRIPPER, "'right_slide', which follows 'left_slide'"),
    ],
)
def test_what_cannot_be_held_is_refused(given: dict[str, Any], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        ArmModel(load_scene(given))


def offered(words: str) -> dict[str, float]:
    """The positions that a message offers."""
    written = re.search(r"initial: (\{position: \{.*?\}\})", words)
    assert written is not None
    found: dict[str, float] = yaml.safe_load(written[1])["position"]
    return found


@pytest.mark.parametrize("hold", [[], ["shoulder"]])
def test_a_default_start_that_is_singular_says_so_and_offers_another(hold: list[str]) -> None:
    """Stretched, no motion of the two joints brings the tip nearer to a nail on their line."""
    held = {"type": "distance", "name": "nail", "distance": 0.5, **TIP}
    with pytest.raises(
        ConstraintError,
        match="'nail' by 0.56.* the start is singular; from initial: .* they can be",
    ) as e:
        Dynamics(robot(held, initial={"hold": hold}))
    start = offered(str(e.value))
    assert [start[name] for name in hold] == [0.0] * len(hold)
    model = Dynamics(robot(held, initial={"position": start, "hold": hold})).model
    np.testing.assert_allclose(model.q0, list(start.values()), atol=1e-5)


def test_a_linkage_that_starts_flat_is_told_and_offered_a_start_that_is_not(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """A flat parallelogram may go on as one, or as a crossed linkage."""
    linkage, turns = loops.chain(1), {"crank0": 1.0, "coupler0": -1.0, "rocker0": 1.0}
    flat = {f"{name}_joint": turn * np.pi / 2 for name, turn in turns.items()}
    with caplog.at_level(logging.WARNING):
        Dynamics({**linkage, "initial": {"position": flat}})
    assert "the start is singular: the joints can move in more ways there" in caplog.text
    start = offered(caplog.text)
    caplog.clear()
    model = Dynamics({**linkage, "initial": {"position": start}}).model
    assert not caplog.records
    assert not Closure(model, model.stops).is_singular(model.q0)


@pytest.mark.parametrize("name", models.HELD)
def test_ready_linkages_start_where_they_are_not_singular(
    name: str, caplog: pytest.LogCaptureFixture
) -> None:
    ArmModel(models.scene(name))
    assert "singular" not in caplog.text
