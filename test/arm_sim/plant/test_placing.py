# SPDX-License-Identifier: Apache-2.0
"""States that a scene with contacts allows, to the nanometre, and the errors for others."""

from typing import Any

import numpy as np
import pytest

from arm_dynamics import InvalidInput, load_scene
from arm_dynamics.exceptions import ConstraintError
from arm_dynamics.model import ArmModel
from arm_sim.plant.placing import INSIDE, placed
from arm_sim.plant.plant import Plant
from models.touching import contact, rails


def plant(axes: str, *contacts: dict[str, Any]) -> Plant:
    scene = {**rails(axes), "constraints": contacts}
    return Plant(ArmModel(load_scene(scene)))


def above(height: float, name: str) -> dict[str, Any]:
    """A contact with a plane at such a height."""
    return contact("body", plane={"point": [0.0, 0.0, height]}, name=name)


@pytest.mark.parametrize("z", [0.3, 0.0, -INSIDE])
def test_a_point_may_be_above_its_plane_or_a_nanometre_inside(z: float) -> None:
    made = plant("z", contact("body"))
    np.testing.assert_array_equal(placed(made, [z], [0.5], None, ()), [z, 0.5])


@pytest.mark.parametrize("z", [np.nextafter(-INSIDE, -1.0), -0.25])
def test_a_point_deeper_inside_is_refused_with_its_depth(z: float) -> None:
    made = plant("z", above(0.0, "foot"))
    with pytest.raises(ConstraintError, match=f"contact 'foot' is {-z:.6g} m inside") as caught:
        placed(made, [z], [0.0], None, ())
    assert caught.value.residuals == {"foot": z}


@pytest.mark.parametrize(
    ("heights", "deepest"), [((-1.0, 0.5, 0.2), 1), ((0.5, 0.2, -1.0), 0), ((0.2, 0.4, 0.5), 2)]
)
def test_of_several_points_the_deepest_is_named_and_all_gaps_are_reported(
    heights: tuple[float, ...], deepest: int
) -> None:
    made = plant("xz", *(above(height, f"foot{k}") for k, height in enumerate(heights)))
    np.testing.assert_array_equal(placed(made, [5.0, 0.6], [0, 0], None, ())[:2], [5.0, 0.6])
    with pytest.raises(ConstraintError, match=f"'foot{deepest}' is {heights[deepest]} m") as told:
        placed(made, [5.0, 0.0], [0.0, 0.0], None, ())
    assert told.value.residuals == {f"foot{k}": -height for k, height in enumerate(heights)}


def test_a_point_inside_its_plane_is_refused_whatever_states_drives_have() -> None:
    """The laws' states come after positions and velocities and say nothing of gaps."""
    bristles = {"coulomb": 0.5, "viscous": 1.0, "lugre": {"sigma0": 1e3, "sigma1": 1.0}}
    made = Plant(
        ArmModel(load_scene({**rails("xz", friction=bristles), "constraints": [contact("body")]}))
    )
    assert made.nz == 2
    x = placed(made, [0.0, 0.5], [0.0, 0.0], [-3.0, -3.0], ())
    assert x.tolist() == [0.0, 0.5, 0.0, 0.0, -3.0, -3.0]
    with pytest.raises(ConstraintError, match="0.5 m inside"):
        placed(made, [0.0, -0.5], [9.0, 9.0], [3.0, 3.0], ())


@pytest.mark.parametrize(("place", "way"), [(-2.0, -1.0), (3.0, 1.0)])
def test_a_position_beyond_a_stop_by_rounding_is_at_the_stop(place: float, way: float) -> None:
    """By a billionth; farther ones are refused."""
    limits = {"lower": -2.0, "upper": 3.0}
    made = Plant(ArmModel(load_scene({**rails("xz"), "joints": {"z": {"limits": limits}}})))
    beyond = place + way * 0.9e-9 * abs(place)
    x = placed(made, [9.0, beyond], [0.0, 1.0], None, ())
    np.testing.assert_array_equal(x, [9.0, place, 0.0, 1.0])
    with pytest.raises(InvalidInput, match="'z' at .* is beyond its stops"):
        placed(made, [9.0, place + way * 1.1e-9 * abs(place)], [0.0, 1.0], None, ())
