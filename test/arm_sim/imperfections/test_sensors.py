# SPDX-License-Identifier: Apache-2.0
"""Sensor readings of a known motion: resolution, offsets, noise, spectra. Random numbers of ticks,
and by them delay, jitter and loss of messages that carry their tick.
"""

from typing import Any

import numpy as np
import pytest
import scipy

from arm_dynamics import SceneError
from arm_dynamics.scene import imperfections as schema
from arm_sim.imperfections.chance import Chance, Channel, normal
from arm_sim.imperfections.lines import Line
from arm_sim.imperfections.sensors import Sensors

DT, TICKS, NAMES = 1e-3, 20_000, ("one", "two")


def told(q: np.ndarray, v: np.ndarray | None = None, **scene: Any) -> list[np.ndarray]:
    """Measured positions, velocities and efforts of a motion without effort, shape (k, 2) each."""
    v = np.zeros_like(q) if v is None else v
    sensors, none = Sensors(schema.Sensors.model_validate(scene), NAMES, DT), np.zeros(2)
    sensors.restart(0, q[0], v[0], none)
    rows = [sensors.measured.copy()]
    for k in range(1, len(q)):
        sensors.sample(k, q[k], v[k], none)
        rows.append(sensors.measured.copy())
    return np.split(np.array(rows), 3, axis=1)


def swing(ticks: int = 1000, hertz: float = 2.0) -> tuple[np.ndarray, np.ndarray]:
    angle, each = 2.0 * np.pi * hertz * DT * np.arange(ticks), np.array([1.0, -0.5])
    return np.sin(angle)[:, None] * each, 2.0 * np.pi * hertz * np.cos(angle)[:, None] * each


def test_without_keys_the_motion_itself_is_told_to_the_bit() -> None:
    q, v = swing()
    for given, found in zip((q, v), told(q, v), strict=False):
        np.testing.assert_array_equal(found, given)


@pytest.mark.parametrize(
    ("position", "steps"),
    [
        ({"counts": 4096}, (2 * np.pi / 4096, 2 * np.pi / 4096)),
        ({"resolution": {"*": 1e-2, "two": 0}}, (1e-2, 0.0)),
        ({"resolution": 1e-3, "counts": {"two": 100}}, (1e-3, 2 * np.pi / 100)),
        ({"resolution": {"one": 1e-3}, "counts": 100}, (1e-3, 2 * np.pi / 100)),
    ],
)
def test_encoders_give_the_nearest_step(position: dict[str, Any], steps: list[float]) -> None:
    q, _ = swing()
    found = told(q, position=position)[0]
    for joint, step in enumerate(steps):
        error = found[:, joint] - q[:, joint]
        if step == 0.0:
            np.testing.assert_array_equal(error, 0.0)
            continue
        assert abs(error).max() <= 0.5 * step * (1.0 + 1e-9)
        count = found[:, joint] / step
        np.testing.assert_allclose(count, np.round(count), atol=1e-9)
        assert len(np.unique(np.round(count))) > 10


def test_what_is_rounded_has_its_error_in_it_already() -> None:
    found = told(np.zeros((9, 2)), position={"resolution": 0.1, "offset": 0.26})[0]
    np.testing.assert_allclose(found, 0.3)


def test_noise_and_offset_of_each_quantity() -> None:
    still, count = np.zeros((TICKS, 2)), TICKS
    given = {"noise": {"*": 0.1, "two": 0.3}, "offset": {"one": 2.0}}
    for found in told(still, position=given, velocity=given, effort=given):
        np.testing.assert_allclose(found.mean(axis=0), [2.0, 0.0], atol=5 * 0.3 / np.sqrt(count))
        np.testing.assert_allclose(found.std(axis=0), [0.1, 0.3], rtol=5 / np.sqrt(2 * count))


@pytest.mark.parametrize("joint", [0, 1])
def test_one_joint_alone_may_have_a_filter(joint: int) -> None:
    q, v = swing()
    filtered = told(q, v, velocity={"cutoff": {NAMES[joint]: 50.0}})[1]
    np.testing.assert_array_equal(filtered[:, 1 - joint], v[:, 1 - joint])
    assert abs(filtered[:, joint] - v[:, joint]).max() > 1e-3


def test_quantities_are_noisy_independently() -> None:
    given = {"noise": 1.0}
    found = np.hstack(told(np.zeros((5000, 2)), position=given, velocity=given, effort=given))
    assert abs(np.corrcoef(found.T) - np.eye(6)).max() < 5.0 / np.sqrt(5000)


def test_velocity_from_positions_is_their_difference() -> None:
    q, v = swing()
    position, velocity, _ = told(
        q, v, position={"resolution": 1e-3}, velocity={"from": "position"}
    )
    np.testing.assert_allclose(velocity[1:], np.diff(position, axis=0) / DT, rtol=1e-12)
    np.testing.assert_array_equal(velocity[0], v[0])


def test_spectrum_of_velocity_from_a_noisy_encoder() -> None:
    """White noise σ², seen through (1 - z⁻¹) / dt and the filter."""
    deviation, cutoff, order, ticks = 1e-4, 80.0, 2, 2**15
    found = told(
        np.zeros((ticks, 2)),
        position={"noise": deviation},
        velocity={"from": "position", "cutoff": cutoff, "order": order},
    )[1][:, 0]
    frequency, density = scipy.signal.welch(found, fs=1.0 / DT, nperseg=512)
    _, low_pass = scipy.signal.freqz(
        *scipy.signal.butter(order, cutoff, fs=1.0 / DT), frequency, fs=1.0 / DT
    )
    difference = 2.0 * np.sin(np.pi * frequency * DT) / DT
    expected = 2.0 * deviation**2 * DT * abs(difference * low_pass) ** 2
    some = slice(10, 250)  # away from zero and from half the rate
    ratio = density[some] / expected[some]
    assert abs(ratio.mean() - 1.0) < 0.03
    assert 0.5 < ratio.min() < ratio.max() < 1.6  # 127 averages: five deviations


def test_a_filter_has_settled_at_the_start() -> None:
    still, v = np.zeros((50, 2)), np.tile([0.5, -2.0], (50, 1))
    np.testing.assert_allclose(told(still, v, velocity={"cutoff": 20.0})[1], v, rtol=1e-12)


def test_a_state_that_is_lost_leaves_the_one_before_as_a_whole() -> None:
    q, v = swing()
    position, velocity, _ = told(q, v, loss=0.3)
    fresh = (position == q).all(axis=1)
    np.testing.assert_array_equal(fresh, (velocity == v).all(axis=1))
    np.testing.assert_array_equal(position[1:][~fresh[1:]], position[:-1][~fresh[1:]])
    assert 0.6 < fresh.mean() < 0.8


def test_a_filter_too_fast_for_the_ticks_is_refused_by_name() -> None:
    with pytest.raises(
        SceneError, match="cutoff' = 500 Hz of joint 'two'; allowed: less than 500 Hz"
    ):
        told(np.zeros((1, 2)), velocity={"cutoff": {"two": 500}})


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


def test_noise_is_white() -> None:
    samples = rows(noise(), np.arange(TICKS))
    for lag in (1, 2, 63, 64, 65):  # across blocks as within
        together = np.corrcoef(samples[lag:, 0], samples[:-lag, 0])[0, 1]
        assert abs(together) < 5.0 / np.sqrt(TICKS)


def received(**line: float) -> list[int | None]:
    """The newest message at each tick when one is sent in each."""
    carrier: Line[int] = Line(schema.Line(**line), DT, 3, Channel.STATES)
    return [carrier.carry(tick, tick) for tick in range(TICKS)]


def ages(**line: float) -> np.ndarray:
    newest = received(**line)
    return np.array([tick - sent for tick, sent in enumerate(newest) if sent is not None])


@pytest.mark.parametrize(("delay", "ticks"), [(0.0, 0), (0.001, 1), (0.0011, 2), (0.1, 100)])
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


def test_a_restart_forgets_what_is_on_the_way() -> None:
    line: Line[int] = Line(schema.Line(delay=0.002), DT, 3, Channel.STATES)
    line.send(0, 0)
    line.restart(received=7)
    assert [line.receive(tick) for tick in range(5)] == [7] * 5
