# SPDX-License-Identifier: Apache-2.0
"""The keys ``sensors`` and ``commands``: what they take, and what they refuse by name."""

from __future__ import annotations

from typing import Any

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


REFUSED = {
    "noise below zero": ({"position": {"noise": -1}}, r"'sensors.position.noise' = -1"),
    "unknown key": (
        {"velocity": {"source": "position"}},
        "unknown key 'sensors.velocity.source'.* allowed here: from, cutoff, order, noise, offset",
    ),
    "unknown sensor": ({"torque": {}}, "allowed here: delay, jitter, loss, seed, position,"),
    "unknown joint": (
        {"effort": {"noise": {"wrist": 1}}},
        "'sensors.effort.noise' names joint 'wrist', which does not exist; allowed: shoulder",
    ),
    "no number": ({"position": {"noise": [1, 2]}}, "a number, or numbers by joint name"),
    "true": ({"position": {"noise": True}}, "a number is expected, not true or false"),
    "nan": ({"effort": {"offset": float("nan")}}, "allowed: finite numbers"),
    "both steps": (
        {"position": {"resolution": 1e-3, "counts": 10}},
        r"'\*' has resolution and counts; one of them is expected",
    ),
    "no counts": ({"position": {"counts": 0}}, "more than 0 is expected"),
    "order": ({"velocity": {"order": 3}}, "allowed: 1, 2"),
    "lost": ({"loss": 1.5}, "'sensors.loss' = 1.5: at most 1 is expected"),
    "late": ({"delay": 100}, "'sensors.delay' = 100: at most 10 is expected"),
    "early": ({"jitter": -1e-3}, "'sensors.jitter' = -0.001"),
    "seed": ({"seed": -1}, "'sensors.seed' = -1"),
    "seed that is true": ({"seed": True}, "'sensors.seed' = True"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refusals(case: str) -> None:
    sensors, said = REFUSED[case]
    with pytest.raises(SceneError, match=said):
        load_scene({**PLAIN, "sensors": sensors})


def test_a_sliding_joint_has_no_counts_in_a_turn() -> None:
    with pytest.raises(SceneError, match="is prismatic, so it has no counts per revolution"):
        load_scene({**SLIDING, "sensors": {"position": {"counts": 4096}}})


@pytest.mark.parametrize("commands", [{"noise": 1}, {"loss": -0.1}, {"delay": "soon"}, 3])
def test_commands_are_checked_too(commands: Any) -> None:
    with pytest.raises(SceneError, match="'commands"):
        load_scene({**PLAIN, "commands": commands})
