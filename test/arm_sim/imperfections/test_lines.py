# SPDX-License-Identifier: Apache-2.0
"""Random numbers of ticks; delay, jitter and loss of messages that carry their tick."""

import numpy as np
import pytest

from arm_dynamics.scene import imperfections as schema
from arm_sim.imperfections.chance import Chance, Channel, normal
from arm_sim.imperfections.lines import Line

DT, TICKS = 1e-3, 20_000


def noise(seed: int = 1, channel: Channel = Channel.POSITION, arm: int = 0) -> Chance:
    return Chance(seed, channel, normal(np.array([0.0, 5.0]), np.array([1.0, 2.0])), arm)


def rows(chance: Chance, ticks: np.ndarray) -> np.ndarray:
    return np.array([chance.at(int(tick)) for tick in ticks])


def test_ticks_may_be_asked_in_any_order_and_again(rng: np.random.Generator) -> None:
    order = rng.permutation(400)
    np.testing.assert_array_equal(rows(noise(), order), rows(noise(), np.arange(400))[order])


def test_seeds_channels_and_arms_are_uncorrelated() -> None:
    others = [noise(2), noise(channel=Channel.VELOCITY), noise(arm=1), noise(arm=2)]
    ticks = np.arange(6400)
    columns = np.column_stack([rows(one, ticks) for one in (noise(), *others)])
    correlation = np.corrcoef(columns.T) - np.eye(columns.shape[1])
    assert abs(correlation).max() < 5.0 / np.sqrt(len(ticks))


def test_noise_has_its_mean_and_deviation_and_is_white() -> None:
    samples = rows(noise(), np.arange(TICKS))
    count = len(samples)
    np.testing.assert_allclose(samples.mean(axis=0), [0.0, 5.0], atol=5.0 * 2.0 / np.sqrt(count))
    np.testing.assert_allclose(samples.std(axis=0), [1.0, 2.0], rtol=5.0 / np.sqrt(2 * count))
    for lag in (1, 2, 63, 64, 65):  # across blocks as within
        together = np.corrcoef(samples[lag:, 0], samples[:-lag, 0])[0, 1]
        assert abs(together) < 5.0 / np.sqrt(count)


def received(arm: int = 0, **line: float) -> list[int | None]:
    """The newest message at each tick when one is sent in each."""
    carrier: Line[int] = Line(schema.Line(**line), DT, 3, Channel.STATES, arm)
    return [carrier.carry(tick, tick) for tick in range(TICKS)]


def ages(**line: float) -> np.ndarray:
    newest = received(**line)
    return np.array([tick - sent for tick, sent in enumerate(newest) if sent is not None])


@pytest.mark.parametrize(
    ("delay", "ticks"), [(0.0, 0), (0.0003, 1), (0.001, 1), (0.0011, 2), (0.1, 100)]
)
def test_a_delay_is_seen_at_the_first_tick_that_is_not_before(delay: float, ticks: int) -> None:
    newest = received(delay=delay)
    assert newest[:ticks] == [None] * ticks
    assert set(ages(delay=delay)) == {ticks}


def test_loss_leaves_the_one_before() -> None:
    newest = received(loss=0.2)
    fresh = np.array([sent == tick for tick, sent in enumerate(newest)])
    assert abs(fresh.mean() - 0.8) < 5.0 * np.sqrt(0.2 * 0.8 / TICKS)
    kept = [sent for sent in newest if sent is not None]
    assert kept == sorted(kept)
    # The number of losses in a row is geometric, with mean 0.2 / 0.8.
    assert abs(ages(loss=0.2).mean() - 0.25) < 0.02


def test_jitter_is_even_between_delay_and_delay_and_jitter() -> None:
    """Sent now and then, so that none is overtaken, a third arrives in each of three ticks."""
    line: Line[int] = Line(schema.Line(delay=0.001, jitter=0.003), DT, 3, Channel.STATES)
    late = []
    for sent in range(0, TICKS, 10):
        line.send(sent, sent)
        late.append(next(k for k in range(10) if line.receive(sent + k) == sent))
    times, counts = np.unique(late, return_counts=True)
    np.testing.assert_array_equal(times, [2, 3, 4])
    np.testing.assert_allclose(counts / len(late), 1 / 3, atol=5.0 * np.sqrt(2 / 9 / len(late)))


def test_what_is_overtaken_never_shows_and_hides_nothing() -> None:
    """At each tick the newest is the last sent of those that have arrived, each sent alone."""
    alone = []
    for sent in range(300):
        line: Line[int] = Line(schema.Line(jitter=0.005), DT, 3, Channel.STATES)
        line.send(sent, sent)
        alone.append(next(k for k in range(sent, sent + 9) if line.receive(k) == sent))
    for tick, newest in enumerate(received(jitter=0.005)[:300]):
        assert newest == max((k for k, at in enumerate(alone) if at <= tick), default=None)


def test_arms_have_chances_of_their_own_and_runs_repeat() -> None:
    both = {"jitter": 0.004, "loss": 0.1}
    assert received(**both) == received(**both)
    assert received(**both) != received(arm=1, **both)


def test_a_restart_forgets_what_is_on_the_way() -> None:
    line: Line[int] = Line(schema.Line(delay=0.002), DT, 3, Channel.STATES)
    line.send(0, 0)
    line.restart(received=7)
    assert [line.receive(tick) for tick in range(5)] == [7] * 5
