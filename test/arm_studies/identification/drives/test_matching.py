# SPDX-License-Identifier: Apache-2.0
"""The search that fits simulated trajectories to measured ones."""

import casadi as ca
import numpy as np
import pytest

from arm_dynamics import InvalidInput
from arm_studies.identification.drives.law import Law, Trial
from arm_studies.identification.drives.matching import _Problem, match

DT, RATE, GAIN = 0.01, 3.0, 2.0


def decay(count: int = 60, noise: float = 0.0) -> Trial:
    """x' = gain u - rate x from x = 0.3, u one for a while: a closed form."""
    x, u, rate, gain = (ca.SX.sym(name) for name in ("x", "u", "rate", "gain"))
    law = Law(x, u, {"rate": rate, "gain": gain}, gain * u - rate * x, x)
    held = np.where(np.arange(count) < count // 2, 1.0, -0.5)
    y, fade = [0.3], np.exp(-RATE * DT)
    for push in held[:-1]:
        y.append(GAIN * push / RATE + (y[-1] - GAIN * push / RATE) * fade)
    told = np.array(y) + noise * np.random.default_rng(3).normal(size=count)
    return Trial(law, DT, held[:, None], told[:, None], np.array([told[0]]), np.zeros((1, 1)))


def test_derivatives_are_those_of_the_steps_that_are_computed() -> None:
    problem, log_p = _Problem([decay()], ("rate", "gain")), np.log([2.5, 1.4])
    problem.refine(log_p)
    x0, e = [np.array([0.2])], 1e-5
    _, J = problem.evaluate(log_p, x0)
    for i, (dp, dx) in enumerate([((e, 0.0), 0.0), ((0.0, e), 0.0), ((0.0, 0.0), e)]):
        ends = [problem.evaluate(log_p + s * np.array(dp), [x0[0] + s * dx])[0] for s in (1, -1)]
        np.testing.assert_allclose(J[:, i], (ends[0] - ends[1]) / (2.0 * e), atol=1e-8)


def test_a_decay_is_found_and_so_is_where_it_began() -> None:
    found = match([decay()], {"rate": 1.0, "gain": 1.0})
    assert found.values == pytest.approx({"rate": RATE, "gain": GAIN}, rel=1e-7)
    np.testing.assert_allclose(found.simulated[0], decay().y, atol=1e-8)


def test_intervals_grow_with_the_noise() -> None:
    wide, narrow = (match([decay(noise=s)], {"rate": 1.0, "gain": 1.0}) for s in (2e-2, 2e-4))
    ratio = wide.estimates["rate"].interval / narrow.estimates["rate"].interval
    assert ratio == pytest.approx(100.0, rel=0.1)
    assert abs(narrow.values["rate"] - RATE) < 2.0 * narrow.estimates["rate"].interval


def test_guesses_must_be_positive_and_something_must_vary() -> None:
    with pytest.raises(InvalidInput, match="first guess of gain = .*; a positive number"):
        match([decay()], {"rate": 1.0, "gain": -1.0})
    still = decay()
    flat = Trial(still.law, DT, still.u, np.full_like(still.y, np.nan), still.x0, still.around)
    with pytest.raises(InvalidInput, match="nothing varies"):
        match([flat], {"rate": 1.0, "gain": 1.0})
