# SPDX-License-Identifier: Apache-2.0
"""Points of a study: grids, samples, and that they depend on seed and number alone."""

from typing import Any

import numpy as np
import scipy

from arm_studies.sweeps import load_study
from arm_studies.sweeps.design import noise_seed, points

DRAWN = {"gravity.0": {"uniform": [-1, 3]}, "gravity.1": {"log_uniform": [0.1, 10]},
         "gravity.2": {"normal": [5, 2]}}  # fmt: skip


def columns(**more: Any) -> np.ndarray:
    study = load_study({"scene": "two_link", "duration": 1, "vary": DRAWN, **more})
    return np.array([list(point.values.values()) for point in points(study)])


def test_lists_make_a_grid_that_meets_the_same_samples() -> None:
    vary = {"a": [1, 2], **DRAWN, "b": ["x", "y", "z"]}
    study = load_study(
        {"scene": "two_link", "duration": 1, "vary": {f"sim.{k}": v for k, v in vary.items()},
         "samples": 5}
    )  # fmt: skip
    made = points(study)
    assert [point.index for point in made] == list(range(30))
    grid = {(point.values["sim.a"], point.values["sim.b"]) for point in made}
    assert grid == {(a, b) for a in (1, 2) for b in "xyz"}
    drawn = {point.values["sim.gravity.0"] for point in made}
    assert len(drawn) == 5


def test_distributions_are_what_they_are_called() -> None:
    low, middle, high = columns(samples=2000, seed=4).T
    assert scipy.stats.kstest(low, scipy.stats.uniform(-1, 4).cdf).pvalue > 0.01
    assert scipy.stats.kstest(middle, scipy.stats.loguniform(0.1, 10).cdf).pvalue > 0.01
    assert scipy.stats.kstest(high, scipy.stats.norm(5, 2).cdf).pvalue > 0.01


def test_a_latin_hypercube_has_one_point_in_each_slice() -> None:
    count = 50
    low, middle, high = columns(samples=count, sampling="latin_hypercube").T
    shares = [(low + 1) / 4, np.log(middle / 0.1) / np.log(100), scipy.stats.norm(5, 2).cdf(high)]
    for share in shares:
        assert sorted(np.floor(count * share).astype(int)) == list(range(count))
    assert abs(np.corrcoef(shares)[np.triu_indices(3, 1)]).max() < 0.5


def test_random_samples_depend_on_seed_and_number_alone() -> None:
    few, many = columns(samples=3), columns(samples=10)
    np.testing.assert_array_equal(few, many[:3])
    assert not np.any(columns(samples=3, seed=1) == few)
    study = load_study({"scene": "two_link", "duration": 1})
    seeds = [noise_seed(study, k) for k in range(100)]
    assert len(set(seeds)) == 100 and seeds == [noise_seed(study, k) for k in range(100)]
