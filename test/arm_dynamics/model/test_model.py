# SPDX-License-Identifier: Apache-2.0
"""The robot as numbers: names, types, limits and masses."""

import re

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, Dynamics, SceneError, load_scene
from models.touching import rails

SCARA = str(models.FOLDER / "scara.urdf")


def test_scara_by_hand() -> None:
    model = ArmModel(load_scene(SCARA))
    assert model.n == 4
    assert model.joint_names == ("inner", "outer", "slide", "spin")
    assert model.joint_types == ("revolute", "revolute", "prismatic", "continuous")
    np.testing.assert_array_equal(model.position_lower, [-2.6, -2.6, 0.0, -np.inf])
    np.testing.assert_array_equal(model.position_upper, [2.6, 2.6, 0.2, np.inf])
    np.testing.assert_array_equal(model.velocity_limit, [6.0, 8.0, 1.0, np.inf])
    np.testing.assert_array_equal(model.effort_limit, [60.0, 30.0, 100.0, np.inf])
    assert model.command_unit == ("N m", "N m", "N", "N m")
    np.testing.assert_array_equal(model.command_limit, model.effort_limit)
    np.testing.assert_allclose(model.total_mass, 4 + 2.5 + 0.8 + 0.3, rtol=1e-15)


def test_selected_joints_keep_the_scale_of_their_friction() -> None:
    joints = {"inner": {"friction": {"coulomb": 2.0}}}
    friction = ArmModel(load_scene({"robot": {"urdf": SCARA}, "joints": joints})).friction
    doubled = friction.scaled(np.where(friction.coulomb.mean > 0.0, 4.0, 0.0)).of([0])
    assert doubled.level_at(np.ones(4), np.zeros(4), np.zeros(4))[0] == 4.0


def test_scene_replaces_limits() -> None:
    slide = {"limits": {"effort": 5.0, "velocity": 0.5, "lower": -0.1, "upper": 0.1}}
    model = ArmModel(load_scene({"robot": {"urdf": SCARA}, "joints": {"slide": slide}}))
    found = (model.effort_limit, model.velocity_limit, model.position_lower, model.position_upper)
    assert [float(x[2]) for x in found] == [5.0, 0.5, -0.1, 0.1]
    np.testing.assert_array_equal(model.effort_limit[[0, 1, 3]], [60.0, 30.0, np.inf])


def test_a_limit_beyond_the_other_one_of_the_description() -> None:
    """The description limits this joint to ±2.6 rad, so that no position would be left."""
    for limits in ({"upper": -3.0}, {"lower": 2.6}):
        scene = load_scene({"robot": {"urdf": SCARA}, "joints": {"inner": {"limits": limits}}})
        with pytest.raises(SceneError, match="'joints.inner.limits'.*lower = .* upper = "):
            ArmModel(scene)


@pytest.mark.parametrize(("said", "kept"), [("0", np.inf), ("1e-9", 1e-9), ("1e300", np.inf)])
def test_a_limit_of_zero_or_of_an_absurd_size_is_none(said: str, kept: float) -> None:
    """Exporters write such numbers where they know of no limit."""
    text = (models.FOLDER / "scara.urdf").read_text()
    limit = re.search(r'<limit [^>]*effort="60"[^>]*>', text)
    assert limit is not None
    other = f'<limit lower="-2.6" upper="2.6" effort="{said}" velocity="{said}"/>'
    model = ArmModel(load_scene(text.replace(limit[0], other)))
    found = model.effort_limit[0], model.velocity_limit[0], model.effort_limit[1]
    assert found == (kept, kept, 30.0)
    zero = {"inner": {"limits": {"effort": 0.0, "velocity": 0.0}}}
    model = ArmModel(load_scene({"robot": {"urdf": SCARA}, "joints": zero}))
    assert (model.effort_limit[0], model.velocity_limit[0]) == (0.0, 0.0)  # the scene means it


def test_vectors_are_read_only() -> None:
    model = models.dynamics("panda").model
    for array in (model.q0, model.viscous, model.armature, model.effort_limit):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_a_joint_that_goes_round_beside_one_that_does_not() -> None:
    """Its angle is kept as cosine and sine, the way on the rail as it is."""
    dyn = Dynamics(rails("x", 2.0, turns=True))
    assert [joint.nq for joint in list(dyn.model.pin.joints)[1:]] == [1, 2]
    for turn in (0.3, 3.5, -9.0):
        q = dyn.model.configuration(np.array([0.4, turn]))
        np.testing.assert_allclose(q, [0.4, np.cos(turn), np.sin(turn)], atol=1e-15)
