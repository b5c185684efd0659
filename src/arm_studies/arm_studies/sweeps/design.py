# SPDX-License-Identifier: Apache-2.0
"""The runs of a study: each point of the grid of lists with each sample of the distributions."""

from dataclasses import dataclass
from itertools import product
from statistics import NormalDist
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_studies.sweeps.study import Study, Varied

# Purposes of random numbers; each has its own numbers.
_POINTS, _HYPERCUBE, _NOISE = range(3)
_EDGE = 2.0**-54  # smallest probability, since the quantile of a normal variable at 0 is infinite


@dataclass(frozen=True)
class Point:
    """One run of the design.

    Attributes:
        index: Its number, which orders the table.
        sample: Number of the sample, which all points of the grid share.
        values: Varied values by key.
    """

    index: int
    sample: int
    values: dict[str, Any]


def points(study: Study) -> list[Point]:
    """All runs of a study in order; samples vary fastest.

    Every point of the grid uses the same samples, so that controllers are compared on the same
    arms (common random numbers; Law, "Simulation Modeling and Analysis", 11.2).
    """
    lists = {key: varied.values for key, varied in study.vary.items() if varied.values is not None}
    drawn = {key: varied for key, varied in study.vary.items() if varied.values is None}
    shares = _shares(study, len(drawn))
    columns = [
        [_value(varied, share) for share in column.tolist()]
        for varied, column in zip(drawn.values(), shares.T, strict=True)
    ]
    samples = [dict(zip(drawn, row, strict=True)) for row in zip(*columns, strict=True)]
    samples = samples or [{}] * study.samples
    points: list[Point] = []
    for row in product(*lists.values()):
        of_grid = dict(zip(lists, row, strict=True))
        for k, sample in enumerate(samples):
            values = of_grid | sample
            points.append(Point(len(points), k, {key: values[key] for key in study.vary}))
    return points


def noise_seed(study: Study, sample: int) -> int:
    """Seed of the random effects in a sample's runs: noise, jitter and loss."""
    return int(_generator(study, _NOISE, sample).integers(2**62))


def _shares(study: Study, dimensions: int) -> Array:
    """Points in the unit cube, shape (samples, dimensions)."""
    if study.sampling == "random":  # a sample depends only on seed and number
        rows = [_generator(study, _POINTS, k).random(dimensions) for k in range(study.samples)]
        return np.reshape(rows, (study.samples, dimensions))
    # One point in each of as many slices of every dimension: McKay, Beckman and Conover, "A
    # comparison of three methods for selecting values of input variables", Technometrics 21(2),
    # 1979.
    rng, count = _generator(study, _HYPERCUBE, 0), study.samples
    slices = rng.permuted(np.tile(np.arange(count), (dimensions, 1)), axis=1).T
    return np.asarray((slices + rng.random((count, dimensions))) / count)


def _generator(study: Study, purpose: int, number: int) -> np.random.Generator:
    """Random numbers of one sample, by a counter-based generator, see ``imperfections.chance``."""
    return np.random.Generator(
        np.random.Philox(key=[study.seed, purpose], counter=[0, 0, number, 0])
    )


def _value(varied: Varied, share: float) -> float:
    """The quantile of a distribution."""
    if varied.uniform is not None:
        low, high = varied.uniform
        return low + share * (high - low)
    if varied.log_uniform is not None:
        low, high = varied.log_uniform
        return float(low * (high / low) ** share)
    assert varied.normal is not None
    mean, deviation = varied.normal
    return mean + deviation * NormalDist().inv_cdf(min(max(share, _EDGE), 1.0 - 2.0 * _EDGE))
