# SPDX-License-Identifier: Apache-2.0
"""What was identified, as a scene that can be loaded."""

from pathlib import Path

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, load_scene
from arm_dynamics.exceptions import InvalidInput
from arm_studies.identification.checks import check_model
from arm_studies.identification.identified_scene import scene_with
from arm_studies.identification.regression import friction as terms
from arm_studies.identification.regression.regressor import RigidRegressor

LIMITED = {
    "in one direction": ({terms.COULOMB_SKEW: 0.9}, terms.Shape(None, 0.9, 2.0)),
    "at rest": ({terms.EXCESS: 1.5}, terms.Shape(0.1, 0.8, 5.0)),
    "of a table": ({}, terms.Shape(None, 0.98, 1.0, ((0.0, 0.0), (0.3, 0.9), (1.0, 1.0)))),
}


def two_link(**friction):
    """The scene, with more friction keys of the shoulder."""
    scene = load_scene("two_link").model_dump(exclude_unset=True, mode="json")
    joints = scene.setdefault("joints", {})
    joints["shoulder"] = {"friction": {"viscous": 0.5, "coulomb": 1.0, **friction}}
    return ArmModel(load_scene(scene))


def told(coefficients, shape, steepness=0.0, model=None):
    """The notes, and the friction of the shoulder in a scene that can be simulated."""
    model = model or ArmModel(load_scene("two_link"))
    values, notes = {terms.VISCOUS: 0.1, terms.COULOMB: 1.0, **coefficients}, []
    laws = [terms.JointFit(tuple(values), shape, values, steepness), None]
    nominal = RigidRegressor(model).nominal
    found = scene_with(model, nominal, np.full(model.n, np.nan), laws, notes)
    return notes, ArmModel(found).scene.joints["shoulder"].friction


@pytest.mark.parametrize("case", LIMITED)
def test_growth_with_load_is_limited_to_what_a_scene_allows(case):
    notes, friction = told(*LIMITED[case])
    assert [note for note in notes if note.endswith("the scene limits that to 0.5")]
    assert friction.load.factor[-1] == 1.0
    assert 0.0 < friction.load.factor[0] < 1.0


def test_a_law_with_states_stays():
    model = two_link(lugre={"sigma0": 1e4, "sigma1": 0.05}, static=1.3, stribeck_velocity=0.1)
    notes, friction = told({}, terms.Shape(), model=model)
    assert not notes
    assert friction.lugre.sigma0 == 1e4 and friction.lugre.sigma1 == 0.05
    assert (friction.viscous, friction.coulomb, friction.static) == (0.1, 1.0, None)


def test_friction_that_is_neither_identified_nor_kept_is_refused_by_name():
    table = {"at": [-1.0, 1.0], "factor": [1.0, 1.2]}
    with pytest.raises(InvalidInput, match=r"'shoulder' has 'friction\.position', which cannot"):
        check_model(two_link(position=table))


def test_a_table_is_replaced_by_coefficients():
    table = {"table": {"speed": [0.0, 1.0], "torque": [1.0, 2.0]}}
    scene = load_scene("two_link").model_dump(exclude_unset=True, mode="json")
    scene["joints"]["shoulder"] = {"friction": table}
    notes, friction = told({}, terms.Shape(None, None, 1.0), model=ArmModel(load_scene(scene)))
    assert notes == ["'shoulder': its table of friction is replaced by coefficients"]
    assert (friction.table, friction.coulomb, friction.viscous) == (None, 1.0, 0.1)


def test_friction_that_differs_by_direction_is_written_for_both():
    notes, friction = told({terms.VISCOUS_SKEW: 0.03, terms.COULOMB_SKEW: -0.25}, terms.Shape())
    assert not notes
    sides = [(x.positive, x.negative) for x in (friction.viscous, friction.coulomb)]
    np.testing.assert_allclose(sides, [(0.13, 0.07), (0.75, 1.25)], rtol=1e-12)
    notes, friction = told({terms.VISCOUS_SKEW: -0.5}, terms.Shape())  # more than there is
    assert (friction.viscous.positive, friction.viscous.negative) == (0.0, 0.2)
    notes, friction = told({terms.COULOMB_SKEW: 1.5}, terms.Shape())
    assert (friction.coulomb.positive, friction.coulomb.negative) == (2.0, 0.0)
    assert notes[0].startswith("'shoulder': a constant torque of 1.5 exceeds its Coulomb friction")


def test_friction_at_rest_is_above_that_of_sliding():
    notes, friction = told({terms.EXCESS: 0.5}, terms.Shape(0.2, None, 1.0))
    assert not notes and (friction.static, friction.stribeck_velocity) == (1.5, 0.2)
    _, friction = told({terms.EXCESS: 0.5, terms.COULOMB_SKEW: 0.25}, terms.Shape(0.2, None, 1.0))
    assert (friction.static.positive, friction.static.negative) == (1.75, 1.25)
    _, friction = told({}, terms.Shape(0.2, None, 1.0))
    assert friction.static is None and friction.stribeck_velocity is None


def written(scene, theta=None, armature=None, friction=None):
    """An identified scene, its notes, and the model that it was identified from."""
    model, notes = ArmModel(load_scene(scene)), []
    theta = RigidRegressor(model).nominal if theta is None else theta
    armature = np.full(model.n, np.nan) if armature is None else np.array(armature)
    found = scene_with(model, theta, armature, friction or [None] * model.n, notes)
    return found, notes, model


def test_what_drives_bring_is_not_written_twice():
    """The rotor's inertia and damping, and the losses of the gear, are those of the joint."""
    scene = load_scene("two_link").model_dump(exclude_unset=True, mode="json")
    drive = {"gear_ratio": 10.0, "rotor_inertia": 1e-3, "rotor_damping": 2e-3, "efficiency": 0.8}
    scene["joints"] = {"elbow": {"actuator": drive}, "*": {"armature": 0.7, "friction": {}}}
    values = {terms.VISCOUS: 0.5, terms.COULOMB: 1.0}
    law = terms.JointFit(tuple(values), terms.Shape(), values)
    found, notes, _ = written(scene, armature=[0.25, 0.35], friction=[None, law])
    elbow = found.joints["elbow"]
    assert elbow.armature == pytest.approx(0.35 - 0.1)
    assert elbow.friction.viscous == pytest.approx(0.5 - 0.2)
    assert elbow.actuator.efficiency == 1.0 and elbow.actuator.rotor_inertia == 1e-3
    assert notes == ["'elbow': the identified friction includes the losses of the gear"]
    assert found.joints["shoulder"].armature == 0.25 and "*" not in found.joints
    found, *_ = written(scene, armature=[np.nan, 0.05])
    assert found.joints["elbow"].armature == 0.0  # less than the rotor's
    assert found.joints["shoulder"].armature == 0.7  # unchanged


def test_followers_have_no_friction_of_their_own():
    urdf = Path(models.__file__).with_name("gripper.urdf")
    scene, notes, model = written({"robot": {"urdf": str(urdf)}})
    followers = [name for name in list(model.pin.names)[1:] if name not in model.joint_names]
    assert followers and not notes
    for name in followers:
        joint = scene.joints[name]
        assert (joint.friction.viscous, joint.friction.coulomb, joint.armature) == (0.0, 0.0, 0.0)
