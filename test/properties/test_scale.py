# SPDX-License-Identifier: Apache-2.0
"""Arms of 1e-9 kg and 1 mm, and of 1e9 kg and 1 km, are right to rounding: nothing is absolute."""

import numpy as np
import pytest
from samples import sampled

import models
from arm_dynamics import Dynamics
from arm_sim import Simulator
from models.scaled import Scale
from tolerances import ALGEBRA, CLOSURE

TINY, HUGE = Scale(2.0**-10, 2.0**-30), Scale(2.0**10, 2.0**30)
scales = pytest.mark.parametrize("scale", [TINY, HUGE], ids=["1 mm, 1e-9 kg", "1 km, 1e9 kg"])
SLIDING = 1e-11
"""Relative: dry friction is located in time, which is not a power of two."""


@scales
@pytest.mark.parametrize("robot", ["skew_axes", "gantry", "panda"])
def test_dynamics_are_similar_to_the_bit(
    robot: str, scale: Scale, rng: np.random.Generator
) -> None:
    plain = models.dynamics(robot)
    other = Dynamics(scale.scene(models.scene(robot)))
    far, torque = scale.positions(plain.model), scale.torques(plain.model)
    q, v, a, tau = rng.normal(size=(4, 10, plain.n))
    moved = q * far, v * far * scale.rate
    needed = other.inverse(*moved, a * far * scale.rate**2)
    np.testing.assert_array_equal(needed, plain.inverse(q, v, a) * torque)
    gained = other.forward(*moved, tau * torque)
    np.testing.assert_array_equal(gained, plain.forward(q, v, tau) * far * scale.rate**2)


@scales
@pytest.mark.parametrize(
    ("robot", "tolerance"),
    sampled([("planar_3r", SLIDING), ("skew_axes", 0.0), ("slider_crank", ALGEBRA)], 2),
)
def test_motions_are_similar(robot: str, tolerance: float, scale: Scale) -> None:
    """Generated code is accepted, and runs alike."""
    plain = Simulator(models.scene(robot), integrator="rk4", dt=1e-3)
    other = Simulator(scale.scene(models.scene(robot)), integrator="rk4", dt=1e-3 / scale.rate)
    far, torque = scale.positions(plain.model), scale.torques(plain.model)
    u = np.linspace(0.5, -0.7, plain.n)
    runs = plain.run(50 * plain.dt, u), other.run(50 * other.dt, u * torque)
    for own, expected, factor in (
        (runs[1].q, runs[0].q, far),
        (runs[1].v, runs[0].v, far * scale.rate),
    ):
        difference = abs(own / factor - expected)
        assert difference.max() <= tolerance * abs(expected).max()
    assert runs[1].trusted


@scales
@pytest.mark.parametrize("linkage", ["slider_crank", "five_bar"])
def test_linkages_close_at_the_same_place(linkage: str, scale: Scale) -> None:
    plain = models.dynamics(linkage)
    other = Dynamics(scale.scene(models.scene(linkage)))
    place = other.model.q0 / scale.positions(plain.model)
    np.testing.assert_allclose(place, plain.model.q0, rtol=0, atol=CLOSURE)
    assert other.model.constraint_rows == plain.model.constraint_rows
