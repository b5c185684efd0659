# SPDX-License-Identifier: Apache-2.0
"""Quintic trajectories: continuity, least jerk, limits, refusals; samples to the bit."""

from dataclasses import replace

import numpy as np
import pytest

from arm_dynamics import InvalidInput
from arm_dynamics.trajectory import (
    Limits,
    Reference,
    Trajectory,
    Waypoint,
    hold,
    quintic,
    quintic_through,
    stop,
)
from arm_dynamics.trajectory.quintics import extremes
from tolerances import ALGEBRA, assert_close

N = 3


def limits(
    velocity: float = np.inf, acceleration: float = np.inf, position: float = np.inf
) -> Limits:
    return Limits(
        np.full(N, velocity),
        np.full(N, acceleration),
        np.full(N, -position),
        np.full(N, position),
        ("base", "elbow", "wrist"),
    )


def random_waypoints(rng: np.random.Generator, count: int = 6) -> list[Waypoint]:
    times = np.concatenate(([0.0], np.cumsum(rng.uniform(0.2, 2.0, count - 1))))
    return [Waypoint(t, q) for t, q in zip(times, rng.normal(size=(count, N)), strict=True)]


def motion(trajectory: Trajectory, times: np.ndarray) -> np.ndarray:
    """Position, velocity and acceleration, shape (k, 3, n)."""
    return np.array([[s.q, s.v, s.a] for s in map(trajectory.sample, times)])


def test_open_derivatives_make_jerk_and_snap_continuous(rng: np.random.Generator) -> None:
    """The natural conditions of least ∫ jerk² dt."""
    trajectory = quintic(random_waypoints(rng))
    c, h = trajectory.coefficients, np.diff(trajectory.times)[:, None]
    jerk = np.array([6 * c[..., 3], 6 * c[..., 3] + 24 * c[..., 4] + 60 * c[..., 5]]) / h**3
    snap = np.array([24 * c[..., 4], 24 * c[..., 4] + 120 * c[..., 5]]) / h**4
    for start, end in (jerk, snap):
        assert_close(start[1:], end[:-1], 1e-9)


def test_given_derivatives_are_met(rng: np.random.Generator) -> None:
    waypoints = random_waypoints(rng)
    v, a = rng.normal(size=(2, N))
    waypoints[0] = Waypoint(0.0, waypoints[0].q, v, a)
    waypoints[2] = Waypoint(waypoints[2].time, waypoints[2].q, v)
    waypoints[3] = Waypoint(waypoints[3].time, waypoints[3].q, None, a)
    trajectory = quintic(waypoints)
    assert_close(trajectory.sample(0.0).v, v, ALGEBRA)
    assert_close(trajectory.sample(0.0).a, a, ALGEBRA)
    assert_close(trajectory.sample(waypoints[2].time).v, v, ALGEBRA)
    assert_close(trajectory.sample(waypoints[3].time).a, a, ALGEBRA)


def test_extremes_bound_every_sample_and_are_reached(rng: np.random.Generator) -> None:
    c = rng.normal(size=(12, N, 6))
    least, greatest = extremes(c)
    powers = np.linspace(0.0, 1.0, 2001)[:, None] ** np.arange(6)
    for order in range(3):
        values = c @ powers.T
        assert np.all(least[order][..., None] <= values + 1e-9)
        assert np.all(values - 1e-9 <= greatest[order][..., None])
        assert_close(values.max(axis=-1), greatest[order], 1e-4)
        assert_close(values.min(axis=-1), least[order], 1e-4)
        derivative = c[..., 1:] * np.arange(1, 6)
        c = np.concatenate((derivative, np.zeros((12, N, 1))), axis=-1)
        powers = np.linspace(0.0, 1.0, 2001)[:, None] ** np.arange(6)


@pytest.mark.parametrize(("velocity", "acceleration"), [(0.5, np.inf), (np.inf, 0.7)])
def test_stretches_to_keep_limits(
    rng: np.random.Generator, velocity: float, acceleration: float
) -> None:
    waypoints = random_waypoints(rng)
    free, kept = quintic(waypoints), quintic(waypoints, limits(velocity, acceleration))
    assert kept.stretch > 1.0
    times = np.linspace(0.0, free.duration, 3001)
    fast, slow = motion(free, times), motion(kept, kept.stretch * times)
    use = max(np.abs(slow[:, 1]).max() / velocity, np.abs(slow[:, 2]).max() / acceleration)
    assert 1.0 - 1e-4 < use < 1.0 + 1e-9
    assert_close(slow[:, 0], fast[:, 0], 1e-9)


def test_given_inner_derivatives_shrink_with_the_stretch() -> None:
    """Velocities by the stretch, accelerations by its square: the path is the same."""
    v, a = np.array([0.3, -0.2, 0.1]), np.array([0.4, 0.2, -0.5])
    waypoints = [Waypoint(0.0, np.zeros(N)), Waypoint(1.0, np.ones(N), v, a),
                 Waypoint(2.0, np.zeros(N))]  # fmt: skip
    kept = quintic(waypoints, limits(velocity=0.5))
    inner = kept.sample(kept.times[1])
    assert kept.stretch > 1.5
    assert_close(inner.v, v / kept.stretch, ALGEBRA)
    assert_close(inner.a, a / kept.stretch**2, ALGEBRA)


def test_start_in_motion_is_kept_while_stretching() -> None:
    start = Waypoint(0.0, np.zeros(N), np.full(N, 0.8), np.full(N, -0.5))
    trajectory = quintic([start, Waypoint(0.5, np.full(N, 2.0))], limits(1.0, 3.0))
    moving = motion(trajectory, np.linspace(0.0, trajectory.duration, 2001))
    assert trajectory.stretch > 1.0
    assert_close(moving[0, 1], start.v, ALGEBRA)
    assert_close(moving[0, 2], start.a, ALGEBRA)
    assert np.abs(moving[:, 1]).max() <= 1.0 + 1e-9
    assert np.abs(moving[:, 2]).max() <= 3.0 + 1e-9


def test_the_way_and_the_start_are_within_limits_unless_it_comes_back() -> None:
    still, back = Waypoint(0.0, np.zeros(N)), [Waypoint(0.0, [1.5, 0, 0]), Waypoint(1.0, [0] * N)]
    bulging = [Waypoint(0.0, np.zeros(N), [0.0, 0.0, 3.0]), Waypoint(3.0, np.zeros(N))]
    fast = [Waypoint(0.0, np.zeros(N), np.full(N, 2.0)), Waypoint(1.0, np.ones(N))]
    for way, within, said in (
        (
            [still, Waypoint(1.0, [0.5, 1.2, 0.5])],
            limits(position=1.0),
            r"elbow to 1\.2; .* -1 to 1",
        ),
        ([still, Waypoint(1.0, [1.0 + 1e-6, 0, 0])], limits(position=1.0), "base to 1"),
        (bulging, limits(position=1.0), "wrist to 1"),
        (fast, limits(velocity=1.0), "at any pace"),
    ):
        with pytest.raises(InvalidInput, match=said):
            quintic(way, within)
    assert_close(quintic(back, limits(position=1.0)).sample(1.0).q, np.zeros(N), ALGEBRA)


@pytest.mark.parametrize(
    ("velocity", "acceleration", "duration"),
    [(0.5, np.inf, 15 / 8 * 2 / 0.5), (np.inf, 0.5, np.sqrt(10 / np.sqrt(3) * 2 / 0.5))],
)
def test_chosen_duration_of_one_segment(
    velocity: float, acceleration: float, duration: float
) -> None:
    trajectory = quintic_through([np.zeros(N), [1.0, -2.0, 0.0]], limits(velocity, acceleration))
    assert_close(trajectory.duration, duration, 1e-9)


def test_chosen_durations_are_no_longer_than_those_of_single_segments_stretched() -> None:
    """Balancing alone makes this motion twice as long: to and fro, ever wider in between."""
    positions = [[-0.5, 0.8, 0.0], [0.9, -1.1, 0.0], [-1.3, 1.5, 0.0], [-0.5, 0.8, 0.0]]
    step = abs(np.diff(positions, axis=0)).max(axis=1)
    alone = np.maximum(15 / 8 * step / 2.0, np.sqrt(10 / np.sqrt(3) * step / 5.0))
    times = [0.0, *np.cumsum(alone).tolist()]
    points = [Waypoint(t, q) for t, q in zip(times, positions, strict=True)]
    stretched = quintic(points, limits(2.0, 5.0)).duration
    assert quintic_through(positions, limits(2.0, 5.0)).duration < stretched + 1e-9


@pytest.mark.parametrize(("speed", "time"), [(0.0, 0.2), (0.3, 0.2), (4.0, 1.5 * 4.0 / 8.0)])
def test_a_stop_takes_a_fifth_of_a_second_or_what_the_limit_asks_for(
    speed: float, time: float
) -> None:
    """Speed falls as v (1 - 3 s² + 2 s³): a way of v T/2."""
    v = np.array([speed, -0.5 * speed, 0.0])
    here = Reference(np.array([1.0, 2.0, 3.0]), v, np.zeros(N))
    end = stop(here, limits(acceleration=8.0))
    assert_close(end.duration, time, 1e-12)
    assert_close(end.sample(time).q, here.q + 0.5 * time * v, 1e-12)
    assert stop(here, limits(acceleration=8.0), least=2.0).duration == 2.0


@pytest.mark.parametrize(
    ("waypoints", "complaint"),
    [
        ([], "0 waypoints; allowed: 2"),
        ([Waypoint(0.0, [0.0]), Waypoint(0.0, [1.0])], "increasing from 0"),
        ([Waypoint(0.0, [0.0]), Waypoint(1.0, [1.0, 2.0])], "waypoint 1 has shape"),
        ([Waypoint(0.0, [0.0]), Waypoint(1.0, [0.0], [1.0])], "last waypoint"),
    ],
)
def test_malformed_waypoints_are_refused(waypoints: list[Waypoint], complaint: str) -> None:
    with pytest.raises(InvalidInput, match=complaint):
        quintic(waypoints)


def test_points_without_a_duration_are_refused() -> None:
    for positions, said in (([[0.0] * N], "w >= 2"), ([[0.0] * N] * 2, "0 and 1 coincide")):
        with pytest.raises(InvalidInput, match=said):
            quintic_through(positions, limits(velocity=1.0))


def test_many_samples_have_the_bits_of_single_ones(rng: np.random.Generator) -> None:
    path = quintic(random_waypoints(rng))
    times = np.concatenate([[-1.0, 0.0], path.times, rng.uniform(0.0, 9.0, 20), [99.0]])
    np.testing.assert_array_equal(path.at(times), motion(path, times).swapaxes(0, 1))


def bits(sampled: Reference) -> bytes:
    tau = b"" if sampled.tau is None else sampled.tau.tobytes()
    return sampled.q.tobytes() + sampled.v.tobytes() + sampled.a.tobytes() + tau


@pytest.mark.parametrize("kind", ["motion", "with torques", "hold"])
def test_without_a_compiler_samples_have_the_same_bits(
    kind: str, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    points = random_waypoints(rng)
    if kind == "with torques":
        points = [replace(point, tau=rng.normal(size=N)) for point in points]
    made = hold([0.5, -0.3]) if kind == "hold" else quintic(points)
    times = [-1.0, -1e-12, *made.times, made.duration + 1.0, *rng.uniform(0.0, 9.0, 200)]
    here = [bits(made.sample(t)) for t in times]
    monkeypatch.setattr("arm_dynamics.trajectory.trajectory.library", lambda: None)
    assert [bits(made.sample(t)) for t in times] == here
