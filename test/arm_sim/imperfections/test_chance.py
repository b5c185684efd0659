# SPDX-License-Identifier: Apache-2.0
"""Random numbers of a tick depend on seed, channel, arm and tick only."""

import numpy as np

from arm_sim.imperfections.chance import Chance, Channel, normal

TICKS = np.arange(400)


def noise(seed: int = 1, channel: Channel = Channel.POSITION, arm: int = 0) -> Chance:
    return Chance(seed, channel, normal(np.array([0.0, 5.0]), np.array([1.0, 2.0])), arm)


def rows(chance: Chance, ticks: np.ndarray = TICKS) -> np.ndarray:
    return np.array([chance.at(int(tick)) for tick in ticks])


def test_ticks_may_be_asked_in_any_order_and_again(rng: np.random.Generator) -> None:
    order = rng.permutation(TICKS)
    np.testing.assert_array_equal(rows(noise(), order), rows(noise())[order])


def test_seeds_channels_and_arms_are_uncorrelated() -> None:
    others = [noise(2), noise(channel=Channel.VELOCITY), noise(arm=1), noise(arm=2)]
    ticks = np.arange(6400)
    columns = np.column_stack([rows(one, ticks) for one in (noise(), *others)])
    correlation = np.corrcoef(columns.T) - np.eye(columns.shape[1])
    assert abs(correlation).max() < 5.0 / np.sqrt(len(ticks))


def test_noise_has_its_mean_and_deviation_and_is_white() -> None:
    samples = rows(noise(), np.arange(20_000))
    count = len(samples)
    np.testing.assert_allclose(samples.mean(axis=0), [0.0, 5.0], atol=5.0 * 2.0 / np.sqrt(count))
    np.testing.assert_allclose(samples.std(axis=0), [1.0, 2.0], rtol=5.0 / np.sqrt(2 * count))
    for lag in (1, 2, 63, 64, 65):  # across blocks as within
        together = np.corrcoef(samples[lag:, 0], samples[:-lag, 0])[0, 1]
        assert abs(together) < 5.0 / np.sqrt(count)
