# SPDX-License-Identifier: Apache-2.0
"""Trajectories at single times, with a compiler and without."""

import numpy as np
import pytest

from arm_dynamics.trajectory import Reference, Trajectory, Waypoint, hold, quintic, trajectory


def motion(rng: np.random.Generator, torques: bool = False) -> Trajectory:
    times = np.cumsum([0.0, 0.3, 0.5, 0.2, 0.9])
    points = zip(times, rng.normal(size=(5, 3)), rng.normal(size=(5, 3)), strict=True)
    return quintic([Waypoint(time, q, tau=tau if torques else None) for time, q, tau in points])


def bits(sampled: Reference) -> bytes:
    tau = b"" if sampled.tau is None else sampled.tau.tobytes()
    return sampled.q.tobytes() + sampled.v.tobytes() + sampled.a.tobytes() + tau


@pytest.mark.parametrize("kind", ["motion", "with torques", "hold"])
def test_without_a_compiler_it_has_the_same_bits(
    kind: str, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = hold([0.5, -0.3]) if kind == "hold" else motion(rng, kind != "motion")
    assert (made.torques is None) is (kind != "with torques")
    times = [-1.0, -1e-12, *made.times, made.duration + 1.0, *rng.uniform(0.0, 2.0, 200)]
    here = [bits(made.sample(t)) for t in times]
    monkeypatch.setattr(trajectory, "library", lambda: None)
    assert [bits(made.sample(t)) for t in times] == here


def test_a_motion_begins_and_ends_at_rest_at_its_ends(rng: np.random.Generator) -> None:
    made = motion(rng)
    for t, end in ((-0.1, 0), (made.duration, 1), (made.duration + 5.0, 1)):
        still = made.sample(t)
        np.testing.assert_array_equal(still.q, made.ends[end])
        assert not still.v.any() and not still.a.any()
    inside = made.sample(0.4)
    assert inside.v.any() and inside.a.any()
    with pytest.raises(ValueError, match="read-only"):
        inside.q[0] = 0.0
