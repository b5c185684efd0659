# SPDX-License-Identifier: Apache-2.0
"""Error-controlled sub-steps inside every tick; compiled, on x' = -r x with Euler's error."""

import json
from pathlib import Path

import numpy as np
import pytest
from samples import covering

import models
from arm_sim import Simulator
from arm_sim.stepping.adaptive import SubstepControl
from models.engine import decay
from tolerances import assert_close

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


DECAYS = np.array([2.0, 1.0])


def test_sub_steps_are_as_long_as_the_tolerance_allows() -> None:
    """Error h² r² x / 2 of 0.81 of the tolerance: sub-steps of 0.9 sqrt(2 tol / x) / r."""
    kept = SubstepControl(1e-6, 2)
    assert decay(DECAYS, 1.0, 0.1, kept) is not None
    ideal = 0.9 * np.sqrt(2e-6 / 2.0)
    assert 0.1 / ideal < kept.attempts < 1.15 * 0.1 / ideal
    assert_close(kept.step, 0.9 * np.sqrt(2e-6 / (2.0 * np.exp(-0.1))), 1e-5)
    assert_close(kept.error / 0.1, 0.5 * ideal * 2.0, 1e-4)


def test_too_many_sub_steps_are_given_up() -> None:
    """The library of this test allows 2000."""
    kept = SubstepControl(1e-12, 2)
    assert decay(DECAYS, 1.0, 1.0, kept) is None
    assert kept.attempts == 2000


def test_nothing_to_do_lengthens_the_step_by_six_at_most() -> None:
    kept = SubstepControl(1e-3, 2)
    kept.step = 1e-3
    assert decay(DECAYS, 0.0, 1.0, kept) is not None
    # 1, 6, 36 and 216 ms, and the rest of the second in one, though 1.296 s would have been tried.
    assert kept.attempts == 5
    assert_close(kept.step, 6 * (1.0 - 0.259), 1e-12)


def test_a_last_piece_cut_short_does_not_shorten_the_next_tick() -> None:
    kept = SubstepControl(1e-3, 2)
    kept.step = 1e-2
    assert decay(DECAYS, 0.5, 1.5e-2, kept) is not None
    before = kept.step
    assert before > 1e-2
    assert decay(DECAYS, 0.5, 1e-6, kept) is not None
    assert kept.step >= before
