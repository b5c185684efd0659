# SPDX-License-Identifier: Apache-2.0
"""The keys ``sensors`` and ``commands``: what they take, and what they refuse by name."""

import pytest

import models
from arm_dynamics import SceneError, load_scene
from arm_dynamics.scene.imperfections import values
from arm_dynamics.scene.schema import validated

PLAIN = models.scene("two_link").model_dump(exclude_unset=True)
JOINTS = ("shoulder", "elbow")
SLIDING = models.scene("slider_crank").model_dump(exclude_unset=True)


def test_absent_they_are_absent() -> None:
    scene = load_scene(PLAIN)
    assert scene.sensors is None
    assert scene.commands is None


def test_one_number_is_for_all_joints_and_names_go_before() -> None:
    given = {"noise": 1e-3, "offset": {"*": 1, "elbow": -2}, "resolution": {"shoulder": "1e-4"}}
    position = load_scene({**PLAIN, "sensors": {"position": given}}).sensors.position
    assert values(position.noise, JOINTS) == [1e-3, 1e-3]
    assert values(position.offset, JOINTS) == [1.0, -2.0]
    assert values(position.resolution, JOINTS) == [1e-4, 0.0]


def test_a_scene_that_is_written_down_reads_the_same() -> None:
    scene = load_scene({**PLAIN, "sensors": {"velocity": {"from": "position", "cutoff": 9}}})
    assert validated(scene.model_dump(exclude_unset=True)) == scene


def test_an_encoder_has_one_kind_of_step() -> None:
    position = {"position": {"resolution": 1e-3, "counts": 10}}
    with pytest.raises(SceneError, match=r"'\*' has resolution and counts; one of them is exp"):
        load_scene({**PLAIN, "sensors": position})


def test_a_sliding_joint_has_no_counts_in_a_turn() -> None:
    with pytest.raises(SceneError, match="is prismatic, so it has no counts per revolution"):
        load_scene({**SLIDING, "sensors": {"position": {"counts": 4096}}})
