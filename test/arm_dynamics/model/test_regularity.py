# SPDX-License-Identifier: Apache-2.0
"""Singular mass matrices are refused, naming the joints that move no mass."""

import logging
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import models
from arm_dynamics import Dynamics, ModelError
from arm_dynamics.model.regularity import check_regular, largest_condition
from arm_sim import Simulator
from tolerances import INVERSE_PAIR, assert_close

ARM = (models.FOLDER / "planar_3r.urdf").read_text()
NAMES = ("a", "b", "c")


def arm(*inertias: tuple[float, float]) -> str:
    """The arm with other masses and moments of its three links, their centres half way out."""
    robot = ElementTree.fromstring(ARM)
    for number, (mass, moment) in enumerate(inertias, 1):
        own = robot.find(f"link[@name='link{number}']/inertial")
        own.find("mass").set("value", str(mass))
        own.find("inertia").attrib.update(ixx="0", iyy=str(moment), izz=str(moment))
    return ElementTree.tostring(robot, encoding="unicode")


NONE, POINT, BODY = (0.0, 0.0), (1.0, 0.0), (1.0, 0.1)
SINGULAR: dict[str, tuple[str, str]] = {
    "nothing at the end": (arm(BODY, BODY, NONE), "joint 'joint3' moves no mass"),
    "a point on two massless links, for three joints": (
        arm(NONE, NONE, POINT),
        "'joint2', 'joint3' can move together so that they move no mass",
    ),
}


@pytest.mark.parametrize(("text", "said"), SINGULAR.values(), ids=SINGULAR)
def test_joints_that_move_nothing_are_named(text: str, said: str) -> None:
    dyn = Dynamics(text)
    assert np.isfinite(dyn.inverse(*np.ones((3, 3)))).all()  # which needs no M⁻¹
    for build in (lambda: dyn.forward(*np.zeros((3, 3))), lambda: Simulator(text)):
        with pytest.raises(ModelError, match=f"{said}.* condition number .* up to 1.5e\\+15"):
            build()

    held = [{"type": "plane", "frames": ["link3", "world"], "normal": [1, 0, 0], "height": 0.5}]
    start = {"position": {"joint1": 0.3, "joint2": 0.4, "joint3": 0.5}}
    with pytest.raises(ModelError, match="no mass.* condition number"):
        Simulator({"robot": {"urdf": text}, "constraints": held, "initial": start})


@pytest.mark.parametrize("drive", [
    {"armature": 0.01}, {"actuator": {"rotor_inertia": 1e-5, "gear_ratio": 30}},
])  # fmt: skip
def test_an_armature_or_a_rotor_is_mass_enough(drive: dict[str, Any]) -> None:
    dyn = Dynamics({"robot": {"urdf": arm(BODY, BODY, NONE)}, "joints": {"joint3": drive}})
    q, v, a = np.random.default_rng(1).normal(size=(3, 3))
    assert_close(dyn.forward(q, v, dyn.inverse(q, v, a)), a, INVERSE_PAIR)


def test_an_arm_that_is_singular_only_where_it_starts_cannot_start() -> None:
    """A point mass on one massless link: stretched, both joints move it alike."""
    text = arm(NONE, POINT, NONE).replace('name="joint3" type="revolute"',
                                          'name="joint3" type="fixed"')  # fmt: skip
    with pytest.raises(ModelError, match="'joint1', 'joint2'"):
        Simulator(text)
    bent = Simulator({"robot": {"urdf": text}, "initial": {"position": {"joint2": 1.0}}})
    assert np.isfinite(bent.step(np.zeros(2)).v).all()


def spread(condition: float) -> np.ndarray:
    """A matrix with a diagonal of ones and a condition number."""
    c = (condition - 1.0) / (condition + 1.0)
    return np.array([[1.0, c, 0.0], [c, 1.0, 0.0], [0.0, 0.0, 1.0]])


def test_the_condition_number_decides_in_whatever_units() -> None:
    units, most = np.diag([1e-3, 1e3, 1.0]), largest_condition(3)
    assert most == pytest.approx(1.0 / (3 * 2.0**-52))
    for M in (spread(1e-3 * most), units @ spread(1e-3 * most) @ units):
        check_regular(M[None], NAMES)
    for M in (spread(30.0 * most), units @ spread(30.0 * most) @ units):
        with pytest.raises(
            ModelError, match=r"^joints 'a', 'b' can .* is (inf|\d.*e\+1\d), allowed: up to"
        ):
            check_regular(np.array([np.eye(3), M]), NAMES)
    with pytest.raises(ModelError, match="'b', 'c'.* is inf"):  # of negative kinetic energy
        check_regular(np.array([[[1, 0, 0], [0, 1, 2], [0, 2, 1.0]]]), NAMES)


def test_an_arm_without_any_mass_says_once_that_its_torques_are_zero(
    caplog: pytest.LogCaptureFixture,
) -> None:
    text = arm(NONE, NONE, NONE)
    dyn = Dynamics(text)
    with caplog.at_level(logging.WARNING):
        for _ in range(2):
            assert not dyn.gravity(np.ones(3)).any()
            assert not dyn.inverse(np.ones(3), np.zeros(3), np.ones(3)).any()
    assert len(caplog.records) == 1
    assert "no link has mass or inertia" in caplog.text
    caplog.clear()
    Dynamics({"robot": {"urdf": text}, "payloads": [{"frame": "link1", "mass": 1.0}]}).gravity(
        np.ones(3)
    )
    assert not caplog.records
