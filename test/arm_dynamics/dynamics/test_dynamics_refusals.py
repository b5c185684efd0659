# SPDX-License-Identifier: Apache-2.0
"""Bad arguments are refused at once, with the argument's name, and the instance stays usable."""

import numpy as np
import pytest

import models
from arm_dynamics import ArmError, InvalidInput

GOOD = np.zeros(3)
BAD = {
    "too short": np.zeros(2), "too long": np.zeros(4), "scalar": 0.0, "empty": [],
    "column": np.zeros((3, 1)), "cube": np.zeros((2, 2, 3)), "no rows": np.zeros((0, 3)),
    "NaN": [0.0, np.nan, 0.0], "infinite": [0.0, np.inf, 0.0], "words": ["a", "b", "c"],
    "nothing": None, "ragged": [[0.0, 0.0, 0.0], [0.0]], "mapping": {"joint1": 0.0},
    "complex": np.array([1j, 0, 0]),
}  # fmt: skip


@pytest.mark.parametrize("value", BAD.values(), ids=BAD)
@pytest.mark.parametrize("place", [0, 1, 2], ids=["q", "v", "a"])
def test_inverse_names_the_bad_argument(value: object, place: int) -> None:
    dyn = models.dynamics("planar_3r")
    args: list[object] = [GOOD, GOOD, GOOD]
    args[place] = value
    with pytest.raises(InvalidInput) as caught:
        dyn.inverse(*args)
    assert str(caught.value).startswith("qva"[place])
    np.testing.assert_array_equal(dyn.friction(GOOD), GOOD)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_no_motion_that_is_not_finite_has_torques(robot: str, value: float) -> None:
    """However many calls there were, at whatever joint of whatever kind."""
    dyn = models.dynamics(robot).of_motions()
    for place, joint in np.ndindex(3, dyn.n):
        motion = np.random.default_rng(0).uniform(-1.0, 1.0, (3, dyn.n))
        motion[place, joint] = value
        with pytest.raises(InvalidInput, match=f"^{'qva'[place]}.*finite"):
            dyn.inverse(*motion)


@pytest.mark.parametrize("value", BAD.values(), ids=BAD)
def test_every_method_refuses(value: object) -> None:
    dyn = models.dynamics("planar_3r")
    for call in (
        lambda: dyn.forward(GOOD, GOOD, value),
        lambda: dyn.mass_matrix(value),
        lambda: dyn.gravity(value),
        lambda: dyn.coriolis_matrix(GOOD, value),
        lambda: dyn.friction(value),
        lambda: dyn.energy(value, GOOD),
    ):
        with pytest.raises(InvalidInput):
            call()
    with pytest.raises(TypeError):
        dyn.friction(GOOD, GOOD)  # q and v, as of every other method


def test_refusals_are_value_errors_and_of_the_family() -> None:
    assert issubclass(InvalidInput, ValueError) and issubclass(InvalidInput, ArmError)
