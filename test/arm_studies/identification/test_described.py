# SPDX-License-Identifier: Apache-2.0
"""What was identified, as a scene that can be loaded."""

import numpy as np
import pytest

from arm_dynamics import ArmModel, load_scene
from arm_dynamics.exceptions import InvalidInput
from arm_studies.identification.checks import check_model
from arm_studies.identification.described import scene_with
from arm_studies.identification.regression.friction_columns import (
    COULOMB,
    COULOMB_SKEW,
    EXCESS,
    VISCOUS,
    JointFit,
    Shape,
)
from arm_studies.identification.regression.regressor import RigidRegressor

LIMITED = {
    "of all": ({}, Shape(None, 0.98, 1.0)),
    "in one direction": ({COULOMB_SKEW: 0.9}, Shape(None, 0.9, 2.0)),
    "at rest": ({EXCESS: 1.5}, Shape(0.1, 0.8, 5.0)),
    "of a table": ({}, Shape(None, 0.98, 1.0, ((0.0, 0.0), (0.3, 0.9), (1.0, 1.0)))),
}


def two_link(**friction):
    """The scene, with more friction keys of the shoulder."""
    scene = load_scene("two_link").model_dump(exclude_unset=True, mode="json")
    joints = scene.setdefault("joints", {})
    joints["shoulder"] = {"friction": {"viscous": 0.5, "coulomb": 1.0, **friction}}
    return ArmModel(load_scene(scene))


def told(coefficients, shape, refused=0.0, model=None):
    """The notes, and the friction of the shoulder in a scene that can be simulated."""
    model = model or ArmModel(load_scene("two_link"))
    values, notes = {VISCOUS: 0.1, COULOMB: 1.0, **coefficients}, []
    laws = [JointFit(tuple(values), shape, values, refused), None]
    nominal = RigidRegressor(model).nominal
    found = scene_with(model, nominal, np.full(model.n, np.nan), laws, notes)
    return notes, ArmModel(found).scene.joints["shoulder"].friction


@pytest.mark.parametrize("case", LIMITED)
def test_growth_with_load_is_limited_to_what_a_scene_allows(case):
    notes, friction = told(*LIMITED[case])
    assert [note for note in notes if note.endswith("the scene limits that to 0.5")]
    assert friction.load.factor[-1] == 1.0
    assert 0.0 < friction.load.factor[0] < 1.0


def test_growth_that_a_scene_allows_stays_as_it_is():
    notes, friction = told({COULOMB_SKEW: 0.2}, Shape(None, 0.9, 4.0))
    assert not notes
    assert friction.load.factor[0] == pytest.approx(0.1, rel=1e-12)


def test_growth_that_was_left_out_is_told():
    notes, friction = told({}, Shape(), refused=0.45)
    assert notes == [
        "'shoulder': friction seems to grow by up to 0.45 of the load that causes it; at most 0.3 "
        "is identified, so its growth is left out"
    ]
    assert friction.load is None
    notes, friction = told({}, Shape(None, 0.5, 4.0), refused=0.45)
    assert not notes and friction.load is not None


def test_a_law_with_states_stays():
    model = two_link(lugre={"sigma0": 1e4, "sigma1": 0.05}, static=1.3, stribeck_velocity=0.1)
    notes, friction = told({}, Shape(), model=model)
    assert not notes
    assert friction.lugre.sigma0 == 1e4 and friction.lugre.sigma1 == 0.05
    assert (friction.viscous, friction.coulomb, friction.static) == (0.1, 1.0, None)


def test_a_law_that_the_identified_friction_contradicts_is_refused_by_name():
    """Bristles bend only up to a Coulomb friction above zero."""
    model = two_link(lugre={"sigma0": 1e4})
    with pytest.raises(InvalidInput, match=r"joints\.shoulder\.friction\.lugre' needs coulomb"):
        told({COULOMB: 0.0}, Shape(), model=model)


def test_friction_that_is_neither_identified_nor_kept_is_refused_by_name():
    table = {"at": [-1.0, 1.0], "factor": [1.0, 1.2]}
    with pytest.raises(InvalidInput, match=r"'shoulder' has 'friction\.position', which cannot"):
        check_model(two_link(position=table))


def test_a_table_is_replaced_by_coefficients():
    table = {"table": {"speed": [0.0, 1.0], "torque": [1.0, 2.0]}}
    scene = load_scene("two_link").model_dump(exclude_unset=True, mode="json")
    scene["joints"]["shoulder"] = {"friction": table}
    notes, friction = told({}, Shape(None, None, 1.0), model=ArmModel(load_scene(scene)))
    assert notes == ["'shoulder': its table of friction is replaced by coefficients"]
    assert (friction.table, friction.coulomb, friction.viscous) == (None, 1.0, 0.1)
