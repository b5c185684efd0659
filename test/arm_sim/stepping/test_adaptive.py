# SPDX-License-Identifier: Apache-2.0
"""Error-controlled sub-steps inside every tick."""

import json
from pathlib import Path

import numpy as np
import pytest
from samples import covering

import models
from arm_sim import Simulator

DATA = json.loads((Path(__file__).parents[2] / "reference/double_pendulum.json").read_text())[
    "pi6_pi4"
]


def error(seconds: float, **options: object) -> float:
    sim = models.simulator("double_pendulum", **options)
    sim.reset(q=[np.pi / 6, np.pi / 12], v=[0.0, 0.0])
    q = sim.run(seconds).q[-1]
    th1, th2 = (float(x) for x in DATA[str(int(seconds))][:2])
    return float(np.abs(q - [th1, th2 - th1]).max())


@pytest.mark.parametrize(
    ("tolerance", "dt"), covering([1e-4, 1e-6, 1e-8, 1e-10], [1e-3, 0.1, 1.0])
)
def test_delivers_what_is_asked(tolerance: float, dt: float) -> None:
    """Ten seconds to ten times the tolerance, whatever the length of a tick."""
    assert error(10.0, tolerance=tolerance, dt=dt) < 10 * tolerance


@pytest.mark.parametrize("name", ["dopri5", "dop853"])
def test_deflections_of_bristles_are_as_exact_as_their_size_asks(name: str) -> None:
    """At most 0.4 mrad, in which an error of the size of an angle's would not show."""
    sigma0, level, tolerance = 1e3, 0.4, 1e-3
    law = {"coulomb": level, "lugre": {"sigma0": sigma0, "sigma1": 0.5}}
    arm = {"robot": models.scene("pendulum").robot, "joints": {"*": {"friction": law}}}
    runs = []
    for asked in (tolerance, 1e-11):
        sim = Simulator({**arm, "sim": {"integrator": name, "tolerance": asked, "dt": 0.02}})
        sim.set_state([0.5], [0.0])
        runs.append(sim.run(0.4))
    assert abs(runs[0].z - runs[1].z).max() < 10 * tolerance * level / sigma0


def test_estimate_is_of_the_size_of_the_error() -> None:
    """A sum of local estimates: not a bound, but neither idle nor absurd."""
    sim = models.simulator("double_pendulum", tolerance=1e-6, dt=0.1)
    true = error(5.0, tolerance=1e-6, dt=0.1)
    assert true / 100 < sim.state.error < 100 * true + 1e-4
    assert sim.reset().error == 0.0
    estimates = sim.run(2.0).local_error
    assert estimates[0] == 0.0 and estimates[-1] == sim.state.error > 0.0
    assert (np.diff(estimates) >= 0.0).all()


def test_estimate_of_an_arm_far_from_its_stops_is_that_of_one_without() -> None:
    """That of every sub-step of a tick counts."""
    scene, errors = models.scene("double_pendulum").model_dump(exclude_unset=True), []
    for stop in (True, False):
        scene["joints"] = {"*": {"limits": {"lower": -50.0, "upper": 50.0, "stop": stop}}}
        run = Simulator(scene, integrator="dopri5", tolerance=1e-9, dt=0.5).run(1.0)
        errors.append(run.local_error)
    np.testing.assert_array_equal(*errors)
    assert errors[0][-1] > 1e-8
