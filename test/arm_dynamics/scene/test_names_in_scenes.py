# SPDX-License-Identifier: Apache-2.0
"""Joints and frames that a scene names must exist, and be free to move as it requires."""

from typing import Any

import pytest

from arm_dynamics import SceneError, load_scene

# joint1 leads, joint2 follows it, joint3 is fixed, joint4 is on its own.
URDF = """<robot name="r"><link name="base"/>
  <link name="a"/><link name="b"/><link name="c"/><link name="d"/>
  <joint name="joint1" type="continuous"><parent link="base"/><child link="a"/></joint>
  <joint name="joint2" type="continuous"><parent link="a"/><child link="b"/>
    <mimic joint="joint1" multiplier="2"/></joint>
  <joint name="joint3" type="fixed"><parent link="b"/><child link="c"/></joint>
  <joint name="joint4" type="continuous"><parent link="c"/><child link="d"/></joint>
</robot>"""
FRAMES = "base, a, b, c, d, joint1, joint2, joint3, joint4"


def scene(*constraints: dict[str, Any], lock: tuple[str, ...] = (), **more: Any) -> dict[str, Any]:
    robot = {"urdf": URDF, "lock": list(lock)}
    return {"robot": robot, "constraints": list(constraints), **more}


def refusal(source: dict[str, Any]) -> str:
    with pytest.raises(SceneError) as caught:
        load_scene(source)
    return str(caught.value)


@pytest.mark.parametrize(
    ("name", "trouble"), [("joint3", "is fixed"), ("joint9", "does not exist")]
)
def test_joints_that_a_scene_names_exist_and_move(name: str, trouble: str) -> None:
    for key, given in {
        "joints": scene(joints={"*": {}, name: {}}),
        "initial.position": scene(initial={"position": {"joint1": 1, name: 0}}),
        "initial.velocity": scene(initial={"velocity": {"joint1": 1, name: 0}}),
        "robot.lock": scene(lock=(name,)),
    }.items():
        said = f"'{key}' names joint '{name}', which {trouble}; allowed: joint1, joint2, joint4"
        assert refusal(given) == f"scene: {said}"


def test_a_list_of_joints_names_each_once() -> None:
    for twice in (
        scene(lock=("joint1", "joint4", "joint1")),
        scene(initial={"hold": ["joint1", "joint4", "joint1"]}),
    ):
        assert "names joint 'joint1' twice" in refusal(twice)


def test_a_frame_that_does_not_exist_is_named_with_its_place() -> None:
    on, off = {"frame": "joint4", "mass": 1}, {"frame": "world", "mass": 1}
    touching = {"type": "contact", "frame": "base"}
    assert load_scene(scene(touching, payloads=[on]))
    said = f"frame' = 'world' does not exist; allowed: {FRAMES}"
    assert f"'payloads.1.{said}" in refusal(scene(payloads=[on, off]))
    assert f"'constraints.1.{said}" in refusal(scene(touching, {**touching, "frame": "world"}))


def test_either_frame_of_a_constraint_must_exist() -> None:
    for frames in (["x", "world"], ["a", "x"]):
        said = refusal(scene({"type": "frame", "frames": frames}))
        assert f"'constraints.0.frames.{frames.index('x')}' = 'x' does not exist" in said


@pytest.mark.parametrize(
    ("name", "lock", "trouble", "allowed"),
    [
        ("joint3", (), "is fixed", "joint1, joint4"),
        ("joint2", (), "follows 'joint1'", "joint1, joint4"),
        ("joint2", ("joint1", "joint2"), "is locked", "joint4"),
    ],
)
def test_a_coupling_is_of_two_free_joints(
    name: str, lock: tuple[str, ...], trouble: str, allowed: str
) -> None:
    free = allowed.split(", ")[0]
    for joints in ([name, free], [free, name]):
        tie = {"type": "coupling", "joints": joints, "ratio": 1.0}
        said = refusal(scene(tie, lock=lock))
        assert said.endswith(f"names joint '{name}', which {trouble}; allowed: {allowed}")


def test_constraints_have_different_names_also_those_that_they_get_by_their_place() -> None:
    ties = [{"type": "point", "frames": ["d", "world"], "name": name} for name in "aba"]
    assert "two constraints are called 'a'" in refusal(scene(*ties))
    named = {"type": "plane", "frames": ["d", "world"], "name": "point_1"}
    plain = {"type": "point", "frames": ["d", "world"]}
    assert "two constraints are called 'point_1'" in refusal(scene(named, plain))
    assert load_scene(scene(plain, named)).constraints[1].name == "point_1"


def test_a_follower_is_locked_only_with_its_leader() -> None:
    assert "locks 'joint2', which follows 'joint1'" in refusal(scene(lock=("joint2",)))
    for lock in (("joint1",), ("joint1", "joint2"), ("joint4",)):
        assert load_scene(scene(lock=lock)).robot.lock == lock


def test_a_follower_starts_where_its_leader_takes_it() -> None:
    for key in ("position", "velocity"):
        said = refusal(scene(initial={key: {"joint2": 0.5}}))
        assert f"'initial.{key}' names 'joint2', which follows 'joint1'" in said


def test_a_follower_has_no_limits_of_its_own() -> None:
    for key in ("effort", "velocity"):
        said = refusal(scene(joints={"joint2": {"limits": {key: 5.0}}}))
        assert f"'joints.joint2.limits.{key}': 'joint2' follows 'joint1'" in said
        assert load_scene(scene(joints={"*": {"limits": {key: 5.0}}}))


def test_what_is_said_of_a_locked_joint_would_be_without_effect() -> None:
    moving = scene(lock=("joint1",), initial={"velocity": {"joint1": 0.5}})
    assert "'initial.velocity.joint1' = 0.5, but 'robot.lock' holds it fast" in refusal(moving)
    for name in ("joint1", "joint2"):  # the second follows the first
        joints = {name: {"friction": {"viscous": 1.0}}}
        said = refusal(scene(lock=("joint1",), joints=joints))
        assert said.startswith(f"scene: 'joints.{name}' sets ")
        assert load_scene(scene(lock=("joint1",), joints={name: {}, "*": joints[name]}))
    still = {"position": {"joint1": 0.3}, "velocity": {"joint1": 0.0}}
    assert load_scene(scene(lock=("joint1",), initial=still))
