# SPDX-License-Identifier: Apache-2.0
"""The whole arm is in what the panels of a page leave free, whatever the size of the page."""

import asyncio
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from arm_sim.view.framing import FIELD, TO_CAMERA, axes, direction, fitted, keep_framed


def seen(points: np.ndarray, position: np.ndarray, look_at: np.ndarray, aspect: float) -> Any:
    """Where points, shape (k, 3), are in the picture: right and up, -1 to 1, shape (k, 2)."""
    right, up, forward = ((points - position) @ axes(position - look_at).T).T
    return np.stack([right / aspect, up], axis=1) / forward[:, None] / np.tan(FIELD / 2)


@pytest.mark.parametrize("aspect", [0.3, 0.9, 4.0])
def test_a_camera_that_is_fitted_sees_all_points_and_is_as_near_as_can_be(
    aspect: float, rng: np.random.Generator
) -> None:
    """On a telephone, they are above the controls."""
    points = rng.uniform(-1.0, 1.0, (60, 3)) * [0.5, 0.3, 1.0] + [1.0, 2.0, 3.0]
    low, high = (0.27, 0.92) if aspect < 0.75 else (-0.85, 0.85)
    x, y = seen(points, *fitted(points, 0.0, aspect), aspect).T
    assert (abs(x) < 0.85 + 1e-9).all() and (low - 1e-9 < y).all() and (y < high + 1e-9).all()
    room = 0.85 - abs(x).max(), y.min() - low, high - y.max()
    assert min(room) < 1e-9  # nearer, they would not be inside
    position, look_at = fitted(points, 100.0, aspect)
    assert np.linalg.norm(position - look_at) == pytest.approx(100.0)


def test_arms_that_turn_about_one_level_axis_are_seen_almost_along_it() -> None:
    x, y, z = np.eye(3)
    way = direction(np.column_stack([y, -y, 0.0 * y]), np.eye(3))
    assert -way[1] > 0.9 * np.linalg.norm(way) and way[2] > 0.0
    for others in ([z, z], [y, z], [0.0 * z]):
        assert direction(np.column_stack(others), np.array([x, y, -x, -y])) is TO_CAMERA
        slender = direction(np.column_stack(others), np.array([y, -y, 0.1 * x]))
        assert slender[0] > 0.9 * np.linalg.norm(slender)


def test_a_camera_of_ours_follows_every_size_of_the_page(rng: np.random.Generator) -> None:
    points = rng.uniform(-1.0, 1.0, (60, 3)) * [0.5, 0.3, 1.0]
    welcomed: list[Any] = []
    server: Any = SimpleNamespace(
        initial_camera=SimpleNamespace(), on_client_connect=welcomed.append
    )
    keep_framed(server, points, 0.0)
    first, updates = server.initial_camera, list[Any]()
    camera = SimpleNamespace(
        position=first.position, look_at=first.look_at, aspect=1.0, on_update=updates.append
    )
    asyncio.run(welcomed[0](SimpleNamespace(camera=camera, atomic=nullcontext)))
    for aspect in (1.6, 0.5, 0.3, 4.0):
        camera.aspect = aspect
        asyncio.run(updates[0]())
        np.testing.assert_allclose(camera.position, fitted(points, 0.0, aspect)[0])
    mine = camera.position = camera.position + np.array([0.3, 0.0, 0.0])
    camera.aspect = 0.3  # a camera that the visitor has moved stays
    asyncio.run(updates[0]())
    assert camera.position is mine
