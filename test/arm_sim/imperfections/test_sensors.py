# SPDX-License-Identifier: Apache-2.0
"""Sensor readings of a known motion: resolution, offsets, noise, spectra, delays."""

from typing import Any

import numpy as np
import pytest
import scipy

from arm_dynamics import SceneError
from arm_dynamics.scene import imperfections as schema
from arm_sim.imperfections.sensors import Sensors

DT, NAMES = 1e-3, ("one", "two")


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
    still, count = np.zeros((20_000, 2)), 20_000
    given = {"noise": {"*": 0.1, "two": 0.3}, "offset": {"one": 2.0}}
    for found in told(still, position=given, velocity=given, effort=given):
        np.testing.assert_allclose(found.mean(axis=0), [2.0, 0.0], atol=5 * 0.3 / np.sqrt(count))
        np.testing.assert_allclose(found.std(axis=0), [0.1, 0.3], rtol=5 / np.sqrt(2 * count))


@pytest.mark.parametrize("joint", [0, 1])
def test_one_joint_alone_may_err(joint: int) -> None:
    for quantity, name in enumerate(("position", "velocity", "effort")):
        for kind in ("noise", "offset"):
            found = told(np.zeros((200, 2)), **{name: {kind: {NAMES[joint]: 0.1}}})[quantity]
            assert not found[:, 1 - joint].any() and found[:, joint].all()
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


def test_states_come_late() -> None:
    q, v = swing()
    position, velocity, _ = told(q, v, delay=0.005)
    np.testing.assert_array_equal(position[5:], q[:-5])
    np.testing.assert_array_equal(velocity[5:], v[:-5])
    np.testing.assert_array_equal(position[:5], np.tile(q[0], (5, 1)))  # known at the start


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
