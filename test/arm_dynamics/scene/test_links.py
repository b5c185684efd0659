# SPDX-License-Identifier: Apache-2.0
"""Inertias of links in a scene, as if they were written in the URDF; those of rigid bodies."""

import json
import logging
import re
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from click.testing import CliRunner

import models
from arm_dynamics import Dynamics, SceneError, load_scene
from arm_dynamics.scene.inertia import fault, possible, six_of
from arm_dynamics.scene.text import scene_of, scene_text
from arm_sim.cli.main import main
from tolerances import PINOCCHIO, assert_close

URDF = (models.FOLDER / "skew_axes.urdf").read_text()
BODY = {
    "mass": 1.7,
    "com": [0.03, -0.02, 0.05],
    "inertia": [0.02, 0.001, -0.002, 0.03, 0.0005, 0.025],
}
WRITTEN = """<inertial><origin xyz="0.03 -0.02 0.05"/><mass value="1.7"/>
<inertia ixx="0.02" ixy="0.001" ixz="-0.002" iyy="0.03" iyz="0.0005" izz="0.025"/></inertial>"""
POINT = """<inertial><mass value="0.4"/>
<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>"""


def edited(link: str, inertial: str = WRITTEN, urdf: str = URDF) -> str:
    """The URDF with the inertia of a link written by hand."""
    element = re.search(rf'<link name="{link}"(/>|>.*?</link>)', urdf, re.DOTALL)
    assert element is not None
    return urdf.replace(element[0], f'<link name="{link}">{inertial}</link>')


def assert_same(own: Dynamics, expected: Dynamics, rng: np.random.Generator) -> None:
    for _ in range(3):
        q, v, a = models.random_state(rng, own.n)
        assert_close(own.inverse(q, v, a), expected.inverse(q, v, a), PINOCCHIO)
        assert_close(own.mass_matrix(q), expected.mass_matrix(q), PINOCCHIO)
        for x, y in zip(own.energy(q, v), expected.energy(q, v), strict=True):
            assert_close(x, y, PINOCCHIO)


@pytest.mark.parametrize("link", ["a", "adapter", "d"])
@pytest.mark.parametrize("lock", [(), ("fourth",)])
def test_equal_an_edited_urdf(link: str, lock: tuple[str, ...], rng: np.random.Generator) -> None:
    """Also of links that fixed or locked joints merge with others."""
    start = {"initial": {"position": dict.fromkeys(lock, 0.2)}}
    robot = {"lock": list(lock)}
    own = Dynamics({"robot": {"urdf": URDF, **robot}, "links": {link: BODY}, **start})
    expected = Dynamics({"robot": {"urdf": edited(link), **robot}, **start})
    assert_same(own, expected, rng)
    assert abs(own.model.total_mass - Dynamics(URDF).model.total_mass) > 0.1


def test_an_unusable_inertia_can_be_replaced(rng: np.random.Generator) -> None:
    broken = URDF.replace('<mass value="0.9"/>', '<mass value="none"/>')
    own = Dynamics({"robot": {"urdf": broken}, "links": {"c": BODY}})
    assert_same(own, Dynamics(edited("c")), rng)
    assert not own.model.doubtful


REFUSED: list[tuple[Any, str]] = [
    ({"cc": BODY}, "'links' names 'cc', which does not exist"),
    ({"base": BODY}, "'links.base': no joint moves that link"),
    ({"a": BODY}, "'links.a': no joint moves that link"),  # its joint is locked
    ({"c": {"mass": 1, "inertia": [1, 0, 0, 1, 0, 3]}}, "'links.c.inertia' = .*: no body has"),
]


@pytest.mark.parametrize(("links", "words"), REFUSED)
def test_mistakes_are_named(links: Any, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        Dynamics({"robot": {"urdf": URDF, "lock": ["first"]}, "links": links})


def test_a_saved_scene_has_them() -> None:
    scene = load_scene({"robot": {"urdf": URDF}, "links": {"c": BODY}})
    assert scene_of(scene_text(scene, "robot.urdf"), scene.robot.urdf).links == scene.links


def test_commands_tell_and_write_them(tmp_path: Path, rng: np.random.Generator) -> None:
    (tmp_path / "arm.urdf").write_text(URDF)
    (tmp_path / "arm.yaml").write_text(
        f"robot: {{urdf: arm.urdf}}\nlinks: {json.dumps({'c': BODY, 'd': {'mass': 0.4}})}"
    )
    scene = str(tmp_path / "arm.yaml")

    def run(*words: str) -> str:
        result = CliRunner().invoke(main, words, catch_exceptions=False)
        assert result.exit_code == 0, result.output
        return result.stdout

    assert "inertias from the scene: c 1.7 kg, d 0.4 kg" in run("describe", scene)
    assert json.loads(run("describe", scene, "--json"))["links"] == {"c": 1.7, "d": 0.4}
    expected = Dynamics(edited("d", POINT, edited("c")))
    assert_same(Dynamics(run("urdf", scene)), expected, rng)
    hardware = run("urdf", scene, "--ros2-control", "effort")
    assert_same(Dynamics(hardware), expected, rng)


def test_bodies_of_point_masses_are_possible(rng: np.random.Generator) -> None:
    """Any points with any masses: in a line, in a plane, in space."""
    for points in rng.normal(size=(50, 4, 3)) * [[1.0], [0.0], [1.0], [0.0]]:
        weights = rng.uniform(0.1, 1.0, 4)
        arms = points - weights @ points / weights.sum()
        tensor = sum(
            m * ((r @ r) * np.eye(3) - np.outer(r, r)) for m, r in zip(weights, arms, strict=True)
        )
        assert fault(weights.sum(), six_of(np.array(tensor))) is None


def test_a_moment_beyond_the_sum_of_the_others_is_not(rng: np.random.Generator) -> None:
    for excess, fine in ((0.0, True), (0.009, True), (0.011, False), (1.0, False)):
        R = pin.Quaternion(rng.normal(size=4)).normalized().matrix()
        tensor = R @ np.diag([0.3, 0.7, 1.0 / (1.0 - excess)]) @ R.T if excess < 1 else np.eye(3)
        if excess == 1.0:
            tensor = R @ np.diag([0.0, 0.0, 1.0]) @ R.T
        assert bool(possible(1.0, six_of(tensor))) is fine
        assert (fault(1.0, six_of(tensor)) is None) is fine


def test_no_mass_is_negative_or_not_a_number() -> None:
    for mass in (-1.0, np.nan):
        assert f"mass = {mass:g} kg" in str(fault(mass, [0.0] * 6))


def test_a_link_with_an_impossible_inertia_is_reported_and_used(
    caplog: pytest.LogCaptureFixture,
) -> None:
    text = (models.FOLDER / "planar_3r.urdf").read_text()
    old = '<inertia ixx="0" ixy="0" ixz="0" iyy="0.015" iyz="0" izz="0.015"/>'
    assert old in text
    text = text.replace(old, old.replace('izz="0.015"', 'izz="0.1"'))
    with caplog.at_level(logging.WARNING):
        dyn = Dynamics(load_scene(text))
    assert "link 'link2': no body has principal moments 0, 0.015, 0.1 kg m²" in caplog.text
    assert list(dyn.model.doubtful) == ["link2"]
    assert np.isfinite(dyn.forward(*np.zeros((3, 3)))).all()
